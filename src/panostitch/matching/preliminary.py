"""A first look at many pairs: matches among the few largest features of each photo (Wu, 3DV 2013).

Large features are few, are found again at other sizes, and stand for much of the picture: two photos that share
nothing hardly ever have more than a handful of matches among them, at a twentieth of the price of all.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from panostitch.matching import brute_force
from panostitch.matching.ratio import match_pair
from panostitch.model.features import Features
from panostitch.runtime.executor import Executor, serial

LARGEST = 300  # features of each photo that are compared

Pair = tuple[int, int]


def count_matches(
    features: Sequence[Features], pairs: Sequence[Pair], *, ratio: float, run: Executor = serial
) -> dict[Pair, int]:
    """Number of matches of each pair (i, j), i < j, among the largest features."""
    work = partial(_count, [largest(one, LARGEST) for one in features], ratio=ratio)
    return dict(zip(pairs, run.map(work, pairs, label="Comparing photos"), strict=True))


def largest(features: Features, count: int) -> Features:
    """The features of the largest scale; ties go by strength, then by place."""
    x, y = features.xy.T
    return features.take(np.lexsort((y, x, -features.response, -features.scale))[:count])


def _count(few: Sequence[Features], pair: Pair, *, ratio: float) -> int:
    return len(match_pair(few, pair, matcher=brute_force.nearest, ratio=ratio, seed=0).pairs)
