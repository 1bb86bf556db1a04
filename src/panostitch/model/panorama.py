"""The panorama as a function of a region, and the plan it is made by."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from panostitch.model.alignment import Alignment
from panostitch.model.canvas import Canvas, Layer, Region
from panostitch.model.light import Light

NOBODY = -1  # label of canvas pixels that no photo covers


@dataclass(frozen=True)
class Plan:
    """All that needs the whole picture at once, at 1 / `factor` of the canvas.

    light:      what makes the photos equally bright
    factor:     canvas px in a pixel of the arrays below: a power of two
    labels:     (h, w) int16, which photo owns the pixel; NOBODY outside all photos
    changes:    for each photo, on its footprints: (h, w, 3) float32, what the blend of the low bands adds to it; empty
                where nothing is blended on the reduced canvas
    crop:       the part of the canvas that is written
    crop_reason: why, one sentence
    covered:     photos cover every pixel of the crop, so that it needs no alpha
    """

    light: Light
    factor: int
    labels: NDArray[np.int16]
    changes: tuple[tuple[tuple[Region, NDArray[np.float32]], ...], ...]
    crop: Region
    crop_reason: str
    covered: bool = False


TYPICAL_COST = 200  # bytes for each pixel of a region while it is made


def typical_cost(region: Region) -> int:
    """Bytes that a region takes where nobody knows better."""
    return region.area * TYPICAL_COST


def _none_known(region: Region) -> frozenset[int]:
    del region
    return frozenset()


def keep(photo: int) -> None:
    """Let go of nothing."""
    del photo


def _no_bytes(regions: Sequence[Region]) -> int:
    del regions
    return 0


@dataclass(frozen=True)
class Panorama:
    """A panorama: `read(region)` makes the pixels of any region of the canvas when they are asked for.

    photos: from a region to the numbers of the photos that `read` looks at for it
    forget: tells that the photo of this number will not be looked at again soon
    cost: from a region to the bytes of memory that `read` takes while it works, about
    shown: from regions that are read one after the other to the bytes of the photos that are needed at once meanwhile
    budget: bytes of photos that stay in memory at most; what is dropped for that is decoded again
    alignment: the photos and their cameras, as the canvas sees them; None where nothing is known of them
    """

    canvas: Canvas
    plan: Plan
    read: Callable[[Region], Layer]
    photos: Callable[[Region], frozenset[int]] = _none_known
    forget: Callable[[int], None] = keep
    cost: Callable[[Region], int] = typical_cost
    shown: Callable[[Sequence[Region]], int] = _no_bytes
    budget: int = sys.maxsize
    alignment: Alignment | None = None

    def kept(self, regions: Sequence[Region]) -> int:
        """Bytes of photos that stay in memory, at most, while these regions are read one after the other."""
        return min(self.budget, self.shown(regions))

    @property
    def channels(self) -> int:
        """3, or 4 with alpha, where the photos do not cover the whole picture."""
        return 3 if self.plan.covered else 4
