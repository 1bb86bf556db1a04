"""EXIF as bytes: directories of tags as TIFF has them (TIFF 6.0, EXIF 2.32), for all formats, and put into a TIFF."""

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import IO

EXIF_POINTER, GPS_POINTER = 34665, 34853
BYTE, ASCII, SHORT, LONG, RATIONAL, UNDEFINED, LONG8 = 1, 2, 3, 4, 5, 7, 16  # types of values
FINE = 10**4  # denominator of fractions: a ten thousandth of a second of latitude is 3 mm


@dataclass(frozen=True)
class Field:
    """A tag, the type and the number of its values, and these, little-endian."""

    tag: int
    kind: int
    count: int
    data: bytes


@dataclass(frozen=True)
class Exif:
    """Fields of the picture, of its exposure and of its place."""

    main: tuple[Field, ...] = ()
    exposure: tuple[Field, ...] = ()
    place: tuple[Field, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.main or self.exposure or self.place)


def text(tag: int, value: bytes) -> Field:
    """Characters; the end that EXIF wants is added."""
    return Field(tag, ASCII, len(value) + 1, value + b"\0")


def short(tag: int, value: int) -> Field:
    """A number below 65536."""
    return Field(tag, SHORT, 1, struct.pack("<H", value))


def data(tag: int, value: bytes, *, kind: int = BYTE) -> Field:
    """Bytes as they are."""
    return Field(tag, kind, len(value), value)


def rationals(tag: int, values: Sequence[float]) -> Field:
    """Numbers that are not negative, to a ten thousandth."""
    pairs = [(round(value * FINE), FINE) for value in values]
    return Field(tag, RATIONAL, len(pairs), b"".join(struct.pack("<II", *pair) for pair in pairs))


def block(exif: Exif) -> bytes:
    """A whole EXIF block, as JPEG, PNG and WebP hold it (without the `Exif` that JPEG puts before it)."""
    return b"II*\0" + struct.pack("<I", 8) + _directories(exif, at=8, big=False)


def into_tiff(file: IO[bytes], exif: Exif, more: Iterable[Field] = ()) -> None:
    """Give the first picture of a finished little-endian TIFF these tags too, in a new directory at its end."""
    file.seek(0)
    header = file.read(16)
    big = header[2] == 43
    pointer = 8 if big else 4
    (old,) = struct.unpack_from("<Q" if big else "<I", header, pointer)
    kept, behind = _entries(file, old, big)
    at = file.seek(0, 2)
    at += file.write(bytes(-at % 8))
    file.write(_directories(Exif((*exif.main, *more), exif.exposure, exif.place), at, big, kept, behind))
    file.seek(pointer)
    file.write(struct.pack("<Q" if big else "<I", at))
    file.seek(0, 2)


def _directories(exif: Exif, at: int, big: bool, kept: Sequence[bytes] = (), behind: int = 0) -> bytes:
    """The main directory, to stand at `at` in the file, and those that it points to."""
    pointer = partial(Field, kind=LONG8 if big else LONG, count=1)
    parts = [(tag, part) for tag, part in ((EXIF_POINTER, exif.exposure), (GPS_POINTER, exif.place)) if part]
    unset = [pointer(tag, data=bytes(8 if big else 4)) for tag, _ in parts]
    place = at + len(_directory([*exif.main, *unset], at, big, kept))
    main, written = list(exif.main), b""
    for tag, fields in parts:
        main.append(pointer(tag, data=struct.pack("<Q" if big else "<I", place + len(written))))
        written += _directory(fields, place + len(written), big)
    return _directory(main, at, big, kept, behind) + written


def _directory(fields: Sequence[Field], at: int, big: bool, kept: Sequence[bytes] = (), behind: int = 0) -> bytes:
    """One directory that stands at `at` in the file, then the values that do not fit into it.

    kept:   entries of another one, as they are
    behind: where the next directory stands
    """
    count, entry, inline = ("<Q", "<HHQ", 8) if big else ("<H", "<HHI", 4)
    size = struct.calcsize(count) + (struct.calcsize(entry) + inline) * (len(fields) + len(kept)) + inline
    entries, values = list(kept), b""
    for field in fields:
        value = field.data
        if len(value) > inline:
            offset = at + size + len(values)
            values += value + bytes(-len(value) % 8)
            value = struct.pack("<Q" if big else "<I", offset)
        entries.append(struct.pack(entry, field.tag, field.kind, field.count) + value.ljust(inline, b"\0"))
    entries.sort(key=lambda entry: struct.unpack_from("<H", entry)[0])
    end = struct.pack("<Q" if big else "<I", behind)
    return struct.pack(count, len(entries)) + b"".join(entries) + end + values


def _entries(file: IO[bytes], at: int, big: bool) -> tuple[list[bytes], int]:
    """The entries of a directory as they are, and where the next one stands."""
    file.seek(at)
    (count,) = struct.unpack("<Q" if big else "<H", file.read(8 if big else 2))
    size = 20 if big else 12
    entries = [file.read(size) for _ in range(count)]
    (behind,) = struct.unpack("<Q" if big else "<I", file.read(8 if big else 4))
    return entries, behind
