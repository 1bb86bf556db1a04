"""How a TIFF is made, and its pixels tile by tile."""

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import tifffile
from numpy.typing import NDArray

from panostitch.model.canvas import Region

logging.getLogger("tifffile").addHandler(logging.NullHandler())  # what it says of damaged files, we say by exceptions

MAGIC = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
# Of these, tifffile needs no further library: none, deflate, PackBits.
COMPRESSIONS = (1, 8, 32946, 32773)
LARGEST_SEGMENT = 256 << 20  # bytes
QUICK = 100e6  # px that are looked at without thinking; of larger pictures a smaller copy, if there is one
COLOURS = {0: "grey", 1: "grey", 2: "RGB"}
INVERTED, GREY, RGB, INTERLEAVED = 0, 1, 2, 1  # photometric interpretations; planar configuration


@dataclass(frozen=True)
class TiffLayout:
    """How a TIFF is made.

    format:  TIFF, or BigTIFF
    size:    (width, height) px
    levels:  (width, height) px of the smaller copies of itself
    storage: its compression, and whether it lies in tiles or strips, in words
    """

    format: str
    size: tuple[int, int]
    bits: int
    channels: str
    alpha: bool
    levels: tuple[tuple[int, int], ...]
    storage: str


def is_tiff(path: str) -> bool:
    """Whether a file begins like a TIFF."""
    with open(path, "rb") as file:
        return file.read(4) in MAGIC


def read_layout(path: str) -> TiffLayout:
    """How a TIFF is made. Raises whatever tifffile does where it is damaged."""
    with tifffile.TiffFile(path) as file:
        try:
            page = file.pages.first
        except (IndexError, KeyError):
            raise ValueError("it has no directory") from None
        if not (page.imagewidth > 0 and page.imagelength > 0):
            raise ValueError("it has no picture")
        return TiffLayout(
            "BigTIFF" if file.is_bigtiff else "TIFF",
            (page.imagewidth, page.imagelength),
            int(page.bitspersample),
            _channels(page),
            _alpha(page),
            tuple((small.imagewidth, small.imagelength) for small in _copies(page)),
            _storage(page),
        )


def pieces(path: str, *, most: float) -> Iterator[tuple[int, tuple[int, int], Region, NDArray[Any]]] | None:
    """Step, size (px of this level), place and pixels (h, w, channels) of each tile; None where it cannot be done.

    The pixels are those of the picture, or of the first of its smaller copies that is quickly looked at, each of whose
    pixels is `step` px wide. Black is 0. More than `most` pixels are not looked at.
    """
    with tifffile.TiffFile(path) as file:
        page, step = _level(file.pages.first)
        known = page.compression in COMPRESSIONS and page.photometric in (INVERTED, GREY, RGB)
        plain = page.planarconfig == INTERLEAVED and page.dtype is not None and page.bitspersample in (8, 16, 32)
        if page.imagewidth * page.imagelength > most:
            return None
        if not known or not plain or _segment_bytes(page) > LARGEST_SEGMENT:
            return None
    return _pieces(path, step)


def _pieces(path: str, step: int) -> Iterator[tuple[int, tuple[int, int], Region, NDArray[Any]]]:
    with tifffile.TiffFile(path) as file:
        page, _ = _level(file.pages.first)
        size = (page.imagewidth, page.imagelength)
        for data, place, shape in page.segments(maxworkers=1):
            region = Region(place[3], place[2], shape[2], shape[1]) & Region(0, 0, *size)
            if data is None:
                raise ValueError(f"the tile at {region.x}, {region.y} is missing")
            pixels = data[0, : region.height, : region.width]
            if pixels.shape[:2] != (region.height, region.width):
                raise ValueError(f"the tile at {region.x}, {region.y} is cut off")
            yield step, size, region, _unsigned(pixels) if page.photometric == INVERTED else pixels


def _unsigned(pixels: NDArray[Any]) -> NDArray[Any]:
    """Grey of which 0 is white, turned round."""
    return np.asarray((np.iinfo(pixels.dtype).max if pixels.dtype.kind in "ui" else 1) - pixels)


def _level(page: Any) -> tuple[Any, int]:
    """The picture, or the first of its copies that is quickly looked at; and how many px of it a pixel is wide."""
    for level in (page, *_copies(page)):
        if level.imagewidth * level.imagelength <= QUICK:
            return level, max(1, round(page.imagewidth / level.imagewidth))
    return page, 1


def _copies(page: Any) -> list[Any]:
    return [copy for copy in page.pages or () if 0 < copy.imagewidth < page.imagewidth]


def _segment_bytes(page: Any) -> int:
    width, height = (page.tilewidth, page.tilelength) if page.is_tiled else (page.imagewidth, page.rowsperstrip)
    return int(
        width * min(height, max(page.imagelength, page.tilelength)) * page.samplesperpixel * page.bitspersample // 8
    )


def _alpha(page: Any) -> bool:
    return any(_name(kind) in ("ASSOCALPHA", "UNASSALPHA") for kind in page.extrasamples)


def _channels(page: Any) -> str:
    colours = COLOURS.get(page.photometric) or _name(page.photometric).lower()
    others = len(page.extrasamples) - _alpha(page)
    return colours + " and alpha" * _alpha(page) + (f" and {others} more" if others else "")


def _storage(page: Any) -> str:
    compression = _name(page.compression).lower().removeprefix("adobe_").replace("none", "no compression")
    predictor = " with predictor" if page.predictor != 1 else ""
    lie = f"tiles of {page.tilewidth} x {page.tilelength}" if page.is_tiled else f"strips of {page.rowsperstrip} rows"
    return f"{lie}, {compression}{predictor}"


def _name(value: Any) -> str:
    return str(getattr(value, "name", value))
