"""What file formats can hold, and what memory it takes to write them."""

from dataclasses import dataclass
from pathlib import Path

from panostitch.errors import LimitError, UsageError
from panostitch.io import jpeg, png
from panostitch.io.rendering import Rendering, columns_of, tiles_of
from panostitch.model.canvas import Region
from panostitch.model.panorama import Panorama
from panostitch.options import OutputOptions
from panostitch.runtime import memory
from panostitch.runtime.executor import Executor

TIFF = (".tif", ".tiff")
JPEG = (".jpg", ".jpeg")
DEEP = (".png", ".tif", ".tiff")  # can hold 16 bits a channel
SIDES = {".jpg": 65_500, ".jpeg": 65_500, ".webp": 16_383}  # px, where a format has a limit that matters
WHOLE = {3: 11, 4: 15}  # bytes a pixel that a WebP of so many channels takes while it is encoded
# rows of the picture as large as what a thread takes while it encodes a strip, in the formats that are written so
ENCODING = {".jpg": 3 * jpeg.ROWS, ".jpeg": 3 * jpeg.ROWS, ".png": 6 * png.ROWS}
FINISHED = 6  # tiles a thread, encoded or not, that wait until they are written
NO_STREAM = (
    "write a .tif, which is written as it is made; allow more with --max-memory; or make it smaller with --scale"
)


@dataclass(frozen=True)
class Need:
    """Bytes of memory that writing takes: for each thread, and besides."""

    each: int
    besides: int


def check_sides(path: str, crop: Region) -> None:
    """Raise LimitError where the format of a path has no such sizes."""
    extension = Path(path).suffix.lower()
    limit = SIDES.get(extension)
    if limit and max(crop.width, crop.height) > limit:
        name = "JPEG" if extension in JPEG else "WebP"
        raise LimitError(
            f"{path}: a {name} has at most {limit} px a side, this would be {crop.width} x {crop.height}",
            hint="write a .tif or .png, or make it smaller with --scale",
        )


def check_depth(path: str, depth: str) -> None:
    """Raise UsageError where a format has not as many bits as were asked for."""
    if depth == "16" and Path(path).suffix.lower() not in DEEP:
        raise UsageError(
            f"{path}: this format has 8 bits a channel, not 16",
            hint="write a .tif or .png, or leave --depth 16 out",
        )


def depth_for(panorama: Panorama, path: str, asked: str) -> tuple[int, tuple[str, ...]]:
    """Bits of a channel, and what is to be said of them."""
    deepest = max((photo.depth for photo in panorama.alignment.photos), default=8) if panorama.alignment else 8
    if asked != "auto":
        return int(asked), ()
    if deepest == 16 and Path(path).suffix.lower() not in DEEP:
        return 8, ("photos have 16 bits a channel, this format has 8: write a .tif or .png to keep them",)
    return deepest, ()


def channels_in(panorama: Panorama, path: str) -> int:
    """Of the file: a JPEG has no alpha."""
    return 3 if Path(path).suffix.lower() in JPEG else panorama.channels


def need(picture: Rendering, path: str) -> Need:
    """What it takes to write a picture in the format of a path."""
    crop, extension, pixel = picture.crop, Path(path).suffix.lower(), picture.pixel_bytes
    tiles = tiles_of(crop)
    each = max(map(picture.panorama.cost, tiles)) + FINISHED * max(tile.area for tile in tiles) * pixel
    if extension in ENCODING:
        each += min(ENCODING[extension], crop.height) * crop.width * pixel
        return Need(each, min(picture.by_rows, picture.by_columns))
    if extension == ".webp":
        return Need(each, crop.area * WHOLE[picture.channels] + picture.panorama.kept(columns_of(crop)))
    return Need(each, picture.panorama.kept(tiles))


def bounded(picture: Rendering, path: str, options: OutputOptions) -> Executor:
    """The threads that --max-memory allows. Raises LimitError where it allows none."""
    if options.memory is None:
        return picture.run
    needed = need(picture, path)
    hint = "" if Path(path).suffix.lower() in TIFF else NO_STREAM
    return memory.within(picture.run, options.memory, each=needed.each, besides=needed.besides, hint=hint)
