"""How bright burnt light was: as bright as the photos show it that were exposed for less, or else white.

A factor that darkens a photo makes its white grey, or gives it a colour where channels have factors of their own, and a
sky that is burnt in blue alone turns green. So what is burnt is spared a share of its factor: as much as makes it look
like the photos that see the place and are not burnt there, and all of it where nobody knows, as raw developers do it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.burnt import read_at
from panostitch.compositing.light import expose, given_back, with_fall_off
from panostitch.compositing.overlaps import WHITE, Pieces, that_touch
from panostitch.model.canvas import Layer, Region
from panostitch.model.light import Light, radius_square

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]

ALIKE = 0.95  # of its factor times itself: where another photo shows less than burnt light must be, something has moved
INNER = np.ones((3, 3))  # px of the reduced canvas
# Cells, deviations of the blurs by which what is known of a photo spreads over it, and what each of them counts
NEAR = ((1.0, 1.0), (4.0, 0.02))
ANYWHERE = 4e-5  # what the mean of the photo counts
FEW = 4.0  # px of the reduced canvas that count as much, for that mean, as the guess that white is white
DARKER = 0.98  # a photo that is darkened by less does not show where its white is


@dataclass(frozen=True)
class Seen:
    """Where the pieces of a photo on the reduced canvas see it.

    size:   (width, height) px of the photo
    burnt:  how far it is burnt, a coarse map; None if nowhere
    pieces: the region of each, and the px of the photo (h, w, 2) that it shows there
    """

    size: tuple[int, int]
    burnt: Floats | None
    pieces: tuple[tuple[Region, Floats], ...]

    def xy(self, region: Region) -> Floats:
        """Px of the photo (h, w, 2) in a region of one piece."""
        return next(xy[region.within(place)] for place, xy in self.pieces if place & region == region)

    def square(self, region: Region) -> Doubles:
        """Squares (h, w) of the radii in a region of one piece."""
        return radius_square(self.xy(region).astype(np.float64), self.size)

    def cells(self, region: Region, shape: tuple[int, ...]) -> NDArray[np.intp]:
        """Numbers (h, w), row by row, of the cells of a coarse map in a region of one piece."""
        rows, columns = shape[:2]
        share = (self.xy(region) + np.float32(0.5)) / np.array(self.size, np.float32)
        x, y = (np.clip(share[..., k] * count, 0, count - 1).astype(np.intp) for k, count in ((0, columns), (1, rows)))
        return np.asarray(y * columns + x)


def expose_all(light: Light, pieces: Pieces, views: Sequence[Seen]) -> tuple[Light, list[tuple[int, Layer]]]:
    """The light with what it spares of the photos, and the pieces in it.

    From the photo that was exposed for the least to the one that was for the most: each learns from those before it.
    """
    spared: list[Floats | None] = [None] * len(views)
    exposed: dict[int, Layer] = {}
    near: dict[int, list[int]] = {}
    for a, b in that_touch([layer.region for _, layer in pieces]):
        near.setdefault(a, []).append(b)
        near.setdefault(b, []).append(a)
    for photo in np.argsort(-light.brightness, kind="stable").tolist():
        own = [number for number, (n, _) in enumerate(pieces) if n == photo]
        burnt, seen = views[photo].burnt, views[photo]
        if burnt is not None and light.gains[photo].min() < DARKER:
            others = {number: [exposed[n] for n in near.get(number, ()) if n in exposed] for number in own}
            told = [part for n, some in others.items() for part in _told(photo, pieces[n][1], light, seen, burnt, some)]
            spared[photo] = burnt[..., None] * _spread(told, burnt.shape)
        for number in own:
            exposed[number] = _exposed(photo, pieces[number][1], light, seen, spared[photo])
    return replace(light, spared=tuple(spared)), [(n, exposed[number]) for number, (n, _) in enumerate(pieces)]


def _exposed(photo: int, layer: Layer, light: Light, seen: Seen, spared: Floats | None) -> Layer:
    around = None if spared is None else read_at(spared, seen.xy(layer.region), seen.size)
    return Layer(layer.region, expose(layer.pixels, _factor(photo, layer.region, light, seen), around), layer.mask)


def _factor(photo: int, region: Region, light: Light, seen: Seen) -> Floats:
    """What to multiply a photo by: (h, w, 3), or (3,) where there is no fall-off.

    Not on the coarse grid of `light.factors`: on the reduced canvas a photo may be no larger than a few of its blocks.
    """
    if light.has_fall_off(photo):
        return with_fall_off(light, photo, seen.square(region))
    return np.asarray(light.gains[photo], np.float32)


def _told(
    photo: int, own: Layer, light: Light, seen: Seen, burnt: Floats, others: Sequence[Layer]
) -> Iterator[tuple[NDArray[np.intp], Floats, Floats]]:
    """What other photos say of the bright pixels of a piece, around what is burnt.

    Numbers (n,) of cell and channel, how much (n,) brighter others show it than its factor makes it, and how much
    (n,) it could be given back.
    """
    for other in others:
        common = own.region & other.region
        pixels, aims = (layer.pixels[common.within(layer.region)] for layer in (own, other))
        both = own.mask[common.within(own.region)] & other.mask[common.within(other.region)]
        near = both & (read_at(burnt, seen.xy(common), seen.size) > 0.5)
        if not near.any():
            continue
        factor = _factor(photo, common, light, seen)
        plain, room = pixels * factor, given_back(pixels, factor)
        same = near & (aims.mean(2) > ALIKE * plain.mean(2))
        # where all around is as bright: at edges of what is burnt, pixels are mixed
        known = same[..., None] & (cv2.erode(room, INNER) > 0)
        if known.any():
            numbers = seen.cells(common, burnt.shape)[..., None] * 3 + np.arange(3)
            yield numbers[known], (aims - plain)[known] / WHITE, room[known] / WHITE


def _spread(told: Sequence[tuple[NDArray[np.intp], Floats, Floats]], shape: tuple[int, ...]) -> Floats:
    """Shares (rows, columns, 3), by least squares: where nothing was told, as told near by, or of the whole."""
    size = int(np.prod(shape)) * 3
    total, count = np.zeros(size), np.zeros(size)
    for numbers, missing, room in told:
        total += np.bincount(numbers, missing * room, size)
        count += np.bincount(numbers, room**2, size)
    total, count = total.reshape(*shape, 3), count.reshape(*shape, 3)
    mean = (total.sum((0, 1)) + FEW) / (count.sum((0, 1)) + FEW)
    above, below = ANYWHERE * mean, np.full(3, ANYWHERE)
    for deviation, counts in NEAR:
        above = above + counts * cv2.GaussianBlur(total, (0, 0), deviation)
        below = below + counts * cv2.GaussianBlur(count, (0, 0), deviation)
    return np.asarray((above / below).clip(0, 1), np.float32)
