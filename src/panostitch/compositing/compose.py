"""A region of the panorama at full size: warp, light, seams, fine bands over what the low bands change."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.blend import BLENDERS, Blender
from panostitch.compositing.blend.pieces import Floats, Piece, hard_composite, only
from panostitch.compositing.crop import bounding_box
from panostitch.compositing.light import expose, factors, spared_in
from panostitch.compositing.warp import Blocks, Decoded, Raster, blocks, read_for, sample
from panostitch.model.alignment import Alignment
from panostitch.model.canvas import Canvas, Layer, Region
from panostitch.model.light import Light
from panostitch.model.panorama import Plan
from panostitch.options import CompositingOptions

EDGE = 8  # px of the reduced canvas by which a change goes on beyond its photo's footprint, for the halo of tiles
INTERPOLATION = {
    "nearest": cv2.INTER_NEAREST,
    "linear": cv2.INTER_LINEAR,
    "cubic": cv2.INTER_CUBIC,
    "lanczos": cv2.INTER_LANCZOS4,
}
LARGEST = 1 << 18  # px, most that is made in one go,
IN_CACHE = 1 << 17  # and around seams, or sampled and exposed, while it is in the processor's cache
SMALLEST = 128  # px: no side is cut that is no longer
LABEL_MARGIN = 2  # px of the reduced canvas around a tile, so that enlarging needs no edge


@dataclass(frozen=True)
class Work:
    """What all regions of a panorama are made of."""

    alignment: Alignment
    canvas: Canvas
    plan: Plan
    options: CompositingOptions
    decoded: Decoded
    _photos: dict[Region, frozenset[int]] = field(default_factory=dict, init=False, repr=False)

    @property
    def blender(self) -> Blender:
        """How photos are joined."""
        return BLENDERS[self.options.blender]

    @property
    def halo(self) -> int:
        """How far around a region (px of the reduced canvas) its pixels look."""
        return self.blender.reach(self.plan.factor)

    @property
    def smallest(self) -> int:
        """Side (px) down to which regions are cut: smaller ones would be mostly halo."""
        return max(SMALLEST, 2 * self.halo * self.plan.factor)

    def around(self, region: Region) -> Region:
        """What must be made so that a region comes out as it does from the whole canvas."""
        return region.grown(self.halo * self.plan.factor, multiple=self.plan.factor)

    def photos(self, region: Region) -> frozenset[int]:
        """The numbers of the photos that a region is made of; who plans the tiles asks for the same ones often."""
        if region not in self._photos:
            labels = label_rectangle(self.plan, self.canvas, self.around(region))
            self._photos[region] = frozenset(np.unique(labels).tolist())
        return self._photos[region]


def compose(work: Work, region: Region) -> Layer:
    """The pixels of a region of the canvas. The same pixels come out however the canvas is cut into regions.

    So it is cut where seams are, until little is left that more than one photo matters to.
    """
    sight = Sight(work, work.around(region))
    layers = [
        _alone(sight, photos[0], part) if len(photos) == 1 else _joined(sight, photos, part)
        for part, photos in sight.parts(region)
    ]
    return layers[0] if len(layers) == 1 else together(region, layers)


def together(region: Region, layers: Iterable[Layer]) -> Layer:
    """Layers that share out a region."""
    pixels, mask = np.empty((region.height, region.width, 3), np.float32), np.empty((region.height, region.width), bool)
    for layer in layers:
        place = layer.region.within(region)
        pixels[place], mask[place] = layer.pixels, layer.mask
    return Layer(region, pixels, mask)


@dataclass(frozen=True)
class Sight:
    """What is to be seen in a region of the canvas; what its parts have in common is made once.

    region: its sides are multiples of the factor of the reduction
    """

    work: Work
    region: Region
    _grids: dict[int, Blocks] = field(default_factory=dict)
    _photos: dict[Region, list[int]] = field(default_factory=dict)

    @cached_property
    def _labels(self) -> NDArray[np.int16]:
        return label_rectangle(self.work.plan, self.work.canvas, self.region)

    def labels(self, tile: Region) -> NDArray[np.int16]:
        """The labels of the plan under a part, with a margin."""
        small, whole = (r.divided(self.work.plan.factor).grown(LABEL_MARGIN) for r in (tile, self.region))
        return self._labels[small.within(whole)]

    def photos(self, part: Region) -> list[int]:
        """The numbers of the photos that a part is made of."""
        if part not in self._photos:
            # what `labels` of what is `around` it has; this is asked for many parts
            factor, reach = self.work.plan.factor, self.work.halo + LABEL_MARGIN
            x, y = (first // factor - LABEL_MARGIN for first in (self.region.x, self.region.y))
            rows = slice(part.y // factor - reach - y, -(-part.bottom // factor) + reach - y)
            columns = slice(part.x // factor - reach - x, -(-part.right // factor) + reach - x)
            labels = self._labels[rows, columns]
            alone = labels.min() == labels.max()
            self._photos[part] = [int(labels[0, 0])] if alone else [int(n) for n in np.unique(labels)]
        return self._photos[part]

    def parts(self, region: Region) -> Iterator[tuple[Region, list[int]]]:
        """A region in parts that are best made in one go, each with its photos.

        A part in which photos meet is cut in halves while that leaves fewer of them in one, or while it is large.
        """
        photos = self.photos(region)
        halves = self._halves(region, photos)
        if not halves:
            yield region, photos
        for half in halves:
            yield from self.parts(half)

    def _halves(self, region: Region, photos: list[int]) -> list[Region]:
        """The halves of a region, cut so that they hold as few photos as possible; none where it stays whole."""
        if len(photos) == 1 and region.area <= LARGEST:
            return []
        # the first one of those that leave as many counts
        across = region.width >= region.height
        sides = {1: region.width, 0: region.height} if across else {0: region.height, 1: region.width}
        ways = [
            region.halves(axis, multiple=self.work.plan.factor)
            for axis, side in sides.items()
            if side > self.work.smallest
        ]
        left = [sum(len(self.photos(half)) for half in way) for way in ways]
        if not ways or (region.area <= IN_CACHE and min(left) == 2 * len(photos)):
            return []
        return ways[left.index(min(left))]

    def grid(self, photo: int, part: Region) -> Blocks:
        """Where a photo is seen in a part."""
        if photo not in self._grids:
            self._grids[photo] = blocks(self.work.alignment.cameras[photo], self.work.canvas, self.region)
        return self._grids[photo].part(part)

    def layer(self, photo: int, part: Region) -> Layer:
        """A photo in a part, in the panorama's light."""
        work, own = self.work, self.work.alignment.cameras[photo]
        raster, camera = work.decoded.get(photo, partial(read_for, work.alignment.photos[photo], own, work.canvas))
        known = self._grids.get(photo)
        if known is None or known.camera.size != camera.size:  # that of the whole photo, made before it was read
            self._grids[photo] = blocks(camera, work.canvas, self.region)
        bands = part.tiles(part.width, max(1, IN_CACHE // part.width))
        layers = (lit(raster, self.grid(photo, band), work.plan.light, photo, work.options) for band in bands)
        return next(layers) if len(bands) == 1 else together(part, layers)


def lit(raster: Raster, grid: Blocks, light: Light, photo: int, options: CompositingOptions) -> Layer:
    """A photo at the pixels of a grid's region, in the panorama's light."""
    sampled = sample(raster, grid, INTERPOLATION[options.interpolation])
    return Layer(
        grid.region, expose(sampled.pixels, factors(light, photo, grid), spared_in(light, photo, grid)), sampled.mask
    )


def _alone(sight: Sight, photo: int, part: Region) -> Layer:
    """A part in which one photo alone matters: no pixel looks at another one."""
    if sight.grid(photo, part).misses:
        size = part.height, part.width
        return Layer(part, np.zeros((*size, 3), np.float32), np.zeros(size, bool))
    work, tile, layer = sight.work, sight.work.around(part), sight.layer(photo, part)
    change = _change(work.plan, work.canvas, photo, tile)
    pixels = work.blender.alone(layer.pixels, change, work.plan.factor, part.within(tile))
    return Layer(part, pixels if layer.mask.all() else only(pixels, layer.mask), layer.mask)


def _joined(sight: Sight, photos: list[int], part: Region) -> Layer:
    """A part in which photos meet."""
    work, tile = sight.work, sight.work.around(part)
    labels = sight.labels(tile)
    places = [_place(labels == n, work, tile) for n in photos]
    layers = [(n, sight.layer(n, place)) for n, place in zip(photos, places, strict=True)]
    pieces = _pieces(labels, tile, work.plan.factor, layers)
    composite, mask = hard_composite(pieces, (tile.height, tile.width))
    changes = [_change(work.plan, work.canvas, n, place) for n, place in zip(photos, places, strict=True)]
    blended = work.blender.join(pieces, changes, composite, work.plan.factor, work.options.bands)
    inner = part.within(tile)
    pixels, covered = blended[inner], mask[inner]
    return Layer(part, pixels if covered.all() else only(pixels, covered), covered)


def _place(owned: NDArray[np.bool_], work: Work, tile: Region) -> Region:
    """The part of a tile in which a photo is needed: what it may own by its labels (h, w), and a halo around that."""
    small, box = tile.divided(work.plan.factor), bounding_box(owned)
    labelled = replace(box, x=small.x - LABEL_MARGIN + box.x, y=small.y - LABEL_MARGIN + box.y)
    return labelled.grown(work.halo + LABEL_MARGIN).times(work.plan.factor) & tile


def _pieces(labels: NDArray[np.int16], tile: Region, factor: int, layers: list[tuple[int, Layer]]) -> list[Piece]:
    """Photos in a tile, each with the part it owns: by the enlarged labels, among the photos that cover a pixel."""
    owner = np.zeros((tile.height, tile.width), np.int32)
    largest = np.full(owner.shape, -1, np.float32)
    for k, (n, layer) in enumerate(layers):
        place = layer.region.within(tile)
        # to cover a pixel counts for more than to be near it
        share = _enlarge((labels == n).astype(np.float32), factor)[place] + np.float32(2) * layer.mask
        owner[place][share > largest[place]] = k
        np.maximum(largest[place], share, out=largest[place])
    return [
        Piece(n, place, layer.pixels, layer.mask, owner[place] == k)
        for k, (n, layer) in enumerate(layers)
        for place in [layer.region.within(tile)]
    ]


def label_rectangle(plan: Plan, canvas: Canvas, tile: Region) -> NDArray[np.int16]:
    """The labels of the plan under a tile, with a margin; columns wrap where the canvas does."""
    small = tile.divided(plan.factor).grown(LABEL_MARGIN)
    height, width = plan.labels.shape
    columns = np.arange(small.x, small.right)
    columns = columns % width if canvas.wraps else columns.clip(0, width - 1)
    rows = np.arange(small.y, small.bottom).clip(0, height - 1)
    return np.asarray(plan.labels[np.ix_(rows, columns)], np.int16)


def _change(plan: Plan, canvas: Canvas, photo: int, tile: Region) -> Floats:
    """What the low bands change in a photo, at every `factor`-th pixel of a tile."""
    small = tile.divided(plan.factor)
    wide = Region(small.x - 1, small.y - 1, small.width + 1, small.height + 1)
    found = _change_over(plan, canvas, photo, wide)
    # the middle of a reduced pixel lies (factor - 1) / 2 px from its first pixel
    back = np.float32((plan.factor - 1) / (2 * plan.factor))
    found = found[:, 1:] * (1 - back) + found[:, :-1] * back
    return np.asarray(found[1:] * (1 - back) + found[:-1] * back, np.float32)


def _change_over(plan: Plan, canvas: Canvas, photo: int, wide: Region) -> Floats:
    """The change of a photo over a region of the reduced canvas, which may reach beyond its edges."""
    for region, change in plan.changes[photo]:
        if wide & region == wide:
            return change[wide.within(region)]
    found = np.zeros((wide.height, wide.width, 3), np.float32)
    turns = (-1, 0, 1) if canvas.wraps else (0,)
    width = canvas.size[0] // plan.factor
    # edges first: where a photo goes on across the edge of a full turn, its own pixels then count
    for margin in (EDGE, 0):
        for region, change in plan.changes[photo]:
            for turn in turns:
                at = region.moved(turn * width)
                common = wide & at.grown(margin)
                if common:
                    rows = np.arange(common.y, common.bottom).clip(at.y, at.bottom - 1) - at.y
                    columns = np.arange(common.x, common.right).clip(at.x, at.right - 1) - at.x
                    found[common.within(wide)] = change[np.ix_(rows, columns)]
    return found


def _enlarge(small: Floats, factor: int) -> Floats:
    """A piece of the reduced canvas with its margin, at full size without it."""
    size = (small.shape[1] * factor, small.shape[0] * factor)
    large = cv2.resize(small, size, interpolation=cv2.INTER_LINEAR)
    cut = slice(LABEL_MARGIN * factor, -LABEL_MARGIN * factor)
    return np.asarray(large[cut, cut], np.float32)
