"""Exact nearest neighbours by one matrix product, for floats of unit length and, as rows of +1 and -1, for bits."""

import numpy as np
from numpy.typing import NDArray

from panostitch.matching.neighbours import Descriptors, Neighbours

Floats = NDArray[np.float32]

ROWS = 512  # of the product at once: it stays in the processor's cache


def nearest(a: Descriptors, b: Descriptors, /, *, seed: int = 0) -> Neighbours:
    """Nearest neighbours between descriptors a (n, d) and b (m, d); exact, so the seed does not matter."""
    del seed
    binary = a.dtype == np.uint8
    distances = _hamming if binary else _square
    rows_a, rows_b = (_signs(d) if binary else np.asarray(d, np.float32) for d in (a, b))
    index = np.empty(len(a), np.int32)
    best, second = np.empty(len(a), np.float32), np.full(len(a), np.inf, np.float32)
    nearest_back = np.full(len(b), np.inf, np.float32)
    for start in range(0, len(a), ROWS):
        part = distances(rows_a[start : start + ROWS], rows_b)
        nearest_back = np.minimum(nearest_back, part.min(0))
        rows = slice(start, start + len(part))
        index[rows], best[rows], second[rows] = _two_smallest(part)
    mutual = best <= nearest_back[index]
    if not binary:
        best, second = np.sqrt(best), np.sqrt(second)
    return Neighbours(index, best, second, mutual)


def _square(a: Floats, b: Floats) -> Floats:
    """Squared Euclidean distances (n, m) between rows of unit length."""
    product = a @ b.T
    product *= -2
    product += 2
    return np.asarray(np.maximum(product, 0, out=product), np.float32)


def _signs(descriptors: Descriptors) -> Floats:
    """Bits (n, 8 d) of bytes (n, d) as +1 and -1."""
    return np.unpackbits(np.asarray(descriptors, np.uint8), axis=1).astype(np.float32) * 2 - 1


def _hamming(a: Floats, b: Floats) -> Floats:
    """Numbers (n, m) of differing bits between rows of signs; exact, since they are small whole numbers."""
    product = a @ b.T
    product -= a.shape[1]
    product *= np.float32(-0.5)
    return product


def _two_smallest(distances: Floats) -> tuple[NDArray[np.intp], Floats, Floats]:
    """Column, value and runner-up's value of the smallest entry of each row; overwrites the smallest."""
    rows = np.arange(len(distances))
    index = distances.argmin(1)
    best = distances[rows, index]
    distances[rows, index] = np.inf
    return index, best, distances.min(1)
