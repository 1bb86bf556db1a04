"""TIFF tile by tile, above 4 GB as BigTIFF; smaller copies of the picture, where asked for, as its SubIFDs."""

import zlib
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from threading import Lock
from typing import IO

import cv2
import numpy as np
import tifffile

from panostitch.io.atomic import scratch
from panostitch.io.embed import Embedded, TiffTag, tiff_tags
from panostitch.io.rendering import AHEAD, DTYPES, TILE, Dtype, Rendering, Samples
from panostitch.model.canvas import Region
from panostitch.options import OutputOptions
from panostitch.runtime.executor import Executor

SIDE = TILE // 2  # px of a tile in the file
LEVEL = 3  # of deflate
CLASSIC = 2**32 - 2**26  # bytes up to which a file needs no BigTIFF, with room for its directories


def write_tiff(file: IO[bytes], path: str, picture: Rendering, options: OutputOptions, own: Embedded) -> None:
    """Write RGB, or RGBA where photos do not cover everything; only tiles that are being made are in memory."""
    crop = picture.crop
    levels = _levels(crop.width, crop.height) if options.pyramid == "full" else 0
    most = _tile_count(crop.width, crop.height) * SIDE**2 * picture.pixel_bytes * (4 / 3 if levels else 1)
    with ExitStack() as scratches, tifffile.TiffWriter(file, bigtiff=most > CLASSIC) as tiff:
        target = _Target(
            tiff,
            scratches,
            path,
            picture.channels,
            DTYPES[picture.depth],
            options.compression == "deflate",
            picture.run,
        )
        below = target.write_rendering(picture, levels, tiff_tags(file, own))
        for level in range(1, levels + 1):
            below = target.write_reduced(below, last=level == levels)


class _Tiles:
    """Tiles of half the side, of a picture that is to become the next level, in a scratch file."""

    def __init__(self, file: IO[bytes], width: int, height: int, channels: int, dtype: Dtype) -> None:
        self.width, self.height = (width + 1) // 2, (height + 1) // 2
        self._across, self._down = -(-width // SIDE), -(-height // SIDE)
        self._shape = (SIDE // 2, SIDE // 2, channels)
        self._file, self._dtype, self._lock = file, dtype, Lock()

    def append(self, tile: Samples) -> None:
        """The next of the halved tiles, row by row."""
        self._file.write(tile.tobytes())

    def read(self, place: Region) -> Samples:
        """A tile (SIDE, SIDE, channels) of the next level, at a place that is counted in its tiles."""
        half = SIDE // 2
        tile: Samples = np.zeros((SIDE, SIDE, self._shape[2]), self._dtype)
        for row in range(2 * place.y, min(2 * place.y + 2, self._down)):
            for column in range(2 * place.x, min(2 * place.x + 2, self._across)):
                y, x = (row - 2 * place.y) * half, (column - 2 * place.x) * half
                tile[y : y + half, x : x + half] = self._piece(row * self._across + column)
        return tile

    def _piece(self, number: int) -> Samples:
        size = int(np.prod(self._shape)) * self._dtype.itemsize
        with self._lock:
            self._file.seek(number * size)
            return np.frombuffer(self._file.read(size), self._dtype).reshape(self._shape)

    def close(self) -> None:
        """Give the disk back."""
        self._file.close()


@dataclass(frozen=True)
class _Target:
    """A TIFF that is being written, level after level."""

    tiff: tifffile.TiffWriter
    scratches: ExitStack
    path: str
    channels: int
    dtype: Dtype
    deflate: bool
    run: Executor

    def write_rendering(self, picture: Rendering, levels: int, tags: Sequence[TiffTag]) -> _Tiles | None:
        """The picture itself; the tiles of the next level, if there is one."""
        crop = picture.crop
        halved = self._halved(crop.width, crop.height) if levels else None

        def work(region: Region, pixels: Samples) -> list[tuple[bytes, Samples | None]]:
            parts = [pixels[part.within(region)] for part in region.tiles(SIDE)]
            return [self._encoded(_padded(part), reduce=levels > 0) for part in parts]

        pieces = (piece for pieces in picture.map(work) for piece in pieces)
        self._write(crop.width, crop.height, _kept(pieces, halved), tags, subifds=levels)
        return halved

    def write_reduced(self, source: _Tiles | None, *, last: bool) -> _Tiles | None:
        """A level out of the halved tiles of the one before, which are then gone."""
        assert source is not None
        width, height = source.width, source.height
        halved = None if last else self._halved(width, height)
        places = Region(0, 0, -(-width // SIDE), -(-height // SIDE)).tiles(1)

        def work(place: Region) -> tuple[bytes, Samples | None]:
            valid = place.times(SIDE) & Region(0, 0, width, height)
            return self._encoded(_padded(source.read(place)[: valid.height, : valid.width]), reduce=not last)

        pieces = self.run.map(work, places, label="Reducing", ahead=AHEAD * self.run.threads)
        self._write(width, height, _kept(pieces, halved), subfiletype=1)
        source.close()
        return halved

    def _halved(self, width: int, height: int) -> _Tiles:
        return _Tiles(self.scratches.enter_context(scratch(self.path)), width, height, self.channels, self.dtype)

    def _encoded(self, tile: Samples, *, reduce: bool) -> tuple[bytes, Samples | None]:
        data = _deflated(tile) if self.deflate else tile.tobytes()
        return data, _reduced(tile) if reduce else None

    def _write(
        self,
        width: int,
        height: int,
        tiles: Iterator[bytes],
        tags: Sequence[TiffTag] = (),
        *,
        subifds: int = 0,
        subfiletype: int = 0,
    ) -> None:
        self.tiff.write(
            tiles,
            shape=(height, width, self.channels),
            dtype=self.dtype,
            tile=(SIDE, SIDE),
            photometric="rgb",
            extrasamples=["unassalpha"] if self.channels == 4 else None,
            compression="adobe_deflate" if self.deflate else None,
            predictor="horizontal" if self.deflate else None,
            subifds=subifds,
            subfiletype=subfiletype,
            metadata=None,
            software=False,
            extratags=tags,
        )


def _kept(pieces: Iterator[tuple[bytes, Samples | None]], halved: _Tiles | None) -> Iterator[bytes]:
    """The encoded tiles; their halves go where the next level will look for them."""
    for data, half in pieces:
        if halved is not None and half is not None:
            halved.append(half)
        yield data


def _padded(part: Samples) -> Samples:
    """A tile (SIDE, SIDE, channels), which the last row and column fill up."""
    height, width = part.shape[:2]
    return np.pad(part, ((0, SIDE - height), (0, SIDE - width), (0, 0)), mode="edge")


def _deflated(tile: Samples) -> bytes:
    """Compressed, each pixel less the one to its left (predictor 2)."""
    difference = tile.copy()
    difference[:, 1:] -= tile[:, :-1]
    return zlib.compress(difference.data, LEVEL)


def _reduced(tile: Samples) -> Samples:
    """A tile of half the side: means of four pixels; with alpha (0 or white), of those that show something."""
    height, width, channels = tile.shape
    if channels == 3 or tile[..., 3].all():
        return np.asarray(cv2.resize(tile, (width // 2, height // 2), interpolation=cv2.INTER_AREA), tile.dtype)
    four = tile.reshape(height // 2, 2, width // 2, 2, channels).astype(np.uint32)
    weight = four[..., 3:]
    total = weight.sum((1, 3))
    colour = ((four[..., :3] * weight).sum((1, 3)) + total // 2) // np.maximum(total, 1)
    return np.concatenate([colour, (total + 2) // 4], axis=2).astype(tile.dtype)


def _levels(width: int, height: int) -> int:
    """How often the picture is halved until it is a single tile."""
    levels = 0
    while max(width, height) > SIDE:
        width, height, levels = (width + 1) // 2, (height + 1) // 2, levels + 1
    return levels


def _tile_count(width: int, height: int) -> int:
    return -(-width // SIDE) * -(-height // SIDE)
