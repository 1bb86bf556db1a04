"""A photo: a light handle that knows its size and lens, and reads pixels on demand."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import cv2
import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]

DIGITS = tuple("0123456789")


class PixelSource(Protocol):
    """Something that yields the pixels of one upright photo."""

    def read(self, scale: float = 1.0) -> tuple[Pixels, Pixels | None]:
        """Pixels (h, w, 3) RGB of the whole photo at `scale` <= 1, and a mask (h, w) where alpha says so.

        The mask is 255 where the photo shows something and 0 where it is transparent; None if it is opaque.
        Raises InputError where the pixels cannot be had.
        """
        ...


@runtime_checkable
class GreySource(Protocol):
    """Something that yields the brightness of one upright photo for less than its colours."""

    def read_grey(self, scale: float = 1.0) -> tuple[Pixels, Pixels | None]:
        """As `PixelSource.read`, but grey pixels (h, w)."""
        ...


class DeepSource(Protocol):
    """Something that yields the pixels of one upright photo with 16 bits a channel."""

    def read(self, scale: float = 1.0) -> tuple[NDArray[np.uint16], Pixels | None]:
        """As `PixelSource.read`; white is 65535."""
        ...


@dataclass(frozen=True)
class Photo:
    """A photo as the pipeline sees it.

    name:   what messages call it, unique within a run
    size:   (width, height) px, upright
    source: where its pixels come from, with 8 bits a channel
    path:   the file it lies in; empty for a photo that exists in memory only
    focal:  focal length px as the metadata has it, a hint; None where they have none
    lens:   photos of the same lens share this; empty where the metadata do not say
    taken:  seconds from some fixed day to the exposure, for the order of photos; None where unknown
    notes:  what was surprising on reading, for the user's eyes
    deep:   where its pixels come from with 16 bits a channel; None where it has no more than 8
    profile: ICC profile of those pixels; empty where it has none, which means sRGB
    """

    name: str
    size: tuple[int, int]
    source: PixelSource
    path: str = ""
    focal: float | None = None
    lens: str = ""
    notes: tuple[str, ...] = ()
    taken: float | None = None
    deep: DeepSource | None = None
    profile: bytes = field(default=b"", repr=False)

    @property
    def depth(self) -> int:
        """Bits of a channel: 8 or 16."""
        return 16 if self.deep else 8

    @property
    def megapixels(self) -> float:
        """Size in millions of pixels."""
        return self.size[0] * self.size[1] / 1e6

    def read_grey(self, scale: float = 1.0) -> tuple[Pixels, Pixels | None]:
        """Grey pixels (h, w) of the whole photo at `scale` <= 1, and its mask. Raises InputError."""
        if isinstance(self.source, GreySource):
            return self.source.read_grey(scale)
        pixels, mask = self.source.read(scale)
        return grey_of(pixels), mask


def grey_of(pixels: Pixels) -> Pixels:
    """The brightness (h, w) of RGB pixels (h, w, 3), as JPEG defines it."""
    return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY), np.uint8)


def lens_groups(photos: Sequence[Photo]) -> list[int]:
    """For each photo the number of its lens: photos with the same metadata and size (either way up) share one."""
    keys = [(photo.lens, *sorted(photo.size)) for photo in photos]
    numbers = {key: number for number, key in enumerate(dict.fromkeys(keys))}
    return [numbers[key] for key in keys]


def natural_key(name: str) -> tuple[object, ...]:
    """Sort key under which photo_9 comes before photo_10."""
    parts = re.split(r"([0-9]+)", name.casefold())
    return tuple((int(part), "") if part[:1] in DIGITS else (-1, part) for part in parts if part), name
