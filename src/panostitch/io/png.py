"""PNG row by row: a header, one zlib stream, an end.

OpenCV and Pillow want the whole picture; pypng takes rows, but compresses them unfiltered, on one thread.
"""

import struct
import zlib
from typing import IO

import numpy as np

from panostitch.io.embed import Embedded, png_chunks
from panostitch.io.rendering import Pixels, Rendering, Samples

LEVEL = 3  # a quarter of the time of the best compression for a few per cent of size
COLOUR_TYPES = {3: 2, 4: 6}
SUB, UP = 1, 2


def write_png(file: IO[bytes], picture: Rendering, own: Embedded) -> None:
    """Write RGB, or RGBA where photos do not cover everything."""
    crop, kind = picture.crop, COLOUR_TYPES[picture.channels]
    file.write(b"\x89PNG\r\n\x1a\n")
    _chunk(file, b"IHDR", struct.pack(">IIBBBBB", crop.width, crop.height, picture.depth, kind, 0, 0, 0))
    for name, data in png_chunks(own):
        _chunk(file, name, data)
    _chunk(file, b"IDAT", b"\x78\x01")  # deflate, window of 32 kB
    checksum = zlib.adler32(b"")
    for compressed, plain in picture.strips(_compressed):
        checksum = zlib.adler32(plain.data, checksum)
        _chunk(file, b"IDAT", compressed)
    _chunk(file, b"IDAT", zlib.compressobj(wbits=-15).flush() + struct.pack(">I", checksum))
    _chunk(file, b"IEND", b"")


def _compressed(rows: Samples, above: Samples) -> tuple[bytes, Pixels]:
    """Filtered rows as a piece of a deflate stream that ends at a whole byte, and uncompressed for the checksum."""
    plain = _filtered(_in_bytes(np.concatenate([above, rows])))
    deflate = zlib.compressobj(LEVEL, wbits=-15)
    return deflate.compress(plain.data) + deflate.flush(zlib.Z_SYNC_FLUSH), plain


def _in_bytes(rows: Samples) -> Pixels:
    """Pixels (h, w, channels) as bytes (h, w, bytes of a pixel), the high byte of 16 bits first."""
    return rows.astype(">u2").view(np.uint8) if rows.dtype == np.uint16 else np.asarray(rows, np.uint8)


def _filtered(rows: Pixels) -> Pixels:
    """Each row but the first less its left or its upper neighbour, whatever leaves less; the filter's number before."""
    own = rows[1:]
    left = own.copy()
    left[:, 1:] -= own[:, :-1]
    candidates = {SUB: left, UP: own - rows[:-1]}
    flat = {number: rest.reshape(len(own), -1) for number, rest in candidates.items()}
    left_over = {number: np.abs(rest.view(np.int8)).sum(1, dtype=np.int64) for number, rest in flat.items()}
    up = left_over[UP] < left_over[SUB]
    filtered = np.empty((len(own), flat[SUB].shape[1] + 1), np.uint8)
    filtered[:, 0] = np.where(up, UP, SUB)
    filtered[:, 1:] = np.where(up[:, None], flat[UP], flat[SUB])
    return filtered


def _chunk(file: IO[bytes], kind: bytes, data: bytes) -> None:
    file.write(struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)))
