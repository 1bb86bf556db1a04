"""The cropped panorama as pixels of 8 or 16 bits, tile by tile in a fixed order, for those who write it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.model.canvas import Region
from panostitch.model.panorama import Panorama
from panostitch.runtime.executor import Executor

Pixels = NDArray[np.uint8]
Samples = NDArray[np.unsignedinteger[Any]]
Dtype = np.dtype[np.unsignedinteger[Any]]
Result = TypeVar("Result")

TILE = 1024  # px wide, and half as high: its arrays stay small, and most tiles hold no seam
PREVIEW = 1600  # px, longer side of the preview that goes to the trace
DTYPES: dict[int, Dtype] = {8: np.dtype(np.uint8), 16: np.dtype(np.uint16)}  # by bits of a channel
STRIP = 64  # px, rows that are encoded at once; always as many, so that threads do not change the bytes
AHEAD = 2  # finished tiles a thread that may wait until they are written


class Preview:
    """A small copy of the picture, which grows with its tiles. Tiles may come in any order, from any thread."""

    def __init__(self, crop: Region) -> None:
        self._crop = crop
        self._scale = min(1.0, PREVIEW / max(crop.width, crop.height))
        height, width = (max(1, round(n * self._scale)) for n in (crop.height, crop.width))
        self.pixels = np.zeros((height, width, 3), np.uint8)

    def add(self, region: Region, pixels: Samples) -> None:
        """Put in the pixels (h, w, ...) of a region."""
        left, right = (round((x - self._crop.x) * self._scale) for x in (region.x, region.right))
        top, bottom = (round((y - self._crop.y) * self._scale) for y in (region.y, region.bottom))
        place = self.pixels[top:bottom, left:right]
        if place.size:
            small = cv2.resize(pixels[..., :3], place.shape[1::-1], interpolation=cv2.INTER_AREA)
            place[...] = cv2.convertScaleAbs(small, alpha=1 / 257) if small.dtype == np.uint16 else small


class Finished(Protocol):
    """A place for the tiles of a picture that are made already."""

    def get(self, tile: Region, make: Callable[[], Samples], /) -> Samples:
        """The pixels of a tile, made where they are not there."""
        ...


@dataclass(frozen=True)
class Rendering:
    """A panorama on its way into a file. The order and the size of its tiles depend on nothing but the picture."""

    panorama: Panorama
    run: Executor
    channels: int  # 3, or 4 with alpha
    depth: int = 8  # bits of a channel, 8 or 16
    preview: Preview | None = None
    finished: Finished | None = None
    by_columns: bool = False  # the order of the tiles; what is written in strips is made whole first then

    @property
    def crop(self) -> Region:
        """The part of the canvas that is written."""
        return self.panorama.plan.crop

    @property
    def pixel_bytes(self) -> int:
        """Bytes of a pixel."""
        return self.channels * self.depth // 8

    @property
    def tiles(self) -> list[Region]:
        """The tiles in the order in which they are made.

        Columns run across the shorter side: photos are soon done with, and few are in memory at once.
        """
        tiles, crop = tiles_of(self.crop), self.crop
        across = self.by_columns and crop.width > crop.height
        return sorted(tiles, key=lambda tile: (tile.x, tile.y)) if across else tiles

    def map(self, work: Callable[[Region, Samples], Result]) -> Iterator[Result]:
        """What `work` makes of each tile's region and pixels (h, w, channels), in threads."""

        def whole(region: Region) -> Result:
            return work(region, self.pixels(region))

        tiles = self.tiles
        last = {photo: number for number, tile in enumerate(tiles) for photo in self.panorama.photos(tile)}
        results = self.run.map(whole, tiles, label="Rendering", ahead=AHEAD * self.run.threads)
        for number, result in enumerate(results):
            yield result
            for photo in [photo for photo, tile in last.items() if tile == number]:
                self.panorama.forget(photo)

    def pixels(self, region: Region) -> Samples:
        """RGB or RGBA (h, w, channels) of a region of the canvas."""
        picture = self.finished.get(region, lambda: self._made(region)) if self.finished else self._made(region)
        if self.preview:
            self.preview.add(region, picture)
        return picture

    def _made(self, region: Region) -> Samples:
        pixels, mask = read_tile(self.panorama, region, self.depth)
        return pixels if self.channels == 3 else np.asarray(cv2.merge([pixels, mask]))

    def strips(self, work: Callable[[Samples, Samples], Result]) -> Iterator[Result]:
        """What `work` makes of every `STRIP` rows (h, width, channels), from the top, in threads.

        It gets the row above them (1, width, channels) as well; above the first one there are zeros.
        """
        above = np.zeros((1, self.crop.width, self.channels), DTYPES[self.depth])
        run = Executor(self.run.threads)
        for band in [self.whole()] if self.by_columns else self._rows():
            tops = range(0, len(band), STRIP)
            strips = [(band[top : top + STRIP], band[top - 1 : top] if top else above) for top in tops]
            yield from run.map(lambda strip: work(*strip), strips, label="Encoding", ahead=run.threads)
            above = band[-1:].copy()

    def _rows(self) -> Iterator[Samples]:
        """The rows of tiles (h, width, channels)."""
        crop = self.crop
        row = np.empty((0, crop.width, self.channels), DTYPES[self.depth])
        for region, tile in self.map(lambda region, tile: (region, tile)):
            if region.x == crop.x:
                row = np.empty((region.height, *row.shape[1:]), row.dtype)
            row[:, region.x - crop.x : region.right - crop.x] = tile
            if region.right == crop.right:
                yield row

    def whole(self) -> Samples:
        """The whole picture (h, w, channels)."""
        picture = np.empty((self.crop.height, self.crop.width, self.channels), DTYPES[self.depth])
        for region, tile in self.map(lambda region, tile: (region, tile)):
            picture[region.within(self.crop)] = tile
        return picture


def tiles_of(crop: Region) -> list[Region]:
    """The tiles of a picture. All formats have the same, so that all hold the same pixels."""
    return crop.tiles(TILE, TILE // 2)


def read_tile(panorama: Panorama, region: Region, depth: int = 8) -> tuple[Samples, Samples]:
    """RGB (h, w, 3) and coverage (h, w), 0 or white, of a region of the canvas; white is 255 or 65535."""
    layer, dtype = panorama.read(region), DTYPES[depth]
    white = np.iinfo(dtype).max
    # OpenCV rounds half to even, as NumPy does, and cuts off what is beyond black and white, in one go
    kind = cv2.CV_8U if depth == 8 else cv2.CV_16U
    pixels = cv2.addWeighted(layer.pixels, white / 255, layer.pixels, 0, 0, dtype=kind)
    return np.asarray(pixels, dtype), layer.mask.astype(dtype) * dtype.type(white)
