"""Which metadata of the photos the panorama takes over, by a rule: what all agree on, and never what nobody checked.

Maker notes, thumbnails, focal lengths, serial numbers and all other tags stay behind.
"""

import math
import re
import struct
import warnings
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from PIL import ExifTags, Image

from panostitch.io import exif
from panostitch.io.exif import Exif, Field
from panostitch.io.metadata import read_exif
from panostitch.io.readers import FORMATS
from panostitch.model.photo import Photo

Base, GPS, IFD = ExifTags.Base, ExifTags.GPS, ExifTags.IFD

MAIN = (Base.Make, Base.Model, Base.Artist, Base.Copyright)
EXPOSURE = (Base.LensMake, Base.LensModel)
LONGEST_TEXT = 500  # bytes; longer ones are no names
LARGEST_PROFILE = 1 << 20  # bytes; profiles of RGB have 500 to 500,000
APART = 100.0  # metres: photos farther apart than this have no position in common
EARTH = 6_371_000.0  # metres, radius
FAILURES = (OSError, ValueError, SyntaxError, EOFError, KeyError, IndexError, TypeError, OverflowError, RuntimeError,
            ArithmeticError, MemoryError, struct.error)  # fmt: skip


@dataclass(frozen=True)
class Position:
    """Degrees north and east, metres above the sea if known."""

    latitude: float
    longitude: float
    altitude: float | None = None

    def metres_to(self, other: "Position") -> float:
        """Distance along the ground."""
        north = math.radians(self.latitude - other.latitude)
        east = math.radians((self.longitude - other.longitude + 180) % 360 - 180)
        return EARTH * math.hypot(north, east * math.cos(math.radians(self.latitude)))


@dataclass(frozen=True)
class Own:
    """What one photo says of itself. Nonsense is left out.

    texts:    tags of MAIN and EXPOSURE
    offset:   of its clock from UTC, as +01:00
    profile:  ICC profile of its RGB
    heading:  degrees from true north, clockwise, in which it looks
    """

    texts: dict[int, bytes]
    offset: bytes = b""
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

    exif: Exif
    profile: bytes
    headings: tuple[float | None, ...]
    notes: tuple[str, ...]


def carried(photos: Sequence[Photo]) -> Carried:
    """The metadata for a panorama of these photos. Reads their headers; what is broken is left out, never an error."""
    owns = [_read(photo.path) for photo in photos]
    profile, notes = _profile(photos, owns)
    main = [exif.text(tag, value) for tag in MAIN if (value := _agreed(own.texts.get(tag) for own in owns))]
    lens = [exif.text(tag, value) for tag in EXPOSURE if (value := _agreed(own.texts.get(tag) for own in owns))]
    whole = Exif(
        (*main, exif.short(Base.Orientation, 1), exif.text(Base.Software, software().encode())),
        (exif.data(Base.ExifVersion, b"0232", kind=exif.UNDEFINED), *lens, *_date(photos, owns)),
        _place([own.position for own in owns]),
    )
    return Carried(whole, profile, tuple(own.heading for own in owns), notes)


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


def _date(photos: Sequence[Photo], owns: Sequence[Own]) -> list[Field]:
    """When the earliest photo was taken, by the camera's own clock."""
    dated = [(photo.taken, own.offset) for photo, own in zip(photos, owns, strict=True) if photo.taken is not None]
    if not dated:
        return []
    taken, offset = min(dated)
    date = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=math.floor(taken))
    fields = [exif.text(Base.DateTimeOriginal, f"{date:%Y:%m:%d %H:%M:%S}".rjust(19, "0").encode())]
    return [*fields, exif.text(Base.OffsetTimeOriginal, offset)] if offset else fields


def _place(positions: Sequence[Position | None]) -> tuple[Field, ...]:
    """The position of the photo in the middle of those that have one; none where they were taken far apart."""
    known = [position for position in positions if position]
    if not known:
        return ()
    # in the middle is who has the shortest way to all others
    middle = min(known, key=lambda own: sum(own.metres_to(other) for other in known))
    if max(middle.metres_to(other) for other in known) > APART:
        return ()
    fields = [
        exif.data(GPS.GPSVersionID, bytes([2, 3, 0, 0])),
        exif.text(GPS.GPSLatitudeRef, b"N" if middle.latitude >= 0 else b"S"),
        exif.rationals(GPS.GPSLatitude, _arc(middle.latitude)),
        exif.text(GPS.GPSLongitudeRef, b"E" if middle.longitude >= 0 else b"W"),
        exif.rationals(GPS.GPSLongitude, _arc(middle.longitude)),
    ]
    if middle.altitude is not None:
        fields.append(exif.data(GPS.GPSAltitudeRef, bytes([middle.altitude < 0])))
        fields.append(exif.rationals(GPS.GPSAltitude, [abs(middle.altitude)]))
    return tuple(fields)


def _arc(degrees: float) -> tuple[float, float, float]:
    """Degrees, minutes, seconds of an angle without its sign."""
    ticks = round(abs(degrees) * 3600 * exif.FINE)
    minutes, rest = divmod(ticks, 60 * exif.FINE)
    return float(minutes // 60), float(minutes % 60), rest / exif.FINE


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
                    {tag: found for tag in (*MAIN, *EXPOSURE) if (found := _text(_either(tags, tag)))},
                    _offset(_either(tags, Base.OffsetTimeOriginal)),
                    _rgb_profile(image.info.get("icc_profile")),
                    *_whereabouts(tags.get_ifd(IFD.GPSInfo)),
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


def _offset(value: Any) -> bytes:
    text = _text(value)
    return text if re.fullmatch(rb"[+-][01]\d:[0-5]\d", text) else b""


def _rgb_profile(profile: Any) -> bytes:
    """A profile that may stand in an RGB picture: sound as far as its header tells, and of RGB."""
    if not isinstance(profile, bytes) or not 128 < len(profile) <= LARGEST_PROFILE:
        return b""
    sound = int.from_bytes(profile[:4]) == len(profile) and profile[36:40] == b"acsp"
    return profile if sound and profile[16:20] == b"RGB " else b""


def _whereabouts(tags: Any) -> tuple[Position | None, float | None]:
    """Where a photo was taken, and in which direction from true north."""
    latitude = _angle(tags.get(GPS.GPSLatitude), tags.get(GPS.GPSLatitudeRef), "NS", 90)
    longitude = _angle(tags.get(GPS.GPSLongitude), tags.get(GPS.GPSLongitudeRef), "EW", 180)
    altitude = _number(tags.get(GPS.GPSAltitude), 100_000)
    below = tags.get(GPS.GPSAltitudeRef) in (1, b"\1")
    position = None
    if latitude is not None and longitude is not None:
        position = Position(latitude, longitude, -altitude if altitude is not None and below else altitude)
    heading = _number(tags.get(GPS.GPSImgDirection), 360) if tags.get(GPS.GPSImgDirectionRef) == "T" else None
    return position, heading


def _angle(parts: Any, direction: Any, directions: str, most: float) -> float | None:
    """Degrees from degrees, minutes and seconds."""
    if not isinstance(parts, tuple) or len(parts) != 3 or direction not in tuple(directions):
        return None
    numbers = [_number(part, 360) for part in parts]
    if any(number is None for number in numbers):
        return None
    degrees = sum(number / 60**n for n, number in enumerate(numbers) if number is not None)
    return None if degrees > most else degrees if direction == directions[0] else -degrees


def _number(value: Any, most: float) -> float | None:
    try:
        number = float(value)
    except (TypeError, ValueError, ArithmeticError):
        return None
    return number if 0 <= number <= most else None
