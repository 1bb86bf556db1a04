"""How much memory compositing takes, estimated before it is taken; the numbers are measured (NumPy's peak)."""

from collections.abc import Callable, Sequence

from panostitch.compositing.compose import IN_CACHE, Work
from panostitch.compositing.warp import CACHE_BYTES
from panostitch.model.canvas import Region
from panostitch.model.panorama import NOBODY
from panostitch.model.photo import Photo
from panostitch.runtime.memory import resident

REGION_PIXEL = 30  # bytes for each pixel of a region: itself, its parts, and what is made of it
TILE_PIXEL = 90  # bytes for each pixel of a part with its halo in which photos meet
PHOTO_PIXEL = 20  # bytes more for each photo that it shows
# Bytes for each pixel of a photo, by the bits of its channels:
DECODING = {8: 14, 16: 24}  # that is being decoded, its file and the result among them (a JPEG of 8 bits takes 7)
DECODED = {8: 4, 16: 7}  # that is kept, with its mask
SHARE = 0.25  # of the memory that is left: for photos that are kept


def tile_bytes(work: Work, region: Region) -> int:
    """Bytes that `compose` takes for a region while it works."""
    # as thin as parts get, and as long as they may be then: that has the largest halo
    width = min(region.width, work.smallest // 2)
    part = Region(0, 0, width, min(region.height, max(IN_CACHE, work.smallest**2) // width))
    joined = work.around(part).area * (TILE_PIXEL + PHOTO_PIXEL * len(work.photos(region)))
    return region.area * REGION_PIXEL + joined + decoding_bytes(work.alignment.photos)


def shown_bytes(
    photos: Sequence[Photo], of_region: Callable[[Region], frozenset[int]], regions: Sequence[Region]
) -> int:
    """Bytes that the photos take which are needed at once when these regions are read in their order.

    of_region: the numbers of the photos that a region is made of
    """
    shown = [of_region(region) for region in regions]
    last = {photo: number for number, own in enumerate(shown) for photo in own}
    most, needed = 0, set[int]()
    for number, own in enumerate(shown):
        needed |= own
        most = max(most, decoded_bytes([photos[photo] for photo in needed if photo != NOBODY]))
        needed -= {photo for photo in needed if last[photo] == number}
    return most


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
