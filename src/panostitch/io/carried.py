"""Which metadata of the photos the panorama takes over, by a rule: what all agree on, and never what nobody checked.

Maker notes, thumbnails, focal lengths, serial numbers and all other tags stay behind.
"""

import math
import re
import warnings
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from PIL import ExifTags, Image

from panostitch.io.metadata import read_exif
from panostitch.io.place import Position, place_tags, whereabouts
from panostitch.io.readers import FORMATS, READ_FAILURES
from panostitch.model.photo import Photo

Base, IFD = ExifTags.Base, ExifTags.IFD

MAIN = (Base.Make, Base.Model, Base.Artist, Base.Copyright)
LENS = (Base.LensMake, Base.LensModel)
LONGEST_TEXT = 500  # bytes; longer ones are no names
LARGEST_PROFILE = 1 << 20  # bytes; profiles of RGB have 500 to 500,000
FAILURES = (*READ_FAILURES, ArithmeticError)


@dataclass(frozen=True)
class Own:
    """What one photo says of itself. Nonsense is left out.

    texts:    tags of MAIN and LENS
    offset:   of its clock from UTC, as +01:00
    profile:  ICC profile of its RGB
    heading:  degrees from true north, clockwise, in which it looks
    """

    texts: dict[int, bytes]
    offset: str = ""
    profile: bytes = b""
    position: Position | None = None
    heading: float | None = None


@dataclass(frozen=True)
class Carried:
    """What the panorama takes over.

    profile:  ICC profile; empty where photos have none
    headings: of each photo, degrees from true north; None where unknown
    notes:    what could not be taken over as it was
    """

    exif: Image.Exif
    profile: bytes
    headings: tuple[float | None, ...]
    notes: tuple[str, ...]


def carried(photos: Sequence[Photo]) -> Carried:
    """The metadata for a panorama of these photos. Reads their headers; what is broken is left out, never an error."""
    owns = [_read(photo.path) for photo in photos]
    profile, notes = _profile(photos, owns)
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
    return Carried(exif, profile, tuple(own.heading for own in owns), notes)


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


def _profile(photos: Sequence[Photo], owns: Sequence[Own]) -> tuple[bytes, tuple[str, ...]]:
    """The colour profile that most photos have, the first ones if there are as many of another; and who differs."""
    count = Counter(own.profile for own in owns)
    if not count:
        return b"", ()
    chosen = count.most_common(1)[0][0]
    others = [photo.name for photo, own in zip(photos, owns, strict=True) if own.profile != chosen]
    if not others:
        return chosen, ()
    kept = "the colour profile of most photos is kept" if chosen else "like most photos it has no colour profile"
    named = ", ".join(others[:3]) + (f" and {len(others) - 3} more" if len(others) > 3 else "")
    return chosen, (f"{kept}; colours of {named}, which differ in theirs, are not converted",)


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
                    _rgb_profile(image.info.get("icc_profile")),
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


def _rgb_profile(profile: Any) -> bytes:
    """A profile that may stand in an RGB picture: sound as far as its header tells, and of RGB."""
    if not isinstance(profile, bytes) or not 128 < len(profile) <= LARGEST_PROFILE:
        return b""
    sound = int.from_bytes(profile[:4]) == len(profile) and profile[36:40] == b"acsp"
    return profile if sound and profile[16:20] == b"RGB " else b""
