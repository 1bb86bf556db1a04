"""Even distribution over the photo: a homography needs points everywhere, not the best bush."""

import numpy as np
from numpy.typing import NDArray

CELLS = 24  # along the longer side; fine enough for an overlap of a tenth of the photo to have its share


def spread(
    xy: NDArray[np.float32], response: NDArray[np.float32], size: tuple[int, int], count: int
) -> NDArray[np.intp]:
    """Indices of at most `count` points (n, 2): the strongest of every cell of a grid, then the second ones, ...

    `size` is (width, height) px of the picture. Ties are broken by position, so the answer is the same on every run.
    """
    cell = max(size) / CELLS
    column, row = (xy / cell).astype(np.int64).T
    cells = row * (CELLS + 1) + column
    by_cell = np.lexsort((xy[:, 1], xy[:, 0], -response, cells))
    first = np.flatnonzero(np.diff(cells[by_cell], prepend=-1))
    rank = np.empty(len(xy), np.int64)
    rank[by_cell] = np.arange(len(xy)) - np.repeat(first, np.diff(first, append=len(xy)))
    order = np.lexsort((xy[:, 1], xy[:, 0], -response, rank))
    return np.asarray(order[:count], np.intp)
