"""What every matcher promises, whichever it is: `MATCHERS` decides which are tested."""

import numpy as np
import pytest

from panostitch.matching import MATCHERS
from panostitch.matching.ratio import match_pair
from panostitch.model.features import Features

# Distance of unit vectors (2 at the most); the matrix product works in float32, and 2 - 2 a.b loses half of its
# digits where the two are nearly the same: sqrt(2 * 64 * 6e-8) at the worst.
DISTANCE = 3e-3

# Share of nearest neighbours that an index must find; on structured data it finds nearly all.
# All are found on the seeds 0 to 7.
FOUND = 0.9

FLIPPED_BITS = 20  # of 256 between a descriptor and its copy; unrelated ones differ in 128
SPREAD = 0.2  # length of the difference between a descriptor and its copy; unrelated ones are 1.4 apart

MATCHER_NAMES = sorted(MATCHERS)
KINDS = ["float", "binary"]


def structured(kind, count, seed, *, extra=40):
    """Descriptors (count, d), and noisy copies of them in another order among `extra` others (count + extra, d)."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(count + extra)
    if kind == "float":
        a = rng.normal(size=(count + extra, 64))
        a /= np.linalg.norm(a, axis=1, keepdims=True)
        b = a + rng.normal(scale=SPREAD / 8, size=a.shape)
        b /= np.linalg.norm(b, axis=1, keepdims=True)
        return a[:count].astype(np.float32), b[order].astype(np.float32)
    a = rng.integers(0, 2, (count + extra, 256), np.uint8)
    flip = rng.permuted(np.arange(256)[None].repeat(count + extra, 0), axis=1) < FLIPPED_BITS
    return np.packbits(a, axis=1)[:count], np.packbits(a ^ flip, axis=1)[order]


def distance(p, q):
    if p.dtype == np.uint8:
        return float(np.unpackbits(p ^ q).sum())
    return float(np.sqrt(((p.astype(np.float64) - q) ** 2).sum()))


def naive(a, b):
    """Index, best, second, mutual by two loops over everything."""
    index, best, second = [], [], []
    for p in a:
        to_all = sorted((distance(p, q), n) for n, q in enumerate(b))
        index.append(to_all[0][1])
        best.append(to_all[0][0])
        second.append(to_all[1][0] if len(b) > 1 else np.inf)
    back = [min(range(len(a)), key=lambda n: distance(a[n], q)) for q in b]
    mutual = [back[j] == i for i, j in enumerate(index)]
    return np.array(index), np.array(best), np.array(second), np.array(mutual)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_brute_force_agrees_with_two_loops(kind, seed):
    a, b = structured(kind, 60, seed)
    if kind == "binary":  # ties among small whole numbers are usual: leave one answer only
        b = b[::2]

    found = MATCHERS["brute"](a, b, seed=0)
    index, best, second, mutual = naive(a, b)

    tolerance = 0 if kind == "binary" else DISTANCE
    chosen = np.array([distance(p, b[j]) for p, j in zip(a, found.index, strict=True)])
    np.testing.assert_allclose(chosen, best, atol=tolerance)
    np.testing.assert_allclose(found.best, best, atol=tolerance)
    np.testing.assert_allclose(found.second, second, atol=tolerance)
    clear = second - best > tolerance
    assert clear.mean() > 0.5
    assert np.array_equal(found.index[clear], index[clear])
    # of pairs that are copies of each other it is certain that they are mutual
    pairs = best < (2 * FLIPPED_BITS if kind == "binary" else 2 * SPREAD)
    assert mutual[pairs].all()
    assert found.mutual[pairs].all()


@pytest.mark.parametrize("kind", KINDS)
def test_brute_force_by_blocks_of_rows_is_one_search(kind):
    a, b = structured(kind, 1200, 5)  # more rows than brute force multiplies at once

    whole = MATCHERS["brute"](a, b, seed=0)
    parts = [MATCHERS["brute"](part, b, seed=0) for part in np.array_split(a, 7)]

    assert np.array_equal(whole.index, np.concatenate([part.index for part in parts]))
    np.testing.assert_allclose(whole.best, np.concatenate([part.best for part in parts]), atol=DISTANCE)
    # a true pair is mutual although its partner was also looked at in the other blocks
    assert whole.mutual.all()


@pytest.mark.parametrize("name", MATCHER_NAMES)
@pytest.mark.parametrize("kind", KINDS)
def test_finds_what_is_there(name, kind):
    a, b = structured(kind, 1500, 9, extra=300)
    exact = MATCHERS["brute"](a, b, seed=0)

    found = MATCHERS[name](a, b, seed=3)

    assert (found.index == exact.index).mean() >= FOUND
    assert (found.mutual & exact.mutual).sum() >= FOUND * exact.mutual.sum()
    # some are missed, none is invented
    seen = np.flatnonzero(found.index >= 0)
    true = [distance(a[n], b[found.index[n]]) for n in seen[:200]]
    np.testing.assert_allclose(found.best[seen[:200]], true, atol=0 if kind == "binary" else DISTANCE)
    assert (found.second >= found.best)[seen].all()


@pytest.mark.parametrize("name", MATCHER_NAMES)
@pytest.mark.parametrize("kind", KINDS)
def test_shapes_and_types(name, kind):
    a, b = structured(kind, 100, 1)

    found = MATCHERS[name](a, b, seed=0)

    assert all(len(v) == 100 for v in vars(found).values())
    assert found.index.dtype == np.int32
    assert found.best.dtype == found.second.dtype == np.float32
    assert found.mutual.dtype == bool
    assert found.index.max() < len(b)


@pytest.mark.parametrize("name", MATCHER_NAMES)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("count", "others"), [(1, 1), (1, 2), (2, 1), (2, 2), (1, 50), (50, 1), (33, 2)])
def test_few_descriptors(name, kind, count, others):
    a, b = (structured(kind, n, seed=7, extra=0)[0] for n in (count, others))

    found = MATCHERS[name](a, b, seed=0)

    assert len(found.index) == count
    assert found.index.min() >= 0
    assert found.index.max() < others
    assert np.isinf(found.second).all() == (others == 1)
    assert found.mutual.any()


@pytest.mark.parametrize("name", MATCHER_NAMES)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("count", "others"), [(0, 0), (0, 5), (5, 0)])
def test_no_descriptors_no_matches(name, kind, count, others):
    features = [_features(structured(kind, n, seed=7, extra=0)[0]) for n in (count, others)]

    found = match_pair(features, (0, 1), matcher=MATCHERS[name], ratio=0.8, seed=0)

    assert found.raw.shape == found.pairs.shape == (0, 2)


@pytest.mark.parametrize("name", MATCHER_NAMES)
@pytest.mark.parametrize("kind", KINDS)
def test_same_seed_same_answer(name, kind):
    a, b = structured(kind, 600, 2)

    first, again = (MATCHERS[name](a, b, seed=11) for _ in range(2))

    assert all(np.array_equal(vars(first)[key], vars(again)[key]) for key in vars(first))


@pytest.mark.parametrize("name", MATCHER_NAMES)
@pytest.mark.parametrize("kind", KINDS)
def test_descriptors_are_left_as_they_were(name, kind):
    a, b = structured(kind, 100, 1)
    before = a.copy(), b.copy()

    MATCHERS[name](a, b, seed=0)

    assert np.array_equal(a, before[0])
    assert np.array_equal(b, before[1])


def _features(descriptors):
    blank = np.zeros(len(descriptors), np.float32)
    return Features(np.zeros((len(descriptors), 2), np.float32), blank, blank, blank, descriptors, 1.0)
