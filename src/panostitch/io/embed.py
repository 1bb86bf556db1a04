"""Metadata into files of each format, as far as no library does it."""

import zlib
from dataclasses import dataclass, field
from typing import IO, Any

from PIL.ExifTags import IFD
from PIL.Image import Exif
from PIL.TiffImagePlugin import ImageFileDirectory_v2
from tifffile import DATATYPE

XMP_TAG, PROFILE_TAG = 700, 34675  # of TIFF
DIRECTORIES = {"ExifTag": IFD.Exif, "GPSTag": IFD.GPSInfo}  # as tifffile and Pillow call them
TiffTag = tuple[int | str, int, int, Any, bool]  # as tifffile takes them


@dataclass(frozen=True)
class Embedded:
    """What a file says besides its pixels: EXIF, an ICC profile, an XMP packet; empty where there is none."""

    exif: Exif = field(default_factory=Exif)
    profile: bytes = b""
    xmp: bytes = b""

    @property
    def block(self) -> bytes:
        """EXIF as PNG and WebP hold it, without the `Exif` that a JPEG has before it; empty where there is none."""
        return self.exif.tobytes().removeprefix(b"Exif\0\0") if self.exif else b""


def png_chunks(own: Embedded) -> list[tuple[bytes, bytes]]:
    """Name and content of the chunks between a PNG's header and its pixels."""
    chunks = [
        (b"iCCP", b"ICC profile\0\0" + zlib.compress(own.profile) if own.profile else b""),
        (b"eXIf", own.block),
        (b"iTXt", b"XML:com.adobe.xmp\0\0\0\0\0" + own.xmp if own.xmp else b""),
    ]
    return [(name, data) for name, data in chunks if data]


def tiff_tags(file: IO[bytes], own: Embedded) -> list[TiffTag]:
    """The tags of a TIFF of which there is the header alone.

    tifffile writes no directories of EXIF. Those that Pillow makes are put behind the header, so that their places are
    known before the tags that point to them are written.
    """
    tags: list[TiffTag] = [
        (tag, DATATYPE.ASCII, 0, value, True) if isinstance(value, bytes) else (tag, DATATYPE.SHORT, 1, value, True)
        for tag, value in own.exif.items()
    ]
    packed = ((XMP_TAG, DATATYPE.BYTE, own.xmp), (PROFILE_TAG, DATATYPE.UNDEFINED, own.profile))
    tags += [(tag, kind, len(data), data, True) for tag, kind, data in packed if data]
    length = file.tell()
    file.seek(0)
    header = file.read(length)
    for name, group in DIRECTORIES.items():
        if fields := own.exif.get_ifd(group):
            directory, place = ImageFileDirectory_v2(header, group=group), file.tell()
            directory.update(fields)
            file.write(directory.tobytes(place))
            tags.append((name, DATATYPE.LONG, 1, place, True))  # 32 bits suffice for the beginning of a file
    return tags
