"""Approximate nearest neighbours by index: KD-trees for floats, locality-sensitive hashing for bits.

Muja & Lowe 2009 (FLANN). Its trees are random: the generator is seeded before each search, so that runs repeat.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.matching import brute_force
from panostitch.matching.neighbours import Descriptors, Neighbours

KD_TREE: dict[str, Any] = {"algorithm": 1, "trees": 4}
LSH: dict[str, Any] = {"algorithm": 6, "table_number": 12, "key_size": 16, "multi_probe_level": 1}
CHECKS: dict[str, Any] = {"checks": 64}
TOO_FEW = 32  # below this an index answers nothing useful, or raises


def nearest(a: Descriptors, b: Descriptors, /, *, seed: int = 0) -> Neighbours:
    """Nearest neighbours between descriptors a (n, d) and b (m, d); some are missed, none is invented."""
    if min(len(a), len(b)) < TOO_FEW:
        return brute_force.nearest(a, b)
    index, best, second = _search(a, b, seed)
    back = _search(b, a, seed)[0]
    mutual = (index >= 0) & (back[index] == np.arange(len(a)))
    return Neighbours(index, best, second, np.asarray(mutual))


def _search(
    query: Descriptors, train: Descriptors, seed: int
) -> tuple[NDArray[np.int32], NDArray[np.float32], NDArray[np.float32]]:
    cv2.setRNGSeed(seed)
    binary = train.dtype == np.uint8
    matcher = cv2.FlannBasedMatcher(LSH if binary else KD_TREE, CHECKS)
    index = np.full(len(query), -1, np.int32)
    best, second = (np.full(len(query), np.inf, np.float32) for _ in range(2))
    for row, found in enumerate(matcher.knnMatch(query, train, k=2)):
        # LSH may find one neighbour or none at all
        if found:
            index[row], best[row] = found[0].trainIdx, found[0].distance
        if len(found) > 1:
            second[row] = found[1].distance
    return index, best, second
