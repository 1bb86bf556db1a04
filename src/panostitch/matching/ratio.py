"""Which nearest neighbours to believe: Lowe's ratio test (2004) and mutual agreement, together."""

from collections.abc import Sequence

import numpy as np

from panostitch.matching.neighbours import Matcher, Neighbours
from panostitch.model.features import Features
from panostitch.model.match import Indices, PutativeMatch

NO_PAIRS = np.zeros((0, 2), np.int32)


def match_pair(
    features: Sequence[Features], pair: tuple[int, int], *, matcher: Matcher, ratio: float, seed: int
) -> PutativeMatch:
    """Putative matches of one pair (i, j) of photos."""
    i, j = pair
    a, b = features[i].descriptors, features[j].descriptors
    if not (len(a) and len(b)):
        return PutativeMatch(i, j, NO_PAIRS, NO_PAIRS)
    neighbours = matcher(a, b, seed=seed)
    found = np.flatnonzero(neighbours.index >= 0)
    raw = np.column_stack([found, neighbours.index[found]]).astype(np.int32)
    return PutativeMatch(i, j, raw, believable(neighbours, ratio))


def believable(neighbours: Neighbours, ratio: float) -> Indices:
    """Pairs (m, 2) that are mutual and at most `ratio` times as far as the second nearest."""
    # two equal neighbours at distance zero say nothing, so equality fails; ratio 1 switches the test off
    distinct = neighbours.best < ratio * neighbours.second if ratio < 1 else np.ones(len(neighbours.best), bool)
    chosen = np.flatnonzero(neighbours.mutual & distinct)
    return np.column_stack([chosen, neighbours.index[chosen]]).astype(np.int32)
