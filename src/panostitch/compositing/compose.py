"""A region of the panorama at full size: warp, light, seams, fine bands over what the low bands change."""

from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.blend import BLENDERS
from panostitch.compositing.blend.pieces import Floats, Piece, hard_composite
from panostitch.compositing.light import expose, factors
from panostitch.compositing.warp import Decoded, read_for, warp
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
    pieces = _pieces(alignment, canvas, plan, options, decoded, tile, region)
    composite, covered = hard_composite(pieces, (tile.height, tile.width))
    changes = [_change(plan, canvas, piece.photo, tile) for piece in pieces]
    blended = blender.join(pieces, changes, composite, plan.factor, options.bands)
    inner = region.within(tile)
    mask = covered[inner]
    return Layer(region, np.where(mask[..., None], blended[inner], 0).astype(np.float32), mask)


def with_halo(plan: Plan, options: CompositingOptions, region: Region) -> Region:
    """What must be made so that a region comes out as it does from the whole canvas."""
    return region.grown(BLENDERS[options.blender].reach(plan.factor) * plan.factor, multiple=plan.factor)


def _pieces(
    alignment: Alignment,
    canvas: Canvas,
    plan: Plan,
    options: CompositingOptions,
    decoded: Decoded,
    tile: Region,
    region: Region,
) -> list[Piece]:
    """The photos that own a part of the tile or lie next to it, each with the part it owns.

    Where there is but one, no pixel looks at another one, and what lies around the region is left blank.
    """
    labels = label_rectangle(plan, canvas, tile)
    photos = [int(n) for n in np.unique(labels)]
    layers = []
    for n in photos:
        photo, camera = alignment.photos[n], alignment.cameras[n]
        raster, camera = decoded.get(n, partial(read_for, photo, camera, canvas))
        seen = region if len(photos) == 1 else tile
        layer = warp(raster, camera, canvas, seen, interpolation=INTERPOLATION[options.interpolation])
        pixels = expose(layer.pixels, factors(plan.light, n, camera, canvas, seen))
        layers.append(_framed(pixels, layer.mask, seen, tile))
    owner = _owners(labels, photos, [mask for _, mask in layers], plan.factor)
    whole = (slice(0, tile.height), slice(0, tile.width))
    return [
        Piece(n, whole, pixels, mask, owner == k)
        for k, (n, (pixels, mask)) in enumerate(zip(photos, layers, strict=True))
    ]


def _framed(pixels: Floats, mask: NDArray[np.bool_], seen: Region, tile: Region) -> tuple[Floats, NDArray[np.bool_]]:
    """Pixels and mask of a region in the arrays of a tile around it."""
    if seen == tile:
        return pixels, mask
    inner, size = seen.within(tile), (tile.height, tile.width)
    framed, covered = np.zeros((*size, 3), np.float32), np.ones(size, bool)
    framed[inner], covered[inner] = pixels, mask
    return framed, covered


def _owners(
    labels: NDArray[np.int16], photos: list[int], masks: list[NDArray[np.bool_]], factor: int
) -> NDArray[np.int64]:
    """Index into `photos` of each pixel's owner (h, w): by the enlarged labels, among the photos that cover it."""
    owner = np.zeros(masks[0].shape, np.int64)
    if len(photos) == 1:
        return owner
    largest = np.full(owner.shape, -1, np.float32)
    for k, (n, mask) in enumerate(zip(photos, masks, strict=True)):
        # to cover a pixel counts for more than to be near it
        share = _enlarge((labels == n).astype(np.float32), factor) + np.float32(2) * mask
        owner[share > largest] = k
        np.maximum(largest, share, out=largest)
    return owner


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
            padded = np.pad(change, ((margin, margin), (margin, margin), (0, 0)), mode="edge")
            for turn in turns:
                place = region.grown(margin).moved(turn * width)
                common = wide & place
                if common:
                    found[common.within(wide)] = padded[common.within(place)]
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
