"""Rotation averaging shares what pairs disagree about, and is not led astray by a few of them."""

import numpy as np
import pytest

from panostitch.alignment.averaging import averaged
from panostitch.geometry import rotation
from tolerances import UNIT

NOISE = np.deg2rad(0.5)


def ring(count, rng):
    """True turns of photos all round, and the pairs of each with the next two."""
    turns = [rotation.from_angles(2 * np.pi * n / count, *rng.normal(0, 0.1, 2)) for n in range(count)]
    return turns, [(n, (n + k) % count) for n in range(count) for k in (1, 2)]


def relative_turns(turns, pairs, rng, noise):
    return [rotation.exp(rng.normal(0, noise, 3)) @ turns[j] @ turns[i].T for i, j in pairs]


def chained(relative, pairs, count):
    """Turns along the shortest way from the first photo, as a tree would have them."""
    step = dict(zip(pairs, relative, strict=True))
    turns = [np.eye(3)]
    for n in range(1, count):
        turns.append(step[n - 1, n] @ turns[n - 1])
    return turns


def errors(found, true):
    """Degrees (n,) between turns, free of the world's axes."""
    return np.rad2deg([rotation.angle(f @ found[0].T @ true[0] @ t.T) for f, t in zip(found, true, strict=True)])


def test_exact_pairs_give_exact_turns(rng):
    true, pairs = ring(12, rng)
    relative = relative_turns(true, pairs, rng, 0.0)
    start = [rotation.exp(rng.normal(0, 0.2, 3)) @ turn for turn in true]

    found = averaged(start, pairs, relative, np.ones(len(pairs)))

    assert errors(found, true).max() < 1e-5
    np.testing.assert_allclose(found[0], start[0], atol=UNIT)


def test_a_ring_is_closed(rng):
    true, pairs = ring(24, rng)
    relative = relative_turns(true, pairs, rng, NOISE)
    start = chained(relative, pairs, 24)

    found = averaged(start, pairs, relative, np.ones(len(pairs)))

    assert errors(found, true).max() < 0.6 * errors(start, true).max()
    assert errors(found, true)[-1] < errors(start, true)[-1] / 2


@pytest.mark.parametrize("seed", range(5))
def test_wrong_pairs_count_little(seed):
    rng = np.random.default_rng(seed)
    true, pairs = ring(24, rng)
    relative = relative_turns(true, pairs, rng, NOISE)
    healthy = averaged(chained(relative, pairs, 24), pairs, relative, np.ones(len(pairs)))
    wrong = [7, 30]
    for n in wrong:
        relative[n] = rotation.exp(np.array([0.0, 0.9, 0.3])) @ relative[n]

    found = averaged(healthy, pairs, relative, np.ones(len(pairs)))

    assert errors(found, healthy).max() < 1.0


def test_heavier_pairs_are_believed():
    turns = [np.eye(3)] * 2
    pairs = [(0, 1), (0, 1)]
    relative = [np.eye(3), rotation.exp(np.array([0.0, 0.01, 0.0]))]

    found = averaged(turns, pairs, relative, [1.0, 3.0])

    assert rotation.angle(found[1] @ found[0].T) == pytest.approx(0.0075, rel=0.01)


def test_nothing_to_average():
    assert averaged([np.eye(3)], [], [], []) == [pytest.approx(np.eye(3))]
