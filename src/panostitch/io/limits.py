"""What file formats can hold, and what memory it takes to write them."""

from dataclasses import dataclass, replace
from pathlib import Path

from panostitch.errors import LimitError, UsageError
from panostitch.io.rendering import STRIP, Rendering
from panostitch.model.canvas import Region
from panostitch.model.panorama import Panorama
from panostitch.options import OutputOptions
from panostitch.runtime import memory

TIFF = (".tif", ".tiff")
JPEG = (".jpg", ".jpeg")
DEEP = (".png", ".tif", ".tiff")  # can hold 16 bits a channel
SIDES = {".jpg": 65_500, ".jpeg": 65_500, ".webp": 16_383}  # px, where a format has a limit that matters
WHOLE = {3: 11, 4: 15}  # bytes a pixel that a WebP of so many channels takes while it is encoded
STRIPS = {".jpg": 4, ".jpeg": 4, ".png": 7}  # strips' bytes that a thread takes while it encodes one
FINISHED = 6  # tiles a thread, encoded or not, that wait until they are written
SMALLEST = "write a .tif, which takes the least; allow more with --max-memory; or make it smaller with --scale"


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
    """What it takes to write a picture in the format of a path, tile by tile in its order."""
    crop, extension, pixel, tiles = picture.crop, Path(path).suffix.lower(), picture.pixel_bytes, picture.tiles
    each = max(map(picture.panorama.cost, tiles)) + FINISHED * max(tile.area for tile in tiles) * pixel
    each += STRIPS.get(extension, 0) * min(STRIP, crop.height) * crop.width * pixel
    return Need(each, _held(picture, extension) + picture.panorama.kept(tiles))


def arranged(picture: Rendering, path: str, options: OutputOptions) -> Rendering:
    """The picture with its tiles in the better order, and as many threads as --max-memory allows.

    Raises LimitError where it allows none.
    """
    picture = replace(picture, by_columns=_by_columns(picture, path, options.memory))
    if options.memory is None:
        return picture
    needed = need(picture, path)
    hint = "" if Path(path).suffix.lower() in TIFF else SMALLEST
    run = memory.within(picture.run, options.memory, each=needed.each, besides=needed.besides, hint=hint)
    return replace(picture, run=run)


def _by_columns(picture: Rendering, path: str, limit: int | None) -> bool:
    """Whether the whole picture is made first, as WebP wants it.

    It may take less memory than the photos that a row of tiles shows, which would else be decoded for each row anew.
    """
    extension = Path(path).suffix.lower()
    if extension not in STRIPS:
        return extension == ".webp"
    whole = replace(picture, by_columns=True)
    by_columns, by_rows = (_held(p, extension) + p.panorama.shown(p.tiles) for p in (whole, picture))
    if by_columns >= by_rows or limit is None:
        return by_columns < by_rows
    needed = need(whole, path)
    return memory.threads_within(limit, each=needed.each, besides=needed.besides) > 0


def _held(picture: Rendering, extension: str) -> int:
    """Bytes of the picture that are in memory besides the tiles at work."""
    crop, pixel = picture.crop, picture.pixel_bytes
    if extension == ".webp":
        return crop.area * WHOLE[picture.channels]
    if picture.by_columns:
        return crop.area * pixel
    return 2 * crop.width * picture.tiles[0].height * pixel if extension in STRIPS else 0
