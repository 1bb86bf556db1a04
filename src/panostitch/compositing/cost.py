"""How much memory compositing takes, estimated before it is taken; the numbers are measured (NumPy's peak)."""

from collections.abc import Sequence

from panostitch.compositing.compose import Work
from panostitch.compositing.warp import CACHE_BYTES
from panostitch.model.canvas import Region
from panostitch.model.photo import Photo
from panostitch.runtime.memory import resident

TILE_PIXEL = 90  # bytes for each pixel of a tile with its halo
PHOTO_PIXEL = 20  # bytes more for each photo that it shows
# Bytes for each pixel of a photo, by the bits of its channels:
DECODING = {8: 14, 16: 24}  # that is being decoded, its file and the result among them (a JPEG of 8 bits takes 7)
DECODED = {8: 4, 16: 7}  # that is kept, with its mask
SHARE = 0.25  # of the memory that is left: for photos that are kept


def tile_bytes(work: Work, region: Region) -> int:
    """Bytes that `compose` takes for a region while it works."""
    tile = work.around(region)
    return tile.area * (TILE_PIXEL + PHOTO_PIXEL * len(work.photos(region))) + decoding_bytes(work.alignment.photos)


def decoding_bytes(photos: Sequence[Photo]) -> int:
    """Bytes that it takes to decode the largest photo."""
    return _largest(photos, DECODING)


def decoded_bytes(photos: Sequence[Photo]) -> int:
    """Bytes that all photos take, decoded."""
    return sum(photo.size[0] * photo.size[1] * DECODED[photo.depth] for photo in photos)


def photo_budget(photos: Sequence[Photo], memory: int | None) -> int:
    """Bytes for photos that are kept decoded: a part of what a limit leaves, but at least the largest photo."""
    if memory is None:
        return CACHE_BYTES
    spare = int((memory - resident()) * SHARE)
    return min(CACHE_BYTES, max(spare, _largest(photos, DECODED)))


def _largest(photos: Sequence[Photo], pixel: dict[int, int]) -> int:
    return max(photo.size[0] * photo.size[1] * pixel[photo.depth] for photo in photos)
