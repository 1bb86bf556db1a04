"""Writing panoramas: tile by tile, to a file that takes its place when it is whole.

TIFF and PNG are written as their tiles come. JPEG and WebP are made of the whole picture, which their encoders want.
"""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from panostitch.errors import LimitError, OutputError
from panostitch.io.atomic import replacing, write_bytes
from panostitch.io.png import band_bytes, write_png
from panostitch.io.rendering import Pixels, Preview, Rendering, read_tile, tiles_of
from panostitch.io.tiff import write_tiff
from panostitch.model.canvas import Region
from panostitch.model.panorama import Panorama
from panostitch.options import OutputOptions
from panostitch.runtime import memory
from panostitch.runtime.executor import Executor, serial
from panostitch.runtime.trace import Trace, silent

__all__ = ["assemble", "check_output", "write_bytes", "write_panorama", "write_picture"]

EXTENSIONS = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".webp")
JPEG = (".jpg", ".jpeg")
JPEG_LIMIT = 65_500  # px a side
WEBP_LIMIT = 16_383  # px a side
PNG_LEVEL = 3  # a quarter of the time of the best compression for a few per cent of size
ENCODING = {3: 6, 4: 14}  # bytes a pixel that pictures of so many channels take while they are encoded whole
FINISHED = 6  # tiles a thread, encoded or not, that wait until they are written
NO_STREAM = (
    "write a .tif, which is written as it is made; allow more with --max-memory; or make it smaller with --scale"
)


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
    panorama: Panorama, path: str, options: OutputOptions, *, run: Executor = serial, trace: Trace = silent
) -> None:
    """Render the cropped panorama and write it.

    Raises OutputError; LimitError for a JPEG or WebP of impossible size, or where memory does not suffice.
    """
    crop, extension = panorama.plan.crop, Path(path).suffix.lower()
    _check_sides(path, extension, crop)
    preview = None if trace is silent else Preview(crop)
    picture = Rendering(panorama, run, preview)
    picture = replace(picture, run=_bounded(picture, extension, options))
    with replacing(path) as file:
        if extension in (".tif", ".tiff"):
            write_tiff(file, path, picture, options)
        elif extension == ".png":
            write_png(file, picture)
        else:
            file.write(_encode(path, picture.whole(_channels(picture, extension)), quality=options.quality).data)
    if preview:
        trace("panorama.written", path=path, size=(crop.width, crop.height), preview=preview.pixels)


def _check_sides(path: str, extension: str, crop: Region) -> None:
    """Raise LimitError where the format has no such sizes."""
    limit = JPEG_LIMIT if extension in JPEG else WEBP_LIMIT if extension == ".webp" else None
    if limit and max(crop.width, crop.height) > limit:
        name = "JPEG" if extension in JPEG else "WebP"
        raise LimitError(
            f"{path}: a {name} has at most {limit} px a side, this would be {crop.width} x {crop.height}",
            hint="write a .tif or .png, or make it smaller with --scale",
        )


def _bounded(picture: Rendering, extension: str, options: OutputOptions) -> Executor:
    """The threads that --max-memory allows. Raises LimitError where it allows none."""
    if options.memory is None:
        return picture.run
    crop, channels = picture.crop, _channels(picture, extension)
    streams = extension in (".tif", ".tiff")
    whole = 0 if streams else crop.area * ENCODING[channels]
    held = min(whole, 2 * band_bytes(crop, channels)) if extension == ".png" else whole
    tiles = tiles_of(crop)
    each = max(map(picture.panorama.cost, tiles)) + FINISHED * max(tile.area for tile in tiles) * channels
    return memory.within(
        picture.run,
        options.memory,
        each=each,
        besides=picture.panorama.kept + held,
        hint="" if streams else NO_STREAM,
    )


def _channels(picture: Rendering, extension: str) -> int:
    return 3 if extension in JPEG else picture.channels


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
    write_bytes(path, _encode(path, picture, quality=quality))


def _encode(path: str, picture: Pixels, *, quality: int) -> Pixels:
    """RGB or RGBA (h, w, channels), which is overwritten, in the format of the path."""
    extension = Path(path).suffix.lower()
    code = cv2.COLOR_RGB2BGR if picture.shape[2] == 3 else cv2.COLOR_RGBA2BGRA
    cv2.cvtColor(picture, code, dst=picture)
    parameters = {
        ".png": [cv2.IMWRITE_PNG_COMPRESSION, PNG_LEVEL],
        ".jpg": [cv2.IMWRITE_JPEG_QUALITY, quality],
        ".jpeg": [cv2.IMWRITE_JPEG_QUALITY, quality],
        ".webp": [cv2.IMWRITE_WEBP_QUALITY, quality],
    }.get(extension, [])
    written, data = cv2.imencode(extension, picture, parameters)
    if not written:
        raise OutputError(f"{path}: could not be encoded")
    return np.asarray(data, np.uint8)
