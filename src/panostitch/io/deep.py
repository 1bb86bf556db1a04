"""PNG and TIFF of 16 bits a channel. Pillow knows their headers but has no such pixels; OpenCV decodes them."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np
import tifffile
from numpy.typing import NDArray
from PIL import Image, TiffImagePlugin

from panostitch.errors import InputError
from panostitch.io.foreign import check_tags
from panostitch.io.orientation import asked_for
from panostitch.model.photo import Pixels

DeepPixels = NDArray[np.uint16]

BITS, PHOTOMETRIC, PLANES, SAMPLE_FORMAT = 258, 262, 284, 339  # tags of TIFF
WHITE_IS_ZERO, INTERLEAVED, UNSIGNED = 0, 1, 1
WHITE = np.uint16(65535)
COPY_ANEW = "copy it anew from the camera"
SAVE_ANEW = "save it as grey or RGB, with 8 or 16 bits a channel"


@dataclass(frozen=True)
class DeepFile:
    """Pixels of 16 bits of a photo in a file.

    orientation: the EXIF orientation that makes them upright
    alpha:       its fourth channel says where the photo shows something
    negative:    0 is white
    """

    path: str
    orientation: int
    alpha: bool
    negative: bool

    def read(self, scale: float = 1.0) -> tuple[DeepPixels, Pixels | None]:
        """Upright RGB pixels (h, w, 3) at `scale` <= 1 and the mask (h, w) of alpha, if any. Raises InputError."""
        try:
            stored = cv2.imdecode(np.fromfile(self.path, np.uint8), cv2.IMREAD_UNCHANGED)
        except (OSError, cv2.error, MemoryError) as error:
            raise InputError(f"{self.path}: broken: {str(error) or type(error).__name__}") from None
        if stored is None or stored.dtype != np.uint16:
            raise InputError(f"{self.path}: broken: its pixels cannot be decoded", hint=COPY_ANEW)
        has_mask = self.alpha and stored.ndim == 3 and stored.shape[2] == 4
        # only 65535 is wholly opaque, as 255 is of 8 bits
        mask = np.asarray(np.asarray(stored[..., 3], np.uint16) >> 8, np.uint8) if has_mask else None
        pixels = _rgb(np.asarray(stored, np.uint16))
        if self.negative:
            np.subtract(WHITE, pixels, out=pixels)
        size = (pixels.shape[1], pixels.shape[0])
        asked = partial(asked_for, whole=size, scale=scale, orientation=self.orientation)
        return asked(pixels), None if mask is None else asked(mask)


@dataclass(frozen=True)
class InEightBits:
    """The same photo for those to whom 8 bits are enough."""

    deep: DeepFile

    def read(self, scale: float = 1.0) -> tuple[Pixels, Pixels | None]:
        """Upright RGB pixels (h, w, 3) at `scale` <= 1 and the mask (h, w) of alpha, if any. Raises InputError."""
        pixels, mask = self.deep.read(scale)
        return to_bytes(pixels), mask


def to_bytes(pixels: DeepPixels) -> Pixels:
    """Pixels of 16 bits, rounded to 8: 65535 becomes 255."""
    return np.asarray(cv2.convertScaleAbs(pixels, alpha=1 / 257), np.uint8)


def deep_file(image: Image.Image, path: str, orientation: int) -> DeepFile | None:
    """How to read an opened picture with 16 bits; None where it has fewer. Raises InputError for what is unknown."""
    tags: Mapping[int, Any] = image.tag_v2 if isinstance(image, TiffImagePlugin.TiffImageFile) else {}
    if tags:
        check_tags(path, tags)
        _check_kind(image.mode, tags, path)
        deep = set(tags.get(BITS, ())) == {16}
    else:
        deep = image.format == "PNG" and _png_bits(path) == 16
    if not deep or image.mode == "CMYK":
        return None
    alpha = "A" in image.mode or "transparency" in image.info
    return DeepFile(path, orientation, alpha, tags.get(PHOTOMETRIC) == WHITE_IS_ZERO)


def _check_kind(mode: str, tags: Mapping[int, Any], path: str) -> None:
    """Raise InputError for numbers whose black and white nobody knows, and for planes that would be mixed up."""
    deepest = max(tags.get(BITS, (1,)))
    if mode == "F" or set(tags.get(SAMPLE_FORMAT, (UNSIGNED,))) - {UNSIGNED}:
        why = "its pixels are floating point or signed numbers, whose black and white are unknown"
    elif deepest > 16:
        why = f"its pixels have {deepest} bits, more than 16"
    elif deepest == 16 and tags.get(PLANES, INTERLEAVED) != INTERLEAVED:
        why = "its 16-bit colours lie in planes of their own"
    else:
        return
    raise InputError(f"{path}: cannot be read: {why}", hint=SAVE_ANEW)


def unknown_tiff(path: str) -> InputError | None:
    """What is special about a TIFF that Pillow does not know; None where it is no TIFF."""
    try:
        with tifffile.TiffFile(path) as file:
            page = file.pages.first
            colours = getattr(page.photometric, "name", page.photometric)
            kind = f"{page.samplesperpixel} x {page.dtype}, {str(colours).lower()}"
    except Exception:  # tifffile promises nothing about damaged files
        return None
    return InputError(f"{path}: this kind of TIFF is not known: {kind}", hint=SAVE_ANEW)


def _png_bits(path: str) -> int:
    """Bits of a channel, which stand in a PNG's header at byte 24."""
    with open(path, "rb") as file:
        return file.read(25)[24]


def _rgb(stored: DeepPixels) -> DeepPixels:
    """RGB of what OpenCV makes of a file: grey, BGR or BGRA."""
    if stored.ndim == 2:
        return np.asarray(cv2.cvtColor(stored, cv2.COLOR_GRAY2RGB), np.uint16)
    code = cv2.COLOR_BGR2RGB if stored.shape[2] == 3 else cv2.COLOR_BGRA2RGB
    return np.asarray(cv2.cvtColor(stored, code), np.uint16)
