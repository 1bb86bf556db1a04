"""What shows nothing in a picture: transparent pixels, or black ones that hang together with an edge."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from panostitch.model.canvas import Region

Mask = NDArray[np.bool_]

BLACK = 8.01 / 255  # of white, 8 grey levels: compression of JPEG leaves that much beside an edge
CELLS = 1024  # along the longer side, of the map of what is empty


@dataclass(frozen=True)
class Border:
    """What shows nothing.

    kind:  how that was told: by alpha, or by black
    left, top, right, bottom: px that are empty all along the side
    share: of the picture, 0 to 1
    step:  px to which the sides are exact: more than 1 where a smaller copy was looked at
    """

    kind: Literal["transparent", "black"]
    left: int
    top: int
    right: int
    bottom: int
    share: float
    step: int


def is_empty(pixels: NDArray[Any], *, alpha: bool) -> Mask:
    """Which pixels (h, w, channels) show nothing; the last channel may be alpha."""
    if alpha:
        return np.asarray(pixels[..., -1] == 0)
    # compared with a whole number, whole numbers stay what they are, which is many times quicker
    darkest = int(BLACK * np.iinfo(pixels.dtype).max) if pixels.dtype.kind in "ui" else BLACK
    empty = np.asarray(pixels[..., 0] <= darkest)
    for channel in range(1, pixels.shape[2]):
        empty &= pixels[..., channel] <= darkest
    return empty


class Emptiness:
    """Gathers the pieces of a picture, in any order, and keeps a coarse map of them."""

    def __init__(self, size: tuple[int, int], step: int) -> None:
        """For a picture of `size` pixels, each of which stands for `step` px a side."""
        (self._width, self._height), self._step = size, step
        self._cell = -(-max(size) // CELLS)
        self._columns = np.ones(self._width, bool)
        self._rows = np.ones(self._height, bool)
        self._count = np.zeros((-(-self._height // self._cell), -(-self._width // self._cell)), np.int64)

    def add(self, region: Region, empty: Mask) -> None:
        """A piece (h, w) at its place."""
        if not empty.any():
            self._columns[region.x : region.right] = False
            self._rows[region.y : region.bottom] = False
            return
        self._columns[region.x : region.right] &= empty.all(0)
        self._rows[region.y : region.bottom] &= empty.all(1)
        (rows, y), (columns, x) = self._cells(region.y, region.bottom), self._cells(region.x, region.right)
        counts = np.add.reduceat(np.add.reduceat(empty, y, axis=0, dtype=np.int64), x, axis=1)
        self._count[rows, columns] += counts

    def border(self, kind: Literal["transparent", "black"]) -> Border:
        """What all pieces together say."""
        sides = (self._columns, self._rows, self._columns[::-1], self._rows[::-1])
        left, top, right, bottom = (self._step * _leading(side) for side in sides)
        area = self._width * self._height
        count = self._count if kind == "transparent" else self._count[self._at_edges()]
        return Border(kind, left, top, right, bottom, float(count.sum() / area), self._step)

    def _cells(self, begin: int, end: int) -> tuple[slice, NDArray[np.intp]]:
        """The cells that pixels `begin` to `end` lie in, and where each begins, counted from `begin`."""
        first, last = begin // self._cell, (end - 1) // self._cell
        starts = np.maximum(np.arange(first, last + 1) * self._cell, begin) - begin
        return slice(first, last + 1), starts.astype(np.intp)

    def _at_edges(self) -> Mask:
        """Cells that hang together with an edge of the picture by empty cells, and those beside them."""
        heights, widths = (
            np.minimum(self._cell, length - self._cell * np.arange(count))
            for length, count in zip((self._height, self._width), self._count.shape, strict=True)
        )
        whole = self._count == np.outer(heights, widths)
        edge = np.ones_like(whole)
        edge[1:-1, 1:-1] = False
        reached = ndimage.binary_propagation(whole & edge, mask=whole)
        return np.asarray(ndimage.binary_dilation(reached, np.ones((3, 3), bool)))


def _leading(empty: Mask) -> int:
    """How many are empty before the first that is not; all of them, if none is."""
    return int(np.argmin(empty)) if not empty.all() else len(empty)
