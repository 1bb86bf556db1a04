"""How a picture was taken and made, as its metadata say."""

import io
import warnings
from dataclasses import dataclass
from typing import Any

from PIL import ExifTags, ImageCms
from PIL.Image import Image

from panostitch.io.metadata import positive, read_exif, read_metadata, words_of
from panostitch.io.place import Position, whereabouts

Base = ExifTags.Base
XMP = ("xmp", "XML:com.adobe.xmp")  # where Pillow keeps it, by format
XMP_TAG = 700  # of TIFF


@dataclass(frozen=True)
class Shot:
    """What metadata say; empty or None where they do not.

    lens:     camera, lens and focal length
    focal:    focal length px
    exposure: time, aperture, sensitivity
    taken:    date and time by the camera's own clock, as EXIF writes it
    profile:  name of the colour profile
    orientation: EXIF's, 1 to 8, by which the stored pixels have to be turned
    """

    lens: str = ""
    focal: float | None = None
    exposure: str = ""
    taken: str = ""
    software: str = ""
    profile: str = ""
    position: Position | None = None
    orientation: int = 1


def read_shot(image: Image) -> Shot:
    """The metadata of an opened, not yet decoded picture. Nonsense in them is left out."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of Pillow, at tags that are damaged
        metadata, exif = read_metadata(image), read_exif(image)
        inner = exif.get_ifd(ExifTags.IFD.Exif)
        return Shot(
            metadata.lens,
            metadata.focal,
            _exposure(inner),
            words_of(inner.get(Base.DateTimeOriginal) or exif.get(Base.DateTime)),
            words_of(exif.get(Base.Software)),
            _profile_name(image.info.get("icc_profile")),
            whereabouts(exif.get_ifd(ExifTags.IFD.GPSInfo))[0],
            metadata.orientation,
        )


def read_xmp(image: Image) -> bytes:
    """The XMP packet; empty where there is none."""
    tags: Any = getattr(image, "tag_v2", {})
    found = next((image.info[name] for name in XMP if name in image.info), tags.get(XMP_TAG, b""))
    return found.encode() if isinstance(found, str) else found if isinstance(found, bytes) else b""


def _exposure(tags: Any) -> str:
    time, aperture = (positive(tags.get(tag)) for tag in (Base.ExposureTime, Base.FNumber))
    speed = tags.get(Base.ISOSpeedRatings)
    sensitivity = positive(speed[0] if isinstance(speed, tuple) and speed else speed)
    words = []
    if time:
        words.append(f"1/{1 / time:.0f} s" if time < 0.3 else f"{time:g} s")
    if aperture:
        words.append(f"f/{aperture:g}")
    if sensitivity:
        words.append(f"ISO {sensitivity:g}")
    return ", ".join(words)


def _profile_name(profile: Any) -> str:
    """The description in an ICC profile, or that it has none that can be read."""
    if not profile:
        return ""
    try:
        return words_of(ImageCms.getProfileDescription(ImageCms.ImageCmsProfile(io.BytesIO(profile)))) or "nameless"
    except (ImageCms.PyCMSError, OSError, TypeError, ValueError):
        return "damaged"
