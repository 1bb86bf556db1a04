"""Pairs that follow from links: where i lies on j and j on k, it is known whether i lies on k.

A first look misses pairs whose common part is narrow; photos between the two reveal them (after Cui et al.,
GraphMatch, WACV 2018, who try all neighbours of neighbours; here only those whose homographies say that they overlap).
"""

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from panostitch.geometry import homography
from panostitch.matching.verify import overlap_of
from panostitch.model.match import Link, VerifiedMatch
from panostitch.model.photo import Photo

Floats = NDArray[np.float64]
Pair = tuple[int, int]

PREDICTED_OVERLAP = 0.08  # of the smaller photo; two homographies in a row are not exact enough for less
MOST_TRIED = 24  # partners of a photo that are compared in full, these included


def second_neighbours(photos: Sequence[Photo], links: Sequence[Link]) -> list[Pair]:
    """Pairs (i, k), i < k, sorted, not among the links, that overlap by way of a third photo; one round.

    Photos that have had MOST_TRIED partners get no more; the largest overlaps come first.
    """
    tried = {(link.i, link.j) for link in links}
    found = _predicted(photos, [link for link in links if isinstance(link, VerifiedMatch)], tried)
    partners = np.bincount(np.array(sorted(tried), np.intp).ravel(), minlength=len(photos))
    chosen = []
    for i, k in sorted(found, key=lambda pair: (-round(found[pair], 6), pair)):
        if max(partners[i], partners[k]) < MOST_TRIED:
            partners[[i, k]] += 1
            chosen.append((i, k))
    return sorted(chosen)


def _predicted(photos: Sequence[Photo], links: Sequence[VerifiedMatch], tried: Collection[Pair]) -> dict[Pair, float]:
    """Overlap of each pair not yet tried that two links in a row make large enough."""
    steps: dict[int, dict[int, Floats]] = {n: {} for n in range(len(photos))}
    for link in links:
        steps[link.i][link.j] = link.j_from_i
        steps[link.j][link.i] = np.asarray(np.linalg.inv(link.j_from_i), np.float64)
    overlaps: dict[Pair, float] = {}
    for middle in range(len(photos)):
        around = sorted(steps[middle])
        for i, k in ((i, k) for i in around for k in around if i < k and (i, k) not in tried):
            k_from_i = steps[middle][k] @ steps[i][middle]
            overlap = _overlap(photos[i].size, photos[k].size, k_from_i)
            if overlap >= PREDICTED_OVERLAP:
                overlaps[i, k] = max(overlap, overlaps.get((i, k), 0.0))
    return overlaps


def _overlap(size_i: tuple[int, int], size_k: tuple[int, int], k_from_i: Floats) -> float:
    centre = np.array([(size_i[0] - 1) / 2, (size_i[1] - 1) / 2])
    k_from_i = homography.normalised(k_from_i, centre)
    return (overlap_of(k_from_i, size_i, size_k) or 0.0) if homography.is_sane(k_from_i, size_i) else 0.0
