"""How much memory compositing takes, estimated before it is taken; the numbers are measured (NumPy's peak)."""

from collections.abc import Sequence

import numpy as np

from panostitch.compositing.compose import label_rectangle, with_halo
from panostitch.compositing.warp import CACHE_BYTES
from panostitch.model.canvas import Canvas, Region
from panostitch.model.panorama import Plan
from panostitch.model.photo import Photo
from panostitch.options import CompositingOptions
from panostitch.runtime.memory import resident

TILE_PIXEL = 90  # bytes for each pixel of a tile with its halo
PHOTO_PIXEL = 20  # bytes more for each photo that it shows
DECODING = 8  # bytes for each pixel of a photo of 8 bits that is being decoded, its result among them
DECODED = 4  # bytes for each pixel of a photo of 8 bits that is kept, with its mask
SHARE = 0.25  # of the memory that is left: for photos that are kept


def tile_bytes(photos: Sequence[Photo], canvas: Canvas, plan: Plan, options: CompositingOptions, region: Region) -> int:
    """Bytes that `compose` takes for a region while it works."""
    tile = with_halo(plan, options, region)
    count = len(np.unique(label_rectangle(plan, canvas, tile)))
    return tile.area * (TILE_PIXEL + PHOTO_PIXEL * count) + decoding_bytes(photos)


def decoding_bytes(photos: Sequence[Photo]) -> int:
    """Bytes that it takes to decode the largest photo."""
    return DECODING * _largest(photos)


def photo_budget(photos: Sequence[Photo], memory: int | None) -> int:
    """Bytes for photos that are kept decoded: a part of what a limit leaves, but at least the largest photo."""
    if memory is None:
        return CACHE_BYTES
    spare = int((memory - resident()) * SHARE)
    return min(CACHE_BYTES, max(spare, DECODED * _largest(photos)))


def _largest(photos: Sequence[Photo]) -> int:
    """Samples of 8 bits in one channel of the largest photo: its pixels, or twice as many of 16 bits."""
    return max(photo.size[0] * photo.size[1] * photo.depth // 8 for photo in photos)
