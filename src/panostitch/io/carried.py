"""Which metadata of the photos the panorama takes over, by a rule: what all agree on, and never what nobody checked.

Maker notes, thumbnails, focal lengths, serial numbers and all other tags stay behind.
"""

import math
import re
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from PIL import ExifTags, Image

from panostitch.io.colour import conversions
from panostitch.io.metadata import read_exif
from panostitch.io.place import Position, place_tags, whereabouts
from panostitch.io.readers import FORMATS, READ_FAILURES
from panostitch.model.photo import Photo

Base, IFD = ExifTags.Base, ExifTags.IFD

MAIN = (Base.Make, Base.Model, Base.Artist, Base.Copyright)
LENS = (Base.LensMake, Base.LensModel)
LONGEST_TEXT = 500  # bytes; longer ones are no names
FAILURES = (*READ_FAILURES, ArithmeticError)


@dataclass(frozen=True)
class Own:
    """What one photo says of itself. Nonsense is left out.

    texts:    tags of MAIN and LENS
    offset:   of its clock from UTC, as +01:00
    heading:  degrees from true north, clockwise, in which it looks
    """

    texts: dict[int, bytes]
    offset: str = ""
    position: Position | None = None
    heading: float | None = None


@dataclass(frozen=True)
class Carried:
    """What the panorama takes over.

    profile:  ICC profile of the photos' pixels; empty where they have none
    headings: of each photo, degrees from true north; None where unknown
    notes:    what became of the photos' own profiles
    """

    exif: Image.Exif
    profile: bytes
    headings: tuple[float | None, ...]
    notes: tuple[str, ...]


def carried(photos: Sequence[Photo]) -> Carried:
    """The metadata for a panorama of these photos, which have one colour profile.

    Reads their headers; what is broken is left out, never an error.
    """
    owns = [_read(photo.path) for photo in photos]
    agreed: dict[int, bytes] = {
        tag: text for tag in (*MAIN, *LENS) if (text := _agreed(own.texts.get(tag) for own in owns))
    }
    exif = Image.Exif()
    exif.update({tag: text for tag, text in agreed.items() if tag in MAIN})
    exif.update({Base.Orientation: 1, Base.Software: software().encode()})
    # Pillow writes these as text only if they are strings, of ASCII, which is all that EXIF allows
    lens = {tag: text.decode() for tag, text in agreed.items() if tag in LENS and text.isascii()}
    exif.get_ifd(IFD.Exif).update({Base.ExifVersion: b"0232"} | lens | _date(photos, owns))
    if place := place_tags([own.position for own in owns]):
        exif.get_ifd(IFD.GPSInfo).update(place)
    profile = _agreed(photo.profile for photo in photos) or b""
    return Carried(exif, profile, tuple(own.heading for own in owns), conversions(photos))


def software() -> str:
    """The program and its version."""
    try:
        return f"panostitch {version('panostitch')}"
    except PackageNotFoundError:  # run from its sources, not installed
        return "panostitch"


def _agreed(values: Iterable[bytes | None]) -> bytes | None:
    """The value that all have in common."""
    several = set(values)
    return several.pop() if len(several) == 1 else None


def _date(photos: Sequence[Photo], owns: Sequence[Own]) -> dict[int, str]:
    """When the earliest photo was taken, by the camera's own clock."""
    dated = [(photo.taken, own.offset) for photo, own in zip(photos, owns, strict=True) if photo.taken is not None]
    if not dated:
        return {}
    taken, offset = min(dated)
    date = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=math.floor(taken))
    tags: dict[int, str] = {Base.DateTimeOriginal: f"{date:%Y:%m:%d %H:%M:%S}".rjust(19, "0")}
    return tags | {Base.OffsetTimeOriginal: offset} if offset else tags


def _read(path: str) -> Own:
    """What the header of a photo says."""
    if not path:
        return Own({})
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of Pillow, at tags that are damaged
            with Image.open(path, formats=FORMATS) as image:
                tags = read_exif(image)
                return Own(
                    {tag: found for tag in (*MAIN, *LENS) if (found := _text(_either(tags, tag)))},
                    _offset(_either(tags, Base.OffsetTimeOriginal)),
                    *whereabouts(tags.get_ifd(IFD.GPSInfo)),
                )
    except FAILURES:
        return Own({})


def _either(tags: Image.Exif, tag: int) -> Any:
    return tags[tag] if tag in tags else tags.get_ifd(IFD.Exif).get(tag)


def _text(value: Any) -> bytes:
    """The characters of a tag as they are in the file, UTF-8 as a rule; empty if they cannot be a name."""
    if not isinstance(value, str):
        return b""
    found = value.encode("latin-1", "replace").strip(b"\0 ")
    control = any(byte < 32 or byte == 127 for byte in found)
    return b"" if control or len(found) > LONGEST_TEXT else found


def _offset(value: Any) -> str:
    text = value if isinstance(value, str) else ""
    return text if re.fullmatch(r"[+-][01][0-9]:[0-5][0-9]", text) else ""
