"""Exact nearest neighbours by one matrix product, for floats of unit length and, as rows of +1 and -1, for bits."""

import numpy as np
from numpy.typing import NDArray

from panostitch.matching.neighbours import Descriptors, Neighbours

Floats = NDArray[np.float32]

ROWS = 512  # of the product at once: it stays in the processor's cache


def nearest(a: Descriptors, b: Descriptors, /, *, seed: int = 0) -> Neighbours:
    """Nearest neighbours between descriptors a (n, d) and b (m, d); exact, so the seed does not matter."""
    del seed
    rows_a, rows_b = floats(a), floats(b)
    index = np.empty(len(a), np.int32)
    best, second = np.empty(len(a), np.float32), np.full(len(a), -np.inf, np.float32)
    best_back = np.full(len(b), -np.inf, np.float32)
    for start in range(0, len(a), ROWS):
        alike = rows_a[start : start + ROWS] @ rows_b.T
        best_back = np.maximum(best_back, alike.max(0))
        rows = slice(start, start + len(alike))
        index[rows], best[rows], second[rows] = _two_largest(alike)
    distance = _hamming if a.dtype == np.uint8 else _euclidean
    bits = rows_a.shape[1]
    return Neighbours(index, distance(best, bits), distance(second, bits), best >= best_back[index])


def floats(descriptors: Descriptors) -> Floats:
    """Descriptors as float32 rows: bits (n, 8 d) of bytes (n, d) as +1 and -1."""
    if descriptors.dtype == np.uint8:
        return np.unpackbits(np.asarray(descriptors, np.uint8), axis=1).astype(np.float32) * 2 - 1
    return np.asarray(descriptors, np.float32)


def _euclidean(product: Floats, _: int) -> Floats:
    """Distance of two rows of unit length from their product."""
    return np.asarray(np.sqrt(np.maximum(2 - 2 * product, 0)), np.float32)


def _hamming(product: Floats, bits: int) -> Floats:
    """Number of differing bits from the product of two rows of signs; exact, since these are small whole numbers."""
    return np.asarray((bits - product) / 2, np.float32)


def _two_largest(product: Floats) -> tuple[NDArray[np.intp], Floats, Floats]:
    """Column, value and runner-up's value of the largest entry of each row; overwrites the largest."""
    rows = np.arange(len(product))
    index = product.argmax(1)
    best = product[rows, index]
    product[rows, index] = -np.inf
    return index, best, product.max(1)
