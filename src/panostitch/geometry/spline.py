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
    inside = np.fmin(np.fmax(place, 0), cells)  # which take NaN for the other one
    cell = np.minimum(inside.astype(np.intp), cells - 1)
    t = inside - cell
    s = 1 - t
    tt, ss = t * t, s * s  # powers are many times slower than products
    return cell, np.array([s * ss / 6, 2 / 3 - tt * (1 - t / 2), 2 / 3 - ss * (1 - s / 2), t * tt / 6])
