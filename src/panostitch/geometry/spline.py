"""Uniform cubic B-splines: smooth, local, and never beyond the values of their nodes (de Boor, "A Practical Guide to
Splines", 1978). Of `cells` cells in a row, cell k lies between the nodes k + 1 and k + 2 of cells + 3.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

ORDER = 4  # nodes that a place sees along one axis


def weights(place: Floats, cells: int) -> tuple[Indices, Floats]:
    """The first of the four nodes that each place (n,) sees, in cells from the start, and their weights (4, n).

    Places beyond the ends see what the ends see; NaN sees the start.
    """
    inside = np.clip(np.nan_to_num(place, nan=0.0), 0, cells)
    cell = np.minimum(inside.astype(np.intp), cells - 1)
    t = inside - cell
    s = 1 - t
    found = np.stack([s**3, 3 * t**3 - 6 * t**2 + 4, 3 * s**3 - 6 * s**2 + 4, t**3])
    return cell, found / 6
