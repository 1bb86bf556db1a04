"""Where photos were taken: read from their EXIF, and written for the panorama."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from PIL import ExifTags
from PIL.TiffImagePlugin import IFDRational

GPS = ExifTags.GPS

APART = 100.0  # metres: photos farther apart than this have no position in common
EARTH = 6_371_000.0  # metres, radius
FINE = 10**4  # denominator of fractions: a ten thousandth of a second of latitude is 3 mm


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


def whereabouts(tags: Any) -> tuple[Position | None, float | None]:
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


def place_tags(positions: Sequence[Position | None]) -> dict[int, Any]:
    """The position of the photo in the middle of those that have one; none where they were taken far apart."""
    known = [position for position in positions if position]
    if not known:
        return {}
    # in the middle is who has the shortest way to all others
    middle = min(known, key=lambda own: sum(own.metres_to(other) for other in known))
    if max(middle.metres_to(other) for other in known) > APART:
        return {}
    tags: dict[int, Any] = {
        GPS.GPSVersionID: bytes([2, 3, 0, 0]),
        GPS.GPSLatitudeRef: "N" if middle.latitude >= 0 else "S",
        GPS.GPSLatitude: _arc(middle.latitude),
        GPS.GPSLongitudeRef: "E" if middle.longitude >= 0 else "W",
        GPS.GPSLongitude: _arc(middle.longitude),
    }
    if middle.altitude is not None:
        tags[GPS.GPSAltitudeRef] = bytes([middle.altitude < 0])
        tags[GPS.GPSAltitude] = IFDRational(round(abs(middle.altitude) * FINE), FINE)
    return tags


def _arc(degrees: float) -> tuple[IFDRational, IFDRational, IFDRational]:
    """Degrees, minutes, seconds of an angle without its sign."""
    minutes, ticks = divmod(round(abs(degrees) * 3600 * FINE), 60 * FINE)
    return IFDRational(minutes // 60), IFDRational(minutes % 60), IFDRational(ticks, FINE)
