"""The one rule by which pictures are judged: a small place of a good panorama is what one of its photos shows.

Not all of it has to come from that photo, but it has to look the same: shifted, if at all, as a whole, and lighter or
darker, if at all, as a whole. What none of the photos shows like that is wrong, whoever made the panorama, and wherever
its seams are. Each place is a patch (see `patches`) between its neighbours on a grid, left and right, above and below.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.color import deltaE_ciede2000, rgb2lab

from panostitch.model.canvas import Layer
from panostitch.model.score import Places
from panostitch.scoring import patches
from panostitch.scoring.patches import ALIKE, HALF, NOISE, SIDE, Found, Grey

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Indices = NDArray[np.intp]

STEP = (SIDE - 1) // 2  # px between places: neighbours of a place touch each other in its middle
REACH = 12  # px to which a patch is sought: displacements up to this are measured
MARGIN = HALF + REACH + STEP  # px of picture that a place needs around it
FLAT = 2 * NOISE  # grey levels, contrast of a patch below which any flat patch is like it
DARK, BRIGHT = 8.0, 247.0  # grey levels beyond which a channel says nothing of the light
LIT = 0.9  # share of a patch that must lie between
CALM = 20.0  # grey levels, contrast of a patch up to which a step beside it would be seen
EVEN = 8.0  # CIEDE2000 between the two sides of a place in a photo, up to which a step there would be seen
SHARP_FROM = 3.0  # grey levels, contrast from one px to the next of a photo that has sharpness to lose
VERY_ALIKE = 0.95  # correlation from which on the same thing is sharp or blurred
CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)  # a place and its neighbours
TOO_ALIKE = 0.95  # correlation of two photos of which nobody knows which one shines through


@dataclass(frozen=True)
class _Seen:
    """What one photo says of a grid of places (rows, columns).

    found:   shape (rows * columns), see `patches.find`
    colour:  (rows, columns, 3) of the photo where the patch was found
    sharp:   (rows, columns) contrast from one px to the next there, beyond noise
    """

    found: Found
    colour: Floats
    sharp: Floats

    def grid(self, values: NDArray[np.generic]) -> NDArray[np.generic]:
        """Values of `found` as a grid."""
        return values.reshape(*self.colour.shape[:2], *values.shape[1:])


def judge_tile(picture: Layer, photos: Sequence[Layer], where: Booleans | None = None) -> Places:
    """What is wrong at the places of a tile, all but its MARGIN; their `xy` are those of the picture.

    photos: each in the same region, where it lies in the picture, to a pixel or so
    where:  (h, w), at which pixels a place is wanted; at all of them without
    """
    height, width = picture.mask.shape
    columns, rows = (np.arange(MARGIN - STEP, n - MARGIN + STEP, STEP) for n in (width, height))
    x, y = np.meshgrid(columns, rows)
    centres = np.column_stack([x.ravel(), y.ravel()])
    wanted = np.ones(x.shape, bool) if where is None else where[y, x]
    grey = patches.softened(picture.pixels)
    contrast = np.sqrt(patches.variance(grey))[y, x]
    colour, sharp = _colours(picture)[y, x], _sharpness(picture.pixels)[y, x]
    softs = [patches.softened(layer.pixels) for layer in photos]
    sought = cv2.dilate(wanted.astype(np.uint8), CROSS) > 0
    flat = contrast < FLAT
    seen = [_look(grey, soft, layer, centres, sought, flat) for soft, layer in zip(softs, photos, strict=True)]
    inside = wanted & (cv2.erode(picture.mask.view(np.uint8), np.ones((SIDE + 2 * STEP,) * 2))[y, x] > 0)
    alike = np.stack([photo.found.alike.reshape(x.shape) for photo in seen])
    showing = (alike > patches.NOWHERE).sum(0)
    # one photo alone: there is no seam; or it is not the photo that this comes from, and nobody can tell
    alone = (showing == 1) & ((alike.max(0) >= ALIKE) | flat)
    structure = _structure(contrast, seen)
    measures = (
        _displacement(seen),
        _colour_step(colour, contrast, seen),
        structure,
        _ghost(grey, softs, centres, contrast, structure, seen),
        _blur(colour, sharp, seen),
    )
    flawless = (np.nan, np.nan, 0.0, 0.0, np.nan)
    inner = (inside & (alone | (showing > 1)))[1:-1, 1:-1]
    xy = np.stack([x + picture.region.x, y + picture.region.y], axis=-1)[1:-1, 1:-1]
    stated = (np.where(alone, none, measure) for none, measure in zip(flawless, measures, strict=True))
    return Places(xy[inner].astype(np.float64), *(values[1:-1, 1:-1][inner] for values in stated))


def _look(grey: Grey, soft: Grey, layer: Layer, centres: Indices, sought: Booleans, flat: Booleans) -> _Seen:
    found = patches.find(grey, soft, layer.mask, centres, REACH, sought.ravel())
    shape = sought.shape
    # a flat patch is found anywhere, by its noise; it is where it should be
    at = centres + np.where(flat.ravel()[:, None], 0, np.rint(found.shift).astype(int))
    there = at[:, 1], at[:, 0]
    return _Seen(
        found,
        _colours(layer)[there].reshape(*shape, 3),
        _sharpness(layer.pixels)[there].reshape(shape),
    )


def _colours(layer: Layer) -> Floats:
    """Mean (h, w, 3) of the patch around each pixel; NaN where it is too dark or too bright to tell of the light."""
    mean = cv2.boxFilter(layer.pixels, cv2.CV_64F, (SIDE, SIDE))
    lit = cv2.inRange(layer.pixels, (DARK,) * 3, (BRIGHT,) * 3)
    mean[cv2.boxFilter(lit, cv2.CV_32F, (SIDE, SIDE)) < LIT * 255] = np.nan
    return np.asarray(mean)


def _sharpness(pixels: NDArray[np.float32]) -> Floats:
    """Contrast (h, w) from one px to the next in the patch around each pixel, beyond that of noise."""
    grey = cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY)
    across, down = (np.diff(grey, axis=axis, append=0) for axis in (1, 0))
    square = np.asarray(across**2 + down**2, np.float32)
    return np.asarray(np.sqrt(np.maximum(cv2.boxFilter(square, cv2.CV_64F, (SIDE, SIDE)), 0)))


def _sides(grid: Floats) -> list[tuple[Floats, Floats]]:
    """For each place, its neighbours left and right, and those above and below; NaN at the border."""
    edge = [(1, 1), (1, 1)] + [(0, 0)] * (grid.ndim - 2)
    wide = np.pad(grid, edge, constant_values=np.nan)
    return [(wide[1:-1, :-2], wide[1:-1, 2:]), (wide[:-2, 1:-1], wide[2:, 1:-1])]


def _most(values: Sequence[Floats]) -> Floats:
    """The largest (h, w), of what is known."""
    return np.asarray(np.fmax.reduce(list(values)))


def _least(values: Sequence[Floats], shape: tuple[int, ...]) -> Floats:
    """The smallest (h, w), of what is known; NaN where nothing is."""
    return np.asarray(np.fmin.reduce([np.full(shape, np.nan), *values]))


def _displacement(seen: Sequence[_Seen]) -> Floats:
    """How far the two sides of each place are shifted against each other, by the photo in which they are least so."""
    jumps: list[list[Floats]] = [[], []]
    shape = seen[0].sharp.shape
    for photo in seen:
        shift = np.where(photo.found.known[:, None], photo.found.shift, np.nan).reshape(*shape, 2)
        for k, (one, other) in enumerate(_sides(shift)):
            jumps[k].append(np.hypot(*np.moveaxis(one - other, -1, 0)))
    return _most([_least(jump, shape) for jump in jumps])


def _colour_step(colour: Floats, contrast: Floats, seen: Sequence[_Seen]) -> Floats:
    """How much the two sides of each place differ in colour where they do not in a photo, by the most alike photo.

    Only where the photo is even: across what has an edge anyway nobody sees a step, and no factor of the light holds.
    """
    steps: list[list[Floats]] = [[], []]
    shape = contrast.shape
    for photo in seen:
        alike = photo.found.alike.reshape(shape)
        usable = ((alike >= ALIKE) & (contrast < CALM)) | ((contrast < FLAT) & (alike > patches.NOWHERE))
        theirs = np.where(usable[..., None], photo.colour, np.nan)
        for k, ((one, other), (their_one, their_other)) in enumerate(zip(_sides(colour), _sides(theirs), strict=True)):
            # the other side in the light of the one: were the light even, it would not change
            changed = np.clip(their_other * one / their_one, 0, 255)
            even = _ciede(their_one, their_other) <= EVEN
            steps[k].append(np.where(even, _ciede(other, changed), np.nan))
    return _most([_least(step, shape) for step in steps])


def _ciede(one: Floats, other: Floats) -> Floats:
    known = np.isfinite(one).all(-1) & np.isfinite(other).all(-1)
    found = np.full(known.shape, np.nan)
    if known.any():
        ciede2000: Any = deltaE_ciede2000  # has no types
        found[known] = ciede2000(rgb2lab(one[known] / 255), rgb2lab(other[known] / 255))
    return found


def _structure(contrast: Floats, seen: Sequence[_Seen]) -> Floats:
    """Contrast of each patch that is not as in the photo that is most alike."""
    unlike = []
    for photo in seen:
        alike = photo.found.alike.reshape(contrast.shape)
        rest = (1 - np.clip(alike, 0, 1) ** 2) * contrast**2 - NOISE**2
        unlike.append(np.where(alike > patches.NOWHERE, np.sqrt(np.maximum(rest, 0)), np.nan))
    return _least(unlike, contrast.shape)


def _blur(colour: Floats, sharp: Floats, seen: Sequence[_Seen]) -> Floats:
    """Share of the finest contrast that is missing, compared with the sharpest photo of the same thing."""
    lost = []
    for photo in seen:
        gain = colour.mean(-1) / photo.colour.mean(-1)
        theirs = photo.sharp * gain
        usable = (photo.found.alike.reshape(sharp.shape) >= VERY_ALIKE) & (theirs > SHARP_FROM)
        lost.append(np.where(usable, np.maximum(1 - sharp / np.maximum(theirs, SHARP_FROM), 0), np.nan))
    return _most(lost)


def _ghost(
    grey: Grey, softs: Sequence[Grey], centres: Indices, contrast: Floats, structure: Floats, seen: Sequence[_Seen]
) -> Floats:
    """Contrast of each patch that a second photo, or the same one shifted, explains where one alone does not."""
    ghost = np.where(np.isfinite(structure), 0.0, np.nan).ravel()
    for n in np.flatnonzero(structure.ravel() > NOISE):
        x, y = centres[n]
        patch = _patch(grey, x, y)
        others = []
        for soft, photo in zip(softs, seen, strict=True):
            for shift, alike in (
                (photo.found.shift[n], photo.found.alike[n]),
                (photo.found.other_shift[n], photo.found.other_alike[n]),
            ):
                if alike > 0:
                    others.append(_patch(soft, x + shift[0], y + shift[1]))
        ghost[n] = contrast.ravel()[n] * np.sqrt(_by_two(patch, others))
    return ghost.reshape(contrast.shape)


def _patch(grey: Grey, x: float, y: float) -> Floats:
    """A patch (SIDE^2) without its mean, of length one."""
    patch = cv2.getRectSubPix(grey, (SIDE, SIDE), (float(x), float(y))).ravel().astype(np.float64)
    patch -= patch.mean()
    return np.asarray(patch / max(float(np.linalg.norm(patch)), 1e-9))


def _by_two(patch: Floats, others: Sequence[Floats]) -> float:
    """Share of the patch that a sum of two of the others explains beyond the best one, as far as nothing is left then.

    Where one ends and the other begins their sum explains a part as well, but leaves much.
    """
    if len(others) < 2:
        return 0.0
    stack = np.stack(others)
    a, among = stack @ patch, stack @ stack.T
    first, second = np.triu_indices(len(stack), 1)
    p, q, c = a[first], a[second], among[first, second]
    # weights of both are positive: it shines through, it is not taken away
    real = (p > c * q) & (q > c * p) & (c < TOO_ALIKE)
    if not real.any():
        return 0.0
    both = ((p**2 + q**2 - 2 * p * q * c) / (1 - np.minimum(c, TOO_ALIKE) ** 2))[real].max()
    alone = max(float(a.max()), 0.0) ** 2
    more = max(0.0, min(float(both), 1.0) - alone)
    return more**2 / max(1 - alone, 1e-9)
