"""A region of the panorama at full size: warp, light, seams, fine bands over what the low bands change."""

from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.blend import BLENDERS
from panostitch.compositing.blend.pieces import Floats, Piece, hard_composite, only
from panostitch.compositing.light import expose, factors
from panostitch.compositing.warp import Decoded, misses, read_for, warp
from panostitch.model.alignment import Alignment
from panostitch.model.canvas import Canvas, Layer, Region
from panostitch.model.panorama import Plan
from panostitch.options import CompositingOptions

EDGE = 8  # px of the reduced canvas by which a change goes on beyond its photo's footprint, for the halo of tiles
INTERPOLATION = {
    "nearest": cv2.INTER_NEAREST,
    "linear": cv2.INTER_LINEAR,
    "cubic": cv2.INTER_CUBIC,
    "lanczos": cv2.INTER_LANCZOS4,
}
LABEL_MARGIN = 2  # px of the reduced canvas around a tile, so that enlarging needs no edge


def compose(
    alignment: Alignment, canvas: Canvas, plan: Plan, options: CompositingOptions, decoded: Decoded, region: Region
) -> Layer:
    """The pixels of a region of the canvas. The same pixels come out however the canvas is cut into regions."""
    blender = BLENDERS[options.blender]
    tile = with_halo(plan, options, region)
    labels = label_rectangle(plan, canvas, tile)
    photos = [int(n) for n in np.unique(labels)]
    seen = partial(_seen, alignment, canvas, plan, options, decoded)
    if len(photos) == 1:
        # no pixel looks at another one: nothing is needed around the region
        if misses(alignment.cameras[photos[0]], canvas, region):
            size = region.height, region.width
            return Layer(region, np.zeros((*size, 3), np.float32), np.zeros(size, bool))
        layer = seen(photos[0], region)
        change = _change(plan, canvas, photos[0], tile)
        pixels, covered = blender.alone(layer.pixels, change, plan.factor, region.within(tile)), layer.mask
    else:
        places = [_place(labels == n, plan, options, tile) for n in photos]
        pieces = _pieces(
            labels, tile, plan.factor, [(n, seen(n, place)) for n, place in zip(photos, places, strict=True)]
        )
        composite, mask = hard_composite(pieces, (tile.height, tile.width))
        changes = [_change(plan, canvas, n, place) for n, place in zip(photos, places, strict=True)]
        blended = blender.join(pieces, changes, composite, plan.factor, options.bands)
        inner = region.within(tile)
        pixels, covered = blended[inner], mask[inner]
    if not covered.all():
        pixels = only(pixels, covered)
    return Layer(region, pixels, covered)


def with_halo(plan: Plan, options: CompositingOptions, region: Region) -> Region:
    """What must be made so that a region comes out as it does from the whole canvas."""
    return region.grown(BLENDERS[options.blender].reach(plan.factor) * plan.factor, multiple=plan.factor)


def _place(owned: NDArray[np.bool_], plan: Plan, options: CompositingOptions, tile: Region) -> Region:
    """The part of a tile in which a photo is needed: what it may own by its labels (h, w), and a halo around that."""
    rows, columns = (np.flatnonzero(owned.any(axis)) for axis in (1, 0))
    small = tile.divided(plan.factor)
    x, y = small.x - LABEL_MARGIN + int(columns[0]), small.y - LABEL_MARGIN + int(rows[0])
    labelled = Region(x, y, int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1)
    return labelled.grown(BLENDERS[options.blender].reach(plan.factor) + LABEL_MARGIN).times(plan.factor) & tile


def _seen(
    alignment: Alignment,
    canvas: Canvas,
    plan: Plan,
    options: CompositingOptions,
    decoded: Decoded,
    photo: int,
    region: Region,
) -> Layer:
    """A photo in a region of the canvas, in the panorama's light."""
    raster, camera = decoded.get(photo, partial(read_for, alignment.photos[photo], alignment.cameras[photo], canvas))
    layer = warp(raster, camera, canvas, region, interpolation=INTERPOLATION[options.interpolation])
    pixels = expose(layer.pixels, factors(plan.light, photo, camera, canvas, region))
    return Layer(region, pixels, layer.mask)


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
    # the middle of a reduced pixel lies (factor - 1) / 2 px from its first pixel
    back = np.float32((plan.factor - 1) / (2 * plan.factor))
    found = found[:, 1:] * (1 - back) + found[:, :-1] * back
    return np.asarray(found[1:] * (1 - back) + found[:-1] * back, np.float32)


def _enlarge(small: Floats, factor: int) -> Floats:
    """A piece of the reduced canvas with its margin, at full size without it."""
    size = (small.shape[1] * factor, small.shape[0] * factor)
    large = cv2.resize(small, size, interpolation=cv2.INTER_LINEAR)
    cut = slice(LABEL_MARGIN * factor, -LABEL_MARGIN * factor)
    return np.asarray(large[cut, cut], np.float32)
