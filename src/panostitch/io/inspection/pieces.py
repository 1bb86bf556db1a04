"""The pixels of a picture piece by piece, and what is empty among them."""

import os
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from panostitch.io.inspection import png_strips, tiff_pages
from panostitch.io.inspection.border import Border, Emptiness, is_empty
from panostitch.io.readers import FORMATS
from panostitch.model.canvas import Region

# Step (px of the picture in one of these pixels), size of the whole in these pixels, place, pixels (h, w, channels)
Piece = tuple[int, tuple[int, int], Region, NDArray[Any]]

MOST_WHOLE = 100e6  # px of a picture that is decoded in one piece: 400 MB
MOST = 1000e6  # px of a picture that is decoded at all: a minute or so
REDUCED = 16e6  # px to which a JPEG is reduced


def find_border(path: str, kind: str, size: tuple[int, int], *, alpha: bool) -> tuple[Border | None, str]:
    """What is empty in a picture, or why that was not looked for. Raises what decoders do where it is damaged."""
    pieces = _pieces(path, kind, size, alpha=alpha)
    if isinstance(pieces, str):
        return None, pieces
    gathered = None
    for step, whole, region, pixels in pieces:
        gathered = gathered or Emptiness(whole, step)
        gathered.add(region, is_empty(pixels, alpha=alpha))
    if gathered is None:
        raise ValueError("it has no pixels")
    return gathered.border("transparent" if alpha else "black"), ""


def _pieces(path: str, kind: str, size: tuple[int, int], *, alpha: bool) -> Iterator[Piece] | str:
    """The pieces, or why there are none."""
    area = size[0] * size[1]
    if kind in ("JPEG", "MPO"):
        return _reduced_jpeg(path)
    if kind == "TIFF":
        found = tiff_pages.pieces(path, most=MOST)
        if found is not None:
            return found
    if kind == "PNG":
        header = png_strips.read_header(path)
        if not png_strips.is_plausible(header, os.path.getsize(path)):
            raise ValueError(f"it claims {area / 1e6:.0f} megapixels, of which so small a file holds but a few")
        if header.in_strips and area <= MOST and not _has_transparent_colour(path):
            return _png(path)
    if area > MOST_WHOLE:
        return f"not looked for: a {kind} of this kind and size is not decoded"
    return _whole_tiff(path) if kind == "TIFF" else _whole(path, alpha=alpha)


def _reduced_jpeg(path: str) -> Iterator[Piece] | str:
    """Grey, reduced by the decoder."""
    with Image.open(path, formats=FORMATS) as image:
        if image.info.get("progressive") and image.size[0] * image.size[1] > MOST_WHOLE:
            return "not looked for: a progressive JPEG of this size is not decoded"
    return _jpeg(path)


def _jpeg(path: str) -> Iterator[Piece]:
    with Image.open(path, formats=FORMATS) as image:
        width, height = image.size
        factor = next((n for n in (1, 2, 4) if width * height / n**2 <= REDUCED), 8)
        image.draft("L", (max(1, width // factor), max(1, height // factor)))
        grey = np.asarray(image.convert("L"))
    step = max(1, round(width / grey.shape[1]))
    yield step, (grey.shape[1], grey.shape[0]), Region.of(grey), grey[..., None]


def _png(path: str) -> Iterator[Piece]:
    header, y = png_strips.read_header(path), 0
    for pixels in png_strips.read_strips(path, header):
        yield 1, (header.width, header.height), Region(0, y, header.width, len(pixels)), pixels
        y += len(pixels)


def _has_transparent_colour(path: str) -> bool:
    with Image.open(path, formats=FORMATS) as image:
        return "transparency" in image.info


def _whole(path: str, *, alpha: bool) -> Iterator[Piece]:
    with Image.open(path, formats=FORMATS) as image:
        pixels = (
            np.asarray(image)[..., None]
            if image.mode.startswith("I")
            else np.asarray(image.convert("RGBA" if alpha else "RGB"))
        )
    yield 1, (pixels.shape[1], pixels.shape[0]), Region.of(pixels), pixels


def _whole_tiff(path: str) -> Iterator[Piece] | str:
    """By OpenCV, which knows more kinds of TIFF than Pillow."""
    pixels = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        return "not looked for: its pixels cannot be decoded"
    height, width = pixels.shape[:2]
    return iter([(1, (width, height), Region(0, 0, width, height), pixels.reshape(height, width, -1))])
