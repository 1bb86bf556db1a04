"""All that can be said of a picture file."""

import math
import os
import stat
import warnings
import zlib
from dataclasses import dataclass, field, replace

from PIL import Image, UnidentifiedImageError

from panostitch.errors import InputError
from panostitch.io.inspection import png_strips, tiff_pages
from panostitch.io.inspection.border import Border
from panostitch.io.inspection.pieces import find_border
from panostitch.io.inspection.shot import Shot, read_shot, read_xmp
from panostitch.io.readers import FORMATS, READ_FAILURES
from panostitch.io.sphere import Sphere, read_sphere

CHANNELS = {"1": "grey", "L": "grey", "I;16": "grey", "LA": "grey and alpha", "P": "palette", "RGBA": "RGB and alpha"}
DEEP_MODES = ("I", "I;16", "I;16B", "I;16L")
# tifffile promises nothing about what it raises on damaged files
FAILURES = (*READ_FAILURES, ArithmeticError, AttributeError, zlib.error)


@dataclass(frozen=True)
class Picture:
    """A picture file.

    format:   TIFF and BigTIFF apart; else Pillow's name
    bytes:    of the file
    size:     (width, height) px as stored
    bits:     of a channel
    levels:   (width, height) px of the smaller copies in a TIFF
    storage:  how the pixels lie in the file, in words; empty where there is nothing to say
    field_of_view: degrees across and down, by what it says of the sphere or of its lens; None where it says nothing
    border:   what shows nothing; None where it was not looked for, and why in `note`
    """

    path: str
    format: str
    bytes: int
    size: tuple[int, int]
    bits: int
    channels: str
    alpha: bool
    shot: Shot = field(default_factory=Shot)
    sphere: Sphere | None = None
    field_of_view: tuple[float, float] | None = None
    levels: tuple[tuple[int, int], ...] = ()
    storage: str = ""
    border: Border | None = None
    note: str = ""

    @property
    def megapixels(self) -> float:
        """Size in millions of pixels."""
        return self.size[0] * self.size[1] / 1e6


def inspect_picture(path: str) -> Picture:
    """Look at a picture: first its header, then, in bounded memory, its pixels. Raises InputError."""
    _check_file(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of Pillow, at tags that are damaged
            picture = _header(path)
    except UnidentifiedImageError:
        raise InputError(f"{path}: not a picture", hint=f"known are {', '.join(FORMATS)}, and project files") from None
    except FAILURES as error:
        raise InputError(f"{path}: cannot be read: {str(error) or type(error).__name__}") from None
    try:
        kind = "TIFF" if picture.format == "BigTIFF" else picture.format
        border, note = find_border(path, kind, picture.size, alpha=picture.alpha)
    except FAILURES as error:
        said = f"{picture.format} of {picture.size[0]} x {picture.size[1]} px by its header"
        why = str(error) or type(error).__name__
        raise InputError(f"{path}: broken: {why}", details=(said,), hint="copy or make it anew") from None
    return replace(picture, border=border, note=note)


def _check_file(path: str) -> None:
    try:
        status = os.stat(path)
    except (OSError, ValueError) as error:
        missing = isinstance(error, FileNotFoundError)
        why = "no such file" if missing else f"cannot be read: {getattr(error, 'strerror', None) or error}"
        raise InputError(f"{path}: {why}") from None
    if stat.S_ISDIR(status.st_mode):
        raise InputError(f"{path}: is a folder", hint="name one file in it")
    if not stat.S_ISREG(status.st_mode):
        raise InputError(f"{path}: is no ordinary file")


def _header(path: str) -> Picture:
    size = os.path.getsize(path)
    if tiff_pages.is_tiff(path):
        layout = tiff_pages.read_layout(path)
        picture = Picture(path, layout.format, size, layout.size, layout.bits, layout.channels, layout.alpha)
        picture = replace(picture, levels=layout.levels, storage=layout.storage)
        try:
            return _with_metadata(picture, path)
        except UnidentifiedImageError:
            return picture  # of a kind that Pillow does not know: no metadata
    with Image.open(path, formats=FORMATS) as image:
        alpha = "A" in image.mode or "transparency" in image.info
        channels = CHANNELS.get(image.mode, image.mode)
        kind, bits = str(image.format), 16 if image.mode in DEEP_MODES else 8
        storage = "progressive" if image.info.get("progressive") else ""
        picture = Picture(path, kind, size, image.size, bits, channels, alpha, storage=storage)
    if kind == "PNG":
        header = png_strips.read_header(path)
        picture = replace(picture, bits=header.bits, storage="interlaced" if header.interlaced else "")
    return _with_metadata(picture, path)


def _with_metadata(picture: Picture, path: str) -> Picture:
    with Image.open(path, formats=FORMATS) as image:
        shot, sphere = read_shot(image), read_sphere(read_xmp(image), picture.size)
    seen = sphere.field if sphere else None
    if seen is None and shot.focal:
        across, down = (math.degrees(2 * math.atan(side / 2 / shot.focal)) for side in picture.size)
        seen = (across, down)
    return replace(picture, shot=shot, sphere=sphere, field_of_view=seen)
