"""A PNG strip by strip. OpenCV and Pillow decode the whole picture; here they get one small PNG after the other.

The rows of a strip are written as a PNG of their own, below the last row of the strip before: filters look up one row.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import IO, Any

import cv2
import numpy as np
from numpy.typing import NDArray

SIGNATURE = b"\x89PNG\r\n\x1a\n"
STRIP = 16 << 20  # bytes, uncompressed
READ = 1 << 20  # bytes
LARGEST_ROW = 64 << 20  # bytes
GROWTH = 1032  # deflate makes no more of a byte
# Colours of a pixel, and where OpenCV has them.
ORDER = {0: (0,), 2: (2, 1, 0), 4: (0, 3), 6: (2, 1, 0, 3)}


@dataclass(frozen=True)
class PngHeader:
    """The chunk IHDR. kind: 0 grey, 2 RGB, 3 palette, 4 grey and alpha, 6 RGBA"""

    width: int
    height: int
    bits: int
    kind: int
    interlaced: bool

    @property
    def row(self) -> int:
        """Bytes of a row, without its filter."""
        return self.width * len(ORDER[self.kind]) * self.bits // 8

    @property
    def in_strips(self) -> bool:
        """Whether it can be decoded strip by strip."""
        return self.kind in ORDER and self.bits in (8, 16) and not self.interlaced


def read_header(path: str) -> PngHeader:
    """The header of a PNG. Raises ValueError where there is none."""
    with open(path, "rb") as file:
        data = file.read(33)
    if len(data) < 33 or data[:8] != SIGNATURE or data[12:16] != b"IHDR":
        raise ValueError("the header is damaged")
    width, height, bits, kind, _, _, interlaced = struct.unpack(">IIBBBBB", data[16:29])
    return PngHeader(width, height, bits, kind, bool(interlaced))


def read_strips(path: str, header: PngHeader) -> Iterator[NDArray[Any]]:
    """The rows (h, w, channels) of a PNG, a strip at a time. Raises ValueError where it is damaged."""
    stride = header.row + 1
    if header.row > LARGEST_ROW:
        raise ValueError(f"a row of {header.row >> 20} MB is no picture")
    most = max(1, STRIP // stride)
    above, left = bytes(header.row), header.height
    with open(path, "rb") as file:
        rows = _Inflated(file)
        while left:
            count = min(most, left)
            pixels = _decoded(header, count, b"\0" + above + rows.read(count * stride))
            above = np.ascontiguousarray(pixels[-1]).astype(f">u{header.bits // 8}").tobytes()
            left -= count
            yield pixels


def is_plausible(header: PngHeader, size: int) -> bool:
    """Whether a file of so many bytes can hold the picture that it claims."""
    return header.height * header.width / 8 <= size * GROWTH


def _decoded(header: PngHeader, count: int, rows: bytes) -> NDArray[Any]:
    head = struct.pack(">IIBBBBB", header.width, count + 1, header.bits, header.kind, 0, 0, 0)
    png = SIGNATURE + _chunk(b"IHDR", head) + _chunk(b"IDAT", zlib.compress(rows, 0)) + _chunk(b"IEND", b"")
    pixels = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ValueError("its pixels cannot be decoded")
    every = pixels[..., None] if pixels.ndim == 2 else pixels
    return np.asarray(every[1:, :, list(ORDER[header.kind])])


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


class _Inflated:
    """What the IDAT chunks of a PNG hold, uncompressed as it is asked for."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file, self._left, self._inflate = file, 0, zlib.decompressobj()
        self._file.seek(len(SIGNATURE))

    def read(self, count: int) -> bytes:
        """So many bytes. Raises ValueError where the file ends before."""
        parts, missing = [], count
        while missing:
            data = self._inflate.unconsumed_tail or self._next()
            part = self._inflate.decompress(data, missing)
            if not part and not data:
                raise ValueError("the file ends before the picture does")
            parts.append(part)
            missing -= len(part)
        return b"".join(parts)

    def _next(self) -> bytes:
        """The next compressed bytes; empty at the end."""
        while not self._left:
            head = self._file.read(8)
            if len(head) < 8 or head[4:] == b"IEND":
                return b""
            length = struct.unpack(">I", head[:4])[0]
            if head[4:] == b"IDAT":
                self._left = length
            else:
                self._file.seek(length, 1)
            if not self._left:
                self._file.seek(4, 1)  # the checksum
        data = self._file.read(min(READ, self._left))
        self._left = self._left - len(data) if data else 0
        if not self._left:
            self._file.seek(4, 1)
        return data
