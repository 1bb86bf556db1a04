"""Opening photos: headers at once, pixels when they are asked for.

Pillow reads headers and all formats but 16 bits (`deep`) and ordinary JPEG, which simplejpeg decodes in a third of the
time, and OpenCV where it is reduced. All refuse half a picture.
"""

import os
import struct
import warnings
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import simplejpeg
from PIL import (
    BmpImagePlugin,
    Image,
    Jpeg2KImagePlugin,
    JpegImagePlugin,
    PngImagePlugin,
    PpmImagePlugin,
    TiffImagePlugin,
    UnidentifiedImageError,
    WebPImagePlugin,
)

from panostitch.errors import InputError
from panostitch.io.colour import read_profiles, to_srgb
from panostitch.io.deep import COPY_ANEW, InEightBits, deep_file, unknown_tiff
from panostitch.io.foreign import check_name, known_but_unread
from panostitch.io.metadata import read_metadata
from panostitch.io.orientation import asked_for
from panostitch.model.photo import Photo, Pixels, PixelSource, grey_of, natural_key

# No EPS, PDF or other formats that run programs or hold no photo; importing a plug-in registers it with Pillow.
# MPO, JPEGs with a second picture as some phones write them, comes with JPEG.
PLUGINS = (
    JpegImagePlugin.JpegImageFile,
    PngImagePlugin.PngImageFile,
    TiffImagePlugin.TiffImageFile,
    WebPImagePlugin.WebPImageFile,
    BmpImagePlugin.BmpImageFile,
    Jpeg2KImagePlugin.Jpeg2KImageFile,
    PpmImagePlugin.PpmImageFile,
)
FORMATS = sorted({str(plugin.format) for plugin in PLUGINS})
EXTENSIONS = frozenset(
    [".jpg", ".jpeg", ".jpe", ".png", ".tif", ".tiff", ".webp", ".bmp", ".jp2", ".ppm", ".pgm", ".pnm"]
)
REDUCED_MODES = {8: cv2.IMREAD_REDUCED_COLOR_8, 4: cv2.IMREAD_REDUCED_COLOR_4, 2: cv2.IMREAD_REDUCED_COLOR_2}
MAX_MEGAPIXELS = 1000.0
# What Pillow and OpenCV raise on damaged files.
READ_FAILURES = (
    OSError,
    ValueError,
    SyntaxError,
    EOFError,
    KeyError,
    IndexError,
    TypeError,
    OverflowError,
    RuntimeError,
    MemoryError,
    struct.error,
    cv2.error,
)
Image.MAX_IMAGE_PIXELS = None  # we refuse too large pictures ourselves, by name and before decoding
PngImagePlugin.MAX_TEXT_CHUNK = 16 << 20  # bytes; large colour profiles are no reason to refuse a photo


@dataclass(frozen=True)
class FileSource:
    """Pixels of 8 bits of a photo in a file.

    orientation: the EXIF orientation that makes them upright
    jpeg_size:   stored (width, height) px of an ordinary JPEG; None for what Pillow is to decode
    device:      ICC profile of its grey or CMYK; empty for RGB, and where it has none
    """

    path: str
    orientation: int
    jpeg_size: tuple[int, int] | None
    device: bytes = field(default=b"", repr=False)

    def read(self, scale: float = 1.0) -> tuple[Pixels, Pixels | None]:
        """Upright RGB pixels (h, w, 3) at `scale` <= 1 and the mask (h, w) of alpha, if any. Raises InputError."""
        return self._read(scale, grey=False)

    def read_grey(self, scale: float = 1.0) -> tuple[Pixels, Pixels | None]:
        """As `read`, but grey pixels (h, w): JPEG stores brightness apart, and half of the decoding is colour."""
        return self._read(scale, grey=True)

    def _read(self, scale: float, *, grey: bool) -> tuple[Pixels, Pixels | None]:
        pixels, mask, size = self._decode(scale, grey=grey)
        asked = partial(asked_for, whole=size, scale=scale, orientation=self.orientation)
        return asked(pixels), None if mask is None else asked(mask)

    def _decode(self, scale: float, *, grey: bool) -> tuple[Pixels, Pixels | None, tuple[int, int]]:
        """Stored pixels, their mask, and the size of the whole picture; a JPEG comes reduced where `scale` allows."""
        try:
            if size := self.jpeg_size:
                return _decode_jpeg(self.path, size, _reduction(size, scale), grey=grey), None, size
            with Image.open(self.path, formats=FORMATS) as image:
                pixels, mask = _from_pillow(image, self.device)
                return grey_of(pixels) if grey else pixels, mask, image.size
        except InputError:
            raise
        except READ_FAILURES as error:
            raise InputError(f"{self.path}: broken: {str(error) or type(error).__name__}", hint=COPY_ANEW) from None


def open_photos(paths: Sequence[str | os.PathLike[str]]) -> tuple[list[Photo], list[InputError]]:
    """Photos in the natural order of their names, and what cannot be opened. A file given twice is opened once."""
    photos: dict[str, Photo] = {}
    failures = []
    for path in paths:
        try:
            real = os.path.realpath(path)
            if real not in photos:
                photos[real] = open_photo(path)
        except InputError as error:
            failures.append(error)
    return _named_apart(sorted(photos.values(), key=lambda photo: natural_key(photo.path))), failures


def open_photo(path: str | os.PathLike[str]) -> Photo:
    """A photo by its header alone. Raises InputError where there is no readable picture."""
    name = os.fspath(path)
    if not os.path.exists(name):
        raise InputError(f"{name}: no such file")
    if os.path.isdir(name):
        raise InputError(f"{name}: is a folder", hint="to stitch every sub-folder of a folder, use `panostitch batch`")
    check_name(name)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of Pillow, at tags that are damaged, and ignored
            with Image.open(name, formats=FORMATS) as image:
                metadata = read_metadata(image)
                deep = deep_file(image, name, metadata.orientation)
                profiles = read_profiles(image, deep=deep is not None)
                jpeg = image.format in ("JPEG", "MPO") and image.mode in ("RGB", "L") and not profiles.device
                shallow = FileSource(name, metadata.orientation, image.size if jpeg else None, profiles.device)
    except InputError:
        raise
    except UnidentifiedImageError:
        unknown = InputError(f"{name}: not a picture", hint=f"known are {', '.join(FORMATS)}")
        raise known_but_unread(name) or unknown_tiff(name) or unknown from None
    except READ_FAILURES as error:
        raise InputError(f"{name}: cannot be read: {str(error) or type(error).__name__}") from None
    megapixels = metadata.size[0] * metadata.size[1] / 1e6
    if megapixels > MAX_MEGAPIXELS:
        raise InputError(f"{name}: claims {megapixels:.0f} megapixels; {MAX_MEGAPIXELS:.0f} is the most")
    source: PixelSource = InEightBits(deep) if deep else shallow
    return Photo(
        os.path.basename(name),
        metadata.size,
        source,
        name,
        metadata.focal,
        metadata.lens,
        (*metadata.notes, *profiles.notes),
        metadata.taken,
        deep,
        profiles.rgb,
    )


def photos_in(folder: str) -> list[str]:
    """Paths of the photos in a folder, known by their extensions; hidden files are none."""
    return sorted(
        entry.path
        for entry in os.scandir(folder)
        if entry.is_file() and not entry.name.startswith(".") and Path(entry.name).suffix.lower() in EXTENSIONS
    )


def _named_apart(photos: list[Photo]) -> list[Photo]:
    """Photos of one name in different folders are called by their paths."""
    count = Counter(photo.name for photo in photos)
    return [replace(photo, name=photo.path) if count[photo.name] > 1 else photo for photo in photos]


def _reduction(size: tuple[int, int], scale: float) -> int:
    """By how much the JPEG decoder may reduce, which is quicker; only where it divides the size, to stay exact."""
    return next((n for n in REDUCED_MODES if n * scale <= 1 and size[0] % n == size[1] % n == 0), 1)


def _decode_jpeg(path: str, size: tuple[int, int], reduction: int, *, grey: bool) -> Pixels:
    """RGB pixels (h, w, 3), or grey ones (h, w), of a JPEG of this size, reduced."""
    data = np.fromfile(path, np.uint8)
    if reduction == 1:
        # into memory of NumPy's, which comes in large pages: half of the time would go for asking for small ones
        pixels = np.empty((size[1], size[0], 1 if grey else 3), np.uint8)
        # what is damaged but can be shown is left to OpenCV, which is less strict
        with suppress(ValueError):
            decoded = simplejpeg.decode_jpeg(data, "GRAY" if grey else "RGB", buffer=pixels)
            return np.asarray(decoded[..., 0] if grey else decoded, np.uint8)
    reduced, colours = REDUCED_MODES.get(reduction, 0), cv2.IMREAD_GRAYSCALE if grey else cv2.IMREAD_COLOR_RGB
    decoded = cv2.imdecode(data, reduced & ~cv2.IMREAD_COLOR | colours | cv2.IMREAD_IGNORE_ORIENTATION)
    if decoded is None:
        raise InputError(f"{path}: broken: the file ends before the picture does", hint=COPY_ANEW)
    return np.asarray(decoded, np.uint8)


def _from_pillow(image: Image.Image, device: bytes) -> tuple[Pixels, Pixels | None]:
    """RGB and alpha of any mode of Pillow's; 16-bit grey, which JPEG 2000 and PNM may have, comes in 8 bits.

    Grey and CMYK become sRGB by their own profile, if they have one.
    """
    if image.mode.startswith("I"):
        grey = (np.asarray(image, np.float64) / 257).clip(0, 255).round().astype(np.uint8)
        return np.repeat(grey[..., None], 3, axis=2), None
    shown = to_srgb(image, device) if device else image
    if "A" in image.mode or "transparency" in image.info:
        rgba = np.asarray(image.convert("RGBA"), np.uint8)
        colours = np.asarray(shown, np.uint8) if device else rgba[..., :3]
        return np.ascontiguousarray(colours), np.ascontiguousarray(rgba[..., 3])
    return np.array(shown.convert("RGB"), np.uint8), None
