"""Writing panoramas: tile by tile, to a file that takes its place when it is whole.

TIFF, PNG and JPEG are written as their tiles come. WebP is made of the whole picture, which its encoder wants.
"""

import io
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import cv2
import numpy as np
from PIL import Image

from panostitch.errors import OutputError
from panostitch.io.atomic import replacing, write_bytes
from panostitch.io.carried import carried, software
from panostitch.io.embed import Embedded
from panostitch.io.encode import encoded
from panostitch.io.jpeg import write_jpeg
from panostitch.io.limits import JPEG, TIFF, arranged, channels_in, check_depth, check_sides, depth_for
from panostitch.io.partial import FinishedTiles
from panostitch.io.png import LEVEL, write_png
from panostitch.io.rendering import Pixels, Preview, Rendering, read_tile, tiles_of
from panostitch.io.sphere import sphere_xmp
from panostitch.io.tiff import write_tiff
from panostitch.model.panorama import Panorama
from panostitch.options import OutputOptions
from panostitch.runtime.executor import Executor, serial
from panostitch.runtime.trace import Trace, silent

__all__ = [
    "Written",
    "assemble",
    "check_depth",
    "check_output",
    "encode_panorama",
    "write_bytes",
    "write_panorama",
    "write_picture",
]

EXTENSIONS = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".webp")
NOTHING_ELSE = Embedded()


@dataclass(frozen=True)
class Written:
    """What became of a panorama: bits of a channel, and what its user should know."""

    depth: int
    notes: tuple[str, ...] = ()


def check_output(path: str, *, overwrite: bool, inputs: Sequence[str] = (), extensions: Sequence[str] = ()) -> None:
    """Raise OutputError where a file cannot or must not be written; before any work is done."""
    target, allowed = Path(path), extensions or EXTENSIONS
    if not any(target.name.lower().endswith(end) and len(target.name) > len(end) for end in allowed):
        raise OutputError(f"{path}: the name must end in {', '.join(allowed)}")
    try:
        os.lstat(target.parent / (target.name + "~"))
    except FileNotFoundError:
        pass
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}") from None
    if target.is_dir():
        raise OutputError(f"{path}: is a folder")
    if not target.parent.is_dir():
        raise OutputError(f"{path}: there is no folder {target.parent}", hint=f"make it: mkdir -p {target.parent}")
    if any(os.path.exists(p) and target.exists() and os.path.samefile(p, target) for p in inputs):
        raise OutputError(f"{path}: is one of the photos", hint="choose another name; photos are never touched")
    if target.exists() and not overwrite:
        raise OutputError(f"{path}: exists already", hint="choose another name, or add --overwrite")
    if not os.access(target.parent, os.W_OK):
        raise OutputError(f"{path}: the folder {target.parent} cannot be written to")


def write_panorama(
    panorama: Panorama,
    path: str,
    options: OutputOptions,
    *,
    run: Executor = serial,
    trace: Trace = silent,
    finished: FinishedTiles | None = None,
) -> Written:
    """Render the cropped panorama and write it; tiles that are `finished` already are not made again.

    Raises OutputError; UsageError where the format has no such depth; LimitError for a JPEG or WebP of impossible size,
    or where memory does not suffice.
    """
    crop = panorama.plan.crop
    check_depth(path, options.depth)
    check_sides(path, crop)
    depth, notes = depth_for(panorama, path, options.depth)
    preview = None if trace is silent else Preview(crop)
    picture = arranged(Rendering(panorama, run, channels_in(panorama, path), depth, preview, finished), path, options)
    own, more = _metadata(panorama, options.metadata)
    with replacing(path) as file:
        encode_panorama(file, path, picture, options, own)
    if preview:
        trace("panorama.written", path=path, size=(crop.width, crop.height), preview=preview.pixels)
    return Written(depth, (*notes, *more))


def _metadata(panorama: Panorama, asked: str) -> tuple[Embedded, tuple[str, ...]]:
    """What the file is to say besides its pixels, and what is to be said of that."""
    if panorama.alignment is None:
        return Embedded(), ()
    found = carried(panorama.alignment.photos)
    if asked == "none":
        return Embedded(profile=found.profile), found.notes
    xmp = sphere_xmp(panorama, found.headings, software())
    return Embedded(found.exif, found.profile, xmp), found.notes


def encode_panorama(
    file: IO[bytes], path: str, picture: Rendering, options: OutputOptions, own: Embedded = NOTHING_ELSE
) -> None:
    """Write a picture into a file, in the format of the path, with its own metadata. Raises OutputError."""
    extension = Path(path).suffix.lower()
    if extension in TIFF:
        write_tiff(file, path, picture, options, own)
    elif extension == ".png":
        write_png(file, picture, own)
    elif extension in JPEG:
        write_jpeg(file, path, picture, options.quality, own)
    else:
        file.write(_webp(path, picture.whole(), options.quality, own))


def assemble(panorama: Panorama, *, run: Executor = serial) -> tuple[Pixels, Pixels]:
    """The cropped panorama as RGB (h, w, 3) and its coverage (h, w), 0 or 255."""
    crop = panorama.plan.crop
    pixels = np.zeros((crop.height, crop.width, 3), np.uint8)
    mask = np.zeros((crop.height, crop.width), np.uint8)
    tiles = tiles_of(crop)
    parts = run.map(lambda tile: read_tile(panorama, tile), tiles, label="Rendering")
    for tile, (part, covered) in zip(tiles, parts, strict=True):
        place = tile.within(crop)
        pixels[place], mask[place] = part, covered
    return pixels, mask


def write_picture(path: str, pixels: Pixels, mask: Pixels | None = None, *, quality: int = 92) -> None:
    """Write RGB pixels (h, w, 3); a mask that is not full becomes alpha where the format has it. Raises OutputError."""
    alpha = mask is not None and Path(path).suffix.lower() not in JPEG and not mask.all()
    picture = np.dstack([pixels, mask]) if alpha and mask is not None else pixels.copy()
    write_bytes(path, _encoded(path, picture, quality))


def _encoded(path: str, picture: Pixels, quality: int) -> memoryview:
    """RGB or RGBA (h, w, channels), which may be overwritten, in the format of the path. Raises OutputError."""
    extension = Path(path).suffix.lower()
    if extension == ".webp":
        return _webp(path, picture, quality, NOTHING_ELSE)
    file = io.BytesIO()  # given a file itself, Pillow would not notice that the disk takes only a part
    image = Image.fromarray(picture)
    try:
        if extension in JPEG:
            image.save(file, "JPEG", quality=quality)
        elif extension == ".png":
            image.save(file, "PNG", compress_level=LEVEL)
        else:
            image.save(file, "TIFF", compression="tiff_lzw")
    except OSError:
        raise OutputError(f"{path}: could not be encoded") from None
    return file.getbuffer()


def _webp(path: str, picture: Pixels, quality: int, own: Embedded) -> memoryview:
    """By OpenCV, which takes a quarter to a third less memory for it than Pillow; the picture may be overwritten."""
    cv2.cvtColor(picture, cv2.COLOR_RGB2BGR if picture.shape[2] == 3 else cv2.COLOR_RGBA2BGRA, dst=picture)
    said = {
        cv2.IMAGE_METADATA_EXIF: own.block,
        cv2.IMAGE_METADATA_ICCP: own.profile,
        cv2.IMAGE_METADATA_XMP: own.xmp,
    }
    return encoded(path, ".webp", picture, [cv2.IMWRITE_WEBP_QUALITY, quality], said).data
