"""Metadata into files of each format."""

import struct
import zlib
from dataclasses import dataclass, field
from typing import IO

from panostitch.io import exif
from panostitch.io.exif import Exif

XMP_TAG, PROFILE_TAG = 700, 34675  # of TIFF
SEGMENT = 65_533  # bytes that a segment of a JPEG holds
PROFILE_PART = SEGMENT - 14


@dataclass(frozen=True)
class Embedded:
    """What a file says besides its pixels: EXIF, an ICC profile, an XMP packet; empty where there is none."""

    exif: Exif = field(default_factory=Exif)
    profile: bytes = b""
    xmp: bytes = b""


def into_jpeg(jpeg: bytes, own: Embedded) -> list[bytes]:
    """The pieces of a JPEG with metadata, which follow its JFIF header."""
    segments = []
    if own.exif:
        segments.append((0xE1, b"Exif\0\0" + exif.block(own.exif)))
    if own.xmp:
        segments.append((0xE1, b"http://ns.adobe.com/xap/1.0/\0" + own.xmp))
    parts = [own.profile[n : n + PROFILE_PART] for n in range(0, len(own.profile), PROFILE_PART)]
    for number, part in enumerate(parts, 1):
        segments.append((0xE2, b"ICC_PROFILE\0" + bytes([number, len(parts)]) + part))
    first = 2 + (2 + int.from_bytes(jpeg[4:6]) if jpeg[2:4] == b"\xff\xe0" else 0)
    written = [struct.pack(">BBH", 0xFF, marker, len(data) + 2) + data for marker, data in segments]
    return [jpeg[:first], *written, jpeg[first:]]


def into_webp(webp: bytes, own: Embedded, size: tuple[int, int], *, alpha: bool) -> list[bytes]:
    """The pieces of a WebP of (width, height) px with metadata, which needs the extended form of the file."""
    found = _riff_chunks(webp)
    behind = [(b"EXIF", exif.block(own.exif) if own.exif else b""), (b"XMP ", own.xmp)]
    chunks = [(b"ICCP", own.profile), *((name, data) for name, data in found if name != b"VP8X"), *behind]
    flags = 0x20 * bool(own.profile) + 0x10 * alpha + 0x08 * bool(own.exif) + 0x04 * bool(own.xmp)
    width, height = ((n - 1).to_bytes(3, "little") for n in size)
    extended = [(b"VP8X", bytes([flags, 0, 0, 0]) + width + height), *((n, data) for n, data in chunks if data)]
    written = [name + struct.pack("<I", len(data)) + data + bytes(len(data) % 2) for name, data in extended]
    return [b"RIFF" + struct.pack("<I", 4 + sum(map(len, written))) + b"WEBP", *written]


def png_chunks(own: Embedded) -> list[tuple[bytes, bytes]]:
    """Name and content of the chunks between a PNG's header and its pixels."""
    chunks = [
        (b"iCCP", b"ICC profile\0\0" + zlib.compress(own.profile) if own.profile else b""),
        (b"eXIf", exif.block(own.exif) if own.exif else b""),
        (b"iTXt", b"XML:com.adobe.xmp\0\0\0\0\0" + own.xmp if own.xmp else b""),
    ]
    return [(name, data) for name, data in chunks if data]


def into_tiff(file: IO[bytes], own: Embedded) -> None:
    """Metadata into a finished TIFF."""
    more = []
    if own.xmp:
        more.append(exif.data(XMP_TAG, own.xmp))
    if own.profile:
        more.append(exif.data(PROFILE_TAG, own.profile, kind=exif.UNDEFINED))
    if own.exif or more:
        exif.into_tiff(file, own.exif, more)


def _riff_chunks(webp: bytes) -> list[tuple[bytes, bytes]]:
    chunks, at = [], 12
    while at + 8 <= len(webp):
        (size,) = struct.unpack_from("<I", webp, at + 4)
        chunks.append((webp[at : at + 4], webp[at + 8 : at + 8 + size]))
        at += 8 + size + size % 2
    return chunks
