"""What can be said of two photos together: what they agree on, where, and in how many ways."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.typing import NDArray

from panostitch.diagnosis.agreement import Agreement, epipolar, find_agreement, motions
from panostitch.geometry import homography
from panostitch.matching import MATCHERS
from panostitch.matching.ratio import believable
from panostitch.matching.verify import overlap_of
from panostitch.model.features import Features
from panostitch.model.match import Indices

Floats = NDArray[np.float64]

STRIPS = (0.08, 0.15)  # of a side: where two photos meet that hardly overlap
STRIP_RATIO = 0.9  # of the ratio test among the few key points of a strip, where a match has fewer rivals
CELLS = 8  # a photo is this many cells wide and high


@dataclass(frozen=True)
class PairEvidence:
    """Two photos in numbers; `matches` (m, 2) are indices of their features, `agree` (m,) says which of them agree.

    overlap:  share of the smaller photo that both show, by what agrees; None where nothing does
    spread:   how much of the overlap the agreeing matches lie in, beside as many random ones (1)
    motions:  how many matches move together, for each of the ways in which some do
    flat:     how many matches one homography explains
    epipolar: how many matches one moving camera explains
    refuted:  the two were linked, and other links contradict that
    """

    matches: Indices = field(default_factory=lambda: np.zeros((0, 2), np.int32))
    agree: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, np.bool_))
    chance: float = 0.0
    overlap: float | None = None
    spread: float = 1.0
    motions: tuple[int, ...] = ()
    flat: int = 0
    epipolar: int = 0
    refuted: bool = False

    @property
    def agreeing(self) -> int:
        """How many matches agree."""
        return int(self.agree.sum())


def compare(
    features: tuple[Features, Features],
    sizes: tuple[tuple[int, int], tuple[int, int]],
    *,
    ratio: float,
    threshold: float,
    seed: int,
    refuted: bool = False,
) -> PairEvidence:
    """The evidence of two photos by their features; ratio and threshold (working px) as in matching."""
    everywhere = tuple(np.arange(len(one)) for one in features)
    pairs = _match(features, everywhere, ratio)
    xy_i, xy_j = _places(features, pairs)
    found = find_agreement(xy_i, xy_j, sizes[1])
    together = motions(xy_i, xy_j, sizes[1])
    tolerance = threshold * features[1].pixel_size
    plane = homography.estimate(xy_i, xy_j, threshold=tolerance, seed=seed)
    if not found:
        pairs, found = min(
            [(pairs, found), *_along_the_edges(features, sizes)], key=lambda one: (not one[1], one[1].chance)
        )
    if not found:
        return PairEvidence(pairs, np.zeros(len(pairs), np.bool_), found.chance, refuted=refuted)
    return PairEvidence(
        pairs,
        found.agree,
        found.chance,
        overlap_of(found.j_from_i, *sizes),
        _spread(features[0], pairs[found.agree, 0], found.j_from_i, *sizes),
        tuple(together),
        int(plane[1].sum()) if plane else 0,
        epipolar(xy_i, xy_j, tolerance=tolerance, seed=seed),
        refuted,
    )


def _match(features: tuple[Features, Features], chosen: Sequence[NDArray[np.intp]], ratio: float) -> Indices:
    """Mutual matches (m, 2) among the chosen features of each photo."""
    if not all(len(index) for index in chosen):
        return np.zeros((0, 2), np.int32)
    a, b = (one.descriptors[index] for one, index in zip(features, chosen, strict=True))
    pairs = believable(MATCHERS["brute"](a, b, seed=0), ratio)
    return np.column_stack([chosen[0][pairs[:, 0]], chosen[1][pairs[:, 1]]]).astype(np.int32)


def _places(features: tuple[Features, Features], pairs: Indices) -> tuple[Floats, Floats]:
    xy_i, xy_j = (one.xy[pairs[:, side]].astype(np.float64) for side, one in enumerate(features))
    return xy_i, xy_j


def _along_the_edges(
    features: tuple[Features, Features], sizes: tuple[tuple[int, int], tuple[int, int]]
) -> list[tuple[Indices, Agreement]]:
    """What agrees along the right edge of one photo and the left one of the other, and so on all around."""
    shares = [one.xy / np.array(size) for one, size in zip(features, sizes, strict=True)]
    found = []
    for axis, strip, (near, far) in product((0, 1), STRIPS, ((0, 1), (1, 0))):
        start, end = shares[near][:, axis] < strip, shares[far][:, axis] > 1 - strip
        chosen = [np.flatnonzero(start if side == near else end) for side in (0, 1)]
        pairs = _match(features, chosen, STRIP_RATIO)
        found.append((pairs, find_agreement(*_places(features, pairs), sizes[1], within=strip)))
    return found


def _spread(
    features: Features, agreeing: NDArray[np.int32], j_from_i: Floats, size_i: tuple[int, int], size_j: tuple[int, int]
) -> float:
    """Cells of the overlap that agreeing matches lie in, by those that as many random ones would."""
    there = homography.apply(j_from_i, features.xy.astype(np.float64))
    cell = (features.xy / np.array(size_i) * CELLS).astype(int) @ [1, CELLS]
    both = len(np.unique(cell[((there >= 0) & (there < np.array(size_j))).all(1)]))
    if not both or not len(agreeing):
        return 1.0
    expected = both * (1 - (1 - 1 / both) ** len(agreeing))
    return len(np.unique(cell[agreeing])) / expected
