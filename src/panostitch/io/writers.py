"""Writing panoramas: tile by tile into one picture, to a temporary name, renamed at the end."""

import os
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.errors import LimitError, OutputError
from panostitch.model.canvas import Region
from panostitch.model.panorama import Panorama
from panostitch.options import OutputOptions
from panostitch.runtime.executor import Executor, serial
from panostitch.runtime.trace import Trace, silent

Pixels = NDArray[np.uint8]

EXTENSIONS = (".jpg", ".jpeg", ".png", ".tif", ".tiff")
JPEG_LIMIT = 65_500  # px a side
TILE = 1024  # px a side: its arrays stay small, and most tiles hold no seam
PREVIEW = 1600  # px, longer side of the preview that goes to the trace
PNG_LEVEL = 3  # a quarter of the time of the best compression for a few per cent of size


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
    """Render the cropped panorama and write it. Raises OutputError, or LimitError for a JPEG of impossible size."""
    crop = panorama.plan.crop
    if path.lower().endswith((".jpg", ".jpeg")) and max(crop.width, crop.height) > JPEG_LIMIT:
        raise LimitError(
            f"{path}: a JPEG has at most {JPEG_LIMIT} px a side, this would be {crop.width} x {crop.height}",
            hint="write a .tif or .png, or make it smaller with --scale",
        )
    pixels, mask = assemble(panorama, run=run)
    write_picture(path, pixels, mask, quality=options.quality)
    trace("panorama.written", path=path, size=(crop.width, crop.height), preview=_preview(pixels))


def assemble(panorama: Panorama, *, run: Executor = serial) -> tuple[Pixels, Pixels]:
    """The cropped panorama as RGB (h, w, 3) and its coverage (h, w), 0 or 255."""
    crop = panorama.plan.crop
    pixels = np.zeros((crop.height, crop.width, 3), np.uint8)
    mask = np.zeros((crop.height, crop.width), np.uint8)
    tiles = crop.tiles(TILE)
    for tile, (part, covered) in zip(tiles, run.map(partial(_tile, panorama), tiles, label="Rendering"), strict=True):
        place = tile.within(crop)
        pixels[place], mask[place] = part, covered
    return pixels, mask


def _tile(panorama: Panorama, region: Region) -> tuple[Pixels, Pixels]:
    layer = panorama.read(region)
    return np.rint(layer.pixels).clip(0, 255).astype(np.uint8), layer.mask.astype(np.uint8) * np.uint8(255)


def write_picture(path: str, pixels: Pixels, mask: Pixels | None = None, *, quality: int = 92) -> None:
    """Write RGB pixels (h, w, 3); a mask that is not full becomes alpha where the format has it. Raises OutputError."""
    extension = Path(path).suffix.lower()
    alpha = mask is not None and extension not in (".jpg", ".jpeg") and not mask.all()
    picture = np.dstack([pixels[..., ::-1], mask]) if alpha and mask is not None else pixels[..., ::-1]
    parameters = {
        ".png": [cv2.IMWRITE_PNG_COMPRESSION, PNG_LEVEL],
        ".jpg": [cv2.IMWRITE_JPEG_QUALITY, quality],
        ".jpeg": [cv2.IMWRITE_JPEG_QUALITY, quality],
    }.get(extension, [])
    written, data = cv2.imencode(extension, np.ascontiguousarray(picture), parameters)
    if not written:
        raise OutputError(f"{path}: could not be encoded")
    write_bytes(path, data)


def write_bytes(path: str, data: Any) -> None:
    """Write a file whole or not at all. Raises OutputError."""
    target = Path(path)
    temporary = ""
    try:
        with tempfile.NamedTemporaryFile(dir=target.parent, prefix=f".{target.name[:40]}.", delete=False) as file:
            temporary = file.name
            file.write(data)
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, target)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from None
    finally:
        if temporary and os.path.exists(temporary):
            os.unlink(temporary)


def _umask() -> int:
    """The process's umask, under which temporary files are not made."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask


def _preview(pixels: Pixels) -> Pixels:
    scale = PREVIEW / max(pixels.shape[:2])
    if scale >= 1:
        return pixels
    size = max(1, round(pixels.shape[1] * scale)), max(1, round(pixels.shape[0] * scale))
    return np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)
