"""Finished tiles beside the picture that they are for, so that a run that was killed goes on from them.

NAME.partial is a line of JSON that says what the tiles are of, then a slot for each tile: its pixels as they are in
memory, and their CRC-32. Tiles come in any order; what is only half in its slot does not have its checksum and is made
again. The formats are made of the same tiles, so all can go on, and end in the bytes of a run that was not killed.
"""

import hashlib
import json
import os
import platform
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from threading import Lock
from typing import IO

import cv2
import numpy as np
import PIL
import scipy

from panostitch.errors import OutputError
from panostitch.io.limits import channels_in
from panostitch.io.rendering import DTYPES, Samples, tiles_of
from panostitch.model.alignment import Alignment
from panostitch.model.canvas import Region
from panostitch.model.panorama import Panorama
from panostitch.options import Options

EXTENSION = ".partial"
FORMAT = "panostitch partial panorama"
CHECK = 4  # bytes of a checksum; those of a slot that was never written are zero


class FinishedTiles:
    """The tiles of a picture that are made already, in a file. Thread-safe."""

    def __init__(self, file: IO[bytes], first: int, crop: Region, channels: int, depth: int, note: str) -> None:
        self._file, self._lock, self._channels, self._dtype = file, Lock(), channels, DTYPES[depth]
        self._offsets: dict[Region, int] = {}
        for tile in tiles_of(crop):
            self._offsets[tile] = first
            first += self._bytes(tile) + CHECK
        self.found = sum(any(self._read(offset + self._bytes(tile), CHECK)) for tile, offset in self._offsets.items())
        self.made = 0
        self.note = note or (f"going on: {self.found} of {len(self._offsets)} tiles are there" if self.found else "")

    def get(self, tile: Region, make: Callable[[], Samples]) -> Samples:
        """The pixels (h, w, channels) of a tile: from the file, or made and put there. Raises OSError."""
        offset, size = self._offsets[tile], self._bytes(tile)
        with self._lock:
            slot = self._read(offset, size + CHECK)
        if len(slot) == size + CHECK and slot[size:] == _checksum(slot[:size]):
            return np.frombuffer(slot[:size], self._dtype).reshape(tile.height, tile.width, self._channels)
        pixels = np.ascontiguousarray(make())
        with self._lock:
            self._write(offset, pixels.tobytes() + _checksum(pixels.data))
            self.made += 1
        return pixels

    def _bytes(self, tile: Region) -> int:
        return tile.area * self._channels * self._dtype.itemsize

    def _read(self, offset: int, size: int) -> bytes:
        self._file.seek(offset)
        return self._file.read(size)

    def _write(self, offset: int, data: bytes) -> None:
        self._file.seek(offset)
        self._file.write(data)
        self._file.flush()


@contextmanager
def finished_tiles(path: str, key: str, panorama: Panorama, depth: int = 8) -> Iterator[FinishedTiles]:
    """The tiles that an earlier run left for the panorama at `path`, if its key was the same.

    Their file is gone when the block ends without an error, and stays for the next run if not. Raises OutputError.
    """
    crop, channels = panorama.plan.crop, channels_in(panorama, path)
    place = Path(path + EXTENSION)
    facts = {
        "format": FORMAT,
        "key": key,
        "crop": [crop.x, crop.y, crop.width, crop.height],
        "channels": channels,
        "depth": depth,
    }
    head = (json.dumps(facts) + "\n").encode()
    try:
        there = _head(place)
        if there is not None and there != head and FORMAT.encode() not in there:
            raise OutputError(f"{place}: is no part of a panorama", hint="move it away, or go without --resume")
        with open(place, "r+b" if there == head else "w+b") as file:
            if there != head:
                file.write(head)
            note = "is of other photos or options: starting anew" if there not in (None, head) else ""
            tiles = FinishedTiles(file, len(head), crop, channels, depth, note)
            try:
                yield tiles
            except BaseException:
                if not (tiles.found or tiles.made):
                    place.unlink()
                raise
        place.unlink()
    except OSError as error:
        raise OutputError(f"{place}: cannot be used: {error.strerror or error}") from None


def fingerprint(alignment: Alignment, options: Options) -> str:
    """A key that changes with everything that pixels depend on: cameras, options, photos, programs."""
    files = [(os.stat(p.path).st_size, os.stat(p.path).st_mtime_ns) for p in alignment.photos if p.path]
    # other versions of the programs may make other pixels
    programs = [
        platform.machine(),
        version("panostitch"),
        cv2.__version__,
        np.__version__,
        scipy.__version__,
        PIL.__version__,
        version("simplejpeg"),
    ]
    facts = [alignment.to_json(), repr(options.layout), repr(options.compositing), files, programs]
    return hashlib.sha256(json.dumps(facts).encode()).hexdigest()


def _head(place: Path) -> bytes | None:
    """The first line of a file; None where there is none."""
    try:
        with open(place, "rb") as file:
            return file.readline(1 << 16)
    except FileNotFoundError:
        return None


def _checksum(data: bytes | memoryview) -> bytes:
    return zlib.crc32(data).to_bytes(CHECK, "little")
