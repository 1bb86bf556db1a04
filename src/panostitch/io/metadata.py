"""What the header of a photo says: size, orientation, lens."""

import math
import struct
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from PIL import ExifTags
from PIL.Image import Exif, Image

from panostitch.io.orientation import TRANSPOSED

FULL_FRAME_DIAGONAL = 43.27  # mm of 24 x 36 mm film, to which 35 mm equivalents refer
MM_PER_UNIT = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}  # FocalPlaneResolutionUnit: inch, cm, mm, um


@dataclass(frozen=True)
class Metadata:
    """The header of a photo.

    size:        (width, height) px, upright
    orientation: EXIF orientation 1 to 8 that is to be applied to the stored pixels
    focal:       focal length px, None if unknown
    lens:        camera, lens and focal length in words, empty if unknown
    notes:       what was surprising
    taken:       seconds from 1970 to the exposure by the camera's own clock, None if unknown
    """

    size: tuple[int, int]
    orientation: int
    focal: float | None
    lens: str
    notes: tuple[str, ...]
    taken: float | None = None


def read_metadata(image: Image) -> Metadata:
    """Metadata of an opened, not yet decoded picture. Nonsense in them is ignored."""
    exif = read_exif(image)
    tags: dict[int, Any] = {**exif, **exif.get_ifd(ExifTags.IFD.Exif)}
    # Pillow turns a TIFF upright by itself
    tag = None if image.format == "TIFF" else tags.get(ExifTags.Base.Orientation)
    orientation, notes = _orientation(tag, image.size)
    width, height = image.size
    size = (height, width) if orientation in TRANSPOSED else (width, height)
    length = positive(tags.get(ExifTags.Base.FocalLength))
    words = (words_of(tags.get(tag)) for tag in (ExifTags.Base.Make, ExifTags.Base.Model, ExifTags.Base.LensModel))
    lens = " ".join([*words, f"{length:g} mm" if length else ""]).strip()
    return Metadata(size, orientation, _focal(tags, length, image.size), lens, notes, _taken(tags))


def read_exif(image: Image) -> Exif:
    """EXIF tags from the header alone: `getexif` decodes a whole PNG to find tags behind the picture."""
    if image.format == "TIFF":
        return image.getexif()
    exif = Exif()
    try:
        exif.load(image.info.get("exif", b""))
    except (SyntaxError, ValueError, OSError, struct.error):
        return Exif()  # damaged beyond use
    return exif


def _orientation(value: Any, size: tuple[int, int]) -> tuple[int, tuple[str, ...]]:
    """The orientation to apply. Sensors lie on their long side: a tag that lays an upright picture down is stale."""
    if value not in range(1, 9):
        return 1, ()
    if value in TRANSPOSED and size[1] > size[0]:
        return 1, (f"its EXIF orientation ({value}) is stale: the pixels have been turned already",)
    return int(value), ()


def _focal(tags: dict[int, Any], length: float | None, size: tuple[int, int]) -> float | None:
    """Focal length px, from the 35 mm equivalent or from the resolution of the sensor."""
    equivalent = positive(tags.get(ExifTags.Base.FocalLengthIn35mmFilm))
    if equivalent:
        return equivalent * math.hypot(*size) / FULL_FRAME_DIAGONAL
    resolution = positive(tags.get(ExifTags.Base.FocalPlaneXResolution))
    original = positive(tags.get(ExifTags.Base.ExifImageWidth))
    unit = MM_PER_UNIT.get(tags.get(ExifTags.Base.FocalPlaneResolutionUnit, 2))
    if not (length and resolution and original and unit):
        return None
    sensor_width = original / resolution * unit
    # a picture that was scaled down without its tags being rewritten claims a tiny sensor
    return length / sensor_width * max(size) if sensor_width > 3 else None


def _taken(tags: dict[int, Any]) -> float | None:
    """Time of the exposure, to the fraction of a second if the camera notes it: bursts share a second."""
    words = tags.get(ExifTags.Base.DateTimeOriginal)
    try:
        # as if the camera's clock were UTC: only differences count
        whole = datetime.strptime(words_of(words), "%Y:%m:%d %H:%M:%S").replace(tzinfo=UTC).timestamp()
    except ValueError:
        return None
    fraction = words_of(tags.get(ExifTags.Base.SubsecTimeOriginal))
    return whole + (float(f"0.{fraction}") if fraction.isascii() and fraction.isdigit() else 0.0)


def positive(value: Any) -> float | None:
    """A number above 0; None for anything else."""
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if math.isfinite(number) and number > 0 else None


def words_of(value: Any) -> str:
    """Printable text of a tag, empty where it is none; metadata may hold anything."""
    return "".join(c for c in value if c.isprintable()).strip()[:80] if isinstance(value, str) else ""
