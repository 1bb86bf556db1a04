"""Pictures as data URIs: they lie in the page itself."""

import base64
from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from panostitch.debug.ink import Picture, fit, to_bytes
from panostitch.errors import PanostitchError
from panostitch.model.photo import Photo

JPEG_QUALITY = 80
PHOTO = 900  # px, longest side of a photo where there are few
PHOTOS_BYTES = 3_000_000  # of all photos together; base64 makes four bytes of three
SMALLEST_PHOTO = 48  # px, below which nothing is to be seen
FILL = 0.95  # of the bytes that are allowed, so that few rounds suffice


@dataclass(frozen=True)
class Shown:
    """A picture in the page: `uri` with its size (width, height) px."""

    uri: str
    size: tuple[int, int]


def shown(picture: Picture, quality: int = JPEG_QUALITY) -> Shown:
    """A picture (h, w, 3) RGB as a JPEG in a data URI. Raises ValueError if it cannot be one."""
    data = _encoded(picture, quality)
    height, width = picture.shape[:2]
    return Shown("data:image/jpeg;base64," + base64.b64encode(data).decode("ascii"), (width, height))


def photos_shown(photos: Mapping[str, Photo]) -> dict[str, Shown]:
    """Each photo by its name, all of one size, and as large as the bytes for all of them allow.

    Photos that cannot be read any more are not in it.
    """
    longest = PHOTO
    pictures = {name: read for name, photo in photos.items() if (read := _read(photo, longest)) is not None}
    while (total := sum(len(_encoded(p, JPEG_QUALITY)) for p in pictures.values())) > PHOTOS_BYTES:
        if longest <= SMALLEST_PHOTO:
            break
        longest = max(SMALLEST_PHOTO, int(longest * FILL * (PHOTOS_BYTES / total) ** 0.5))
        pictures = {name: to_bytes(fit(picture, longest)) for name, picture in pictures.items()}
    return {name: shown(picture) for name, picture in pictures.items()}


def _read(photo: Photo, longest: int) -> Picture | None:
    try:
        pixels, mask = photo.source.read(min(1.0, longest / max(photo.size)))
    except PanostitchError:
        return None
    if mask is not None:
        # colours under transparent pixels are anybody's guess
        pixels = np.where(mask[..., None] > 0, pixels, np.uint8(128))
    return to_bytes(fit(pixels, longest))


def _encoded(picture: Picture, quality: int) -> bytes:
    done, data = cv2.imencode(".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise ValueError(f"cannot encode a picture of shape {picture.shape}")
    return data.tobytes()
