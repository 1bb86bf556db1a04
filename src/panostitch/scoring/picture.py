"""The judge of a finished picture, whoever made it: it knows the picture and the photos, and nothing else."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from panostitch.geometry.sampling import rescale
from panostitch.model.canvas import Layer, Region
from panostitch.model.photo import Photo
from panostitch.model.score import Places
from panostitch.runtime.cache import LastUsed
from panostitch.runtime.executor import Executor, serial
from panostitch.scoring.places import MARGIN, STEP, judge_tile
from panostitch.scoring.register import REDUCE_BELOW, SmoothMap, register, resized, seen_in
from panostitch.scoring.summary import joined

Pixels = NDArray[np.uint8]
Raster = tuple[Pixels, Pixels | None]

TILE = 40 * STEP  # px
SAME_SIZE = 1.05  # times larger or smaller, up to which a picture is judged as it is
KEPT = 1 << 30  # bytes of decoded photos


def judge(picture: Pixels, photos: Sequence[Photo], *, run: Executor = serial) -> Places:
    """What is wrong at the places of a picture (h, w, 3) RGB, or (h, w, 4) where alpha says where it is empty.

    What one photo alone shows has no seam and no faults. Measured in px of the photos, however large the picture is;
    places lie on the picture as it is.
    """
    rgb: Pixels = np.ascontiguousarray(picture[..., :3])
    mask = np.asarray(picture[..., 3] > 254 if picture.shape[2] == 4 else rgb.any(-1))
    maps = register(rgb, photos)
    if not maps:
        return joined([])
    factor = float(np.median([known.scale for _, known in maps]))
    if abs(np.log(factor)) > np.log(SAME_SIZE):
        size = max(1, round(rgb.shape[1] * factor)), max(1, round(rgb.shape[0] * factor))
        maps = [(n, known.from_resized(rgb.shape[1::-1], size)) for n, known in maps]
        rgb, mask = resized(rgb, size), resized(mask.astype(np.uint8), size) > 0
    factor = rgb.shape[1] / picture.shape[1]
    decoded: LastUsed[Raster] = LastUsed(KEPT, lambda raster: sum(a.nbytes for a in raster if a is not None))
    whole = Region.of(rgb)
    tiles = whole.tiles(TILE)
    work = partial(_judge_tile, rgb, mask, photos, maps, decoded)
    places = joined(list(run.map(work, tiles, label="Judging")))
    return replace(places, xy=rescale(places.xy, 1 / factor))


def _judge_tile(
    rgb: Pixels,
    mask: NDArray[np.bool_],
    photos: Sequence[Photo],
    maps: Sequence[tuple[int, SmoothMap]],
    decoded: LastUsed[Raster],
    tile: Region,
) -> Places:
    whole = Region.of(rgb)
    region = tile.grown(MARGIN)
    layers = []
    for n, known in maps:
        if region & known.place:
            scale = 1 / known.scale
            raster = decoded.get(n, partial(photos[n].source.read, scale if scale < REDUCE_BELOW else 1.0))
            layer = seen_in(known.scaled(raster[0].shape[1::-1]), raster, region)
            if layer.mask.any():
                layers.append(layer)
    if not layers:
        return joined([])
    common = region & whole
    pixels, covered = (
        np.zeros((region.height, region.width, 3), np.float32),
        np.zeros((region.height, region.width), bool),
    )
    inside = common.within(region)
    pixels[inside], covered[inside] = rgb[common.within(whole)], mask[common.within(whole)]
    return judge_tile(Layer(region, pixels, covered), layers)
