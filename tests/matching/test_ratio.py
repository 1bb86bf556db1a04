"""Which nearest neighbours are believed: planted ambiguous ones are not, unless the ratio test is switched off."""

import cv2
import numpy as np
import pytest

from panostitch.features import detect_one
from panostitch.matching import MATCHERS, brute_force, match
from panostitch.matching.neighbours import Neighbours
from panostitch.matching.ratio import believable, match_pair
from panostitch.model.features import Features
from panostitch.model.photo import Photo
from panostitch.options import FeatureOptions, MatchingOptions
from panostitch.runtime.executor import Executor
from panostitch.synthetic.render import ArraySource

AMBIGUOUS = 0.05  # distance of the planted rival from the true partner; the true partner is 0.2 away
NEAR = 0.2

KINDS, COPIES = 30, 12  # windows of a made-up house: so many sorts, each so many times
# Share of the false matches without the ratio test that may be left with it, where all rivals are equally near.
FALSE_LEFT = 0.1

PERIOD = 40  # px of the repeated texture; shifts by it are false matches
TRUE = 2.0  # px; a match that is farther from where it belongs is false
# The same share in pictures, where mutual agreement has removed most false matches already and the edges of the
# repeated part make some windows singular. Seen over 6 pictures: 0.17 to 0.26.
FALSE_LEFT_IN_PICTURES = 0.4
TRUE_LEFT = 0.85  # share of the true matches; 0.94 seen


def unit(rows):
    return (rows / np.linalg.norm(rows, axis=1, keepdims=True)).astype(np.float32)


def features_of(descriptors):
    blank = np.zeros(len(descriptors), np.float32)
    return Features(np.zeros((len(descriptors), 2), np.float32), blank, blank, blank, descriptors, 1.0)


def planted(rng):
    """Twenty descriptors, their partners, and rivals that are nearly equal to the first five partners."""
    a = unit(rng.normal(size=(20, 64)))
    b = unit(a + NEAR * unit(rng.normal(size=a.shape)))
    rivals = unit(b[:5] + AMBIGUOUS * unit(rng.normal(size=(5, 64))))
    return features_of(a), features_of(np.vstack([b, rivals]))


def neighbours(best, second, mutual=True):
    count = len(best)
    return Neighbours(
        np.arange(count, dtype=np.int32),
        np.array(best, np.float32),
        np.array(second, np.float32),
        np.full(count, mutual),
    )


@pytest.mark.parametrize("name", sorted(MATCHERS))
def test_an_ambiguous_match_is_dropped(name, rng):
    found = match_pair(planted(rng), (0, 1), matcher=MATCHERS[name], ratio=0.8, seed=0)

    assert {tuple(pair) for pair in found.pairs.tolist()} == {(n, n) for n in range(5, 20)}
    assert np.array_equal(found.raw[:, 0], np.arange(20))


@pytest.mark.parametrize("name", sorted(MATCHERS))
def test_ratio_one_keeps_it(name, rng):
    found = match_pair(planted(rng), (0, 1), matcher=MATCHERS[name], ratio=1.0, seed=0)

    assert np.array_equal(found.pairs[:, 0], np.arange(20))
    assert np.array_equal(found.pairs[5:, 1], np.arange(5, 20))


def test_the_second_nearest_decides():
    assert believable(neighbours([0.79, 0.81, 0.8], [1.0, 1.0, 1.0]), 0.8)[:, 0].tolist() == [0]


def test_the_only_neighbour_has_no_rival():
    assert len(believable(neighbours([0.9], [np.inf]), 0.8)) == 1


def test_two_equal_neighbours_say_nothing():
    assert len(believable(neighbours([0.0], [0.0]), 0.8)) == 0
    assert len(believable(neighbours([0.0], [0.0]), 1.0)) == 1


@pytest.mark.parametrize("ratio", [0.8, 1.0])
def test_one_sided_matches_are_never_believed(ratio):
    assert len(believable(neighbours([0.1], [1.0], mutual=False), ratio)) == 0


def test_each_feature_is_used_once(rng):
    a, b = (features_of(unit(rng.normal(size=(n, 8)))) for n in (300, 200))

    pairs = match_pair([a, b], (0, 1), matcher=brute_force.nearest, ratio=1.0, seed=0).pairs

    assert len(np.unique(pairs[:, 0])) == len(pairs)
    assert len(np.unique(pairs[:, 1])) == len(pairs)


@pytest.mark.parametrize("name", sorted(MATCHERS))
def test_without_the_ratio_test_repetition_floods_with_false_matches(name, rng):
    kinds = np.repeat(unit(rng.normal(size=(KINDS, 64))), COPIES, axis=0)
    single = unit(rng.normal(size=(100, 64)))
    both = [features_of(unit(np.vstack([kinds, single]) + rng.normal(0, 0.02, (len(kinds) + 100, 64)))) for _ in "ij"]

    false, true = {}, {}
    for ratio in (0.8, 1.0):
        pairs = match_pair(both, (0, 1), matcher=MATCHERS[name], ratio=ratio, seed=0).pairs
        right = pairs[:, 0] == pairs[:, 1]
        false[ratio], true[ratio] = int((~right).sum()), int(right[pairs[:, 0] >= len(kinds)].sum())

    assert false[1.0] > 50
    assert false[0.8] < FALSE_LEFT * false[1.0]
    assert true[0.8] == true[1.0] == 100


def house_front(rng):
    """Two pictures (300, 400, 3) of tiles all alike, and something unlike; the second is 24 px to the left."""

    def blocks(height, width):
        return np.kron(rng.uniform(0, 255, (height // 4, width // 4)), np.ones((4, 4)))

    front = np.tile(blocks(PERIOD, PERIOD), (8, 11))[:300, :424]
    front[:, 150:280] = blocks(300, 424)[:, 150:280]
    front = cv2.GaussianBlur(front, (0, 0), 1.0)
    shots = [front[:, start : start + 400] + rng.normal(0, 6, (300, 400)) for start in (0, 24)]
    return [np.clip(shot, 0, 255).astype(np.uint8)[..., None].repeat(3, axis=2) for shot in shots]


def test_on_a_picture_of_repeated_windows_the_ratio_test_removes_most_false_matches(rng):
    photos = [Photo(str(n), (400, 300), ArraySource(p)) for n, p in enumerate(house_front(rng))]
    features = [detect_one(photo, FeatureOptions(max_features=1500, work_megapixels=0.12)) for photo in photos]

    false, true = {}, {}
    for ratio in (0.8, 1.0):
        pairs = match(features, [(0, 1)], MatchingOptions(ratio=ratio))[0].pairs
        shift = features[0].xy[pairs[:, 0]] - features[1].xy[pairs[:, 1]]
        right = np.linalg.norm(shift - (24, 0), axis=1) < TRUE
        false[ratio], true[ratio] = int((~right).sum()), int(right.sum())

    assert false[1.0] > 100
    assert false[0.8] < FALSE_LEFT_IN_PICTURES * false[1.0]
    assert true[0.8] > TRUE_LEFT * true[1.0]


@pytest.mark.parametrize("matcher", ["auto", "brute", "flann"])
def test_threads_do_not_change_matches(matcher, rng):
    features = [features_of(unit(rng.normal(size=(200, 16)))) for _ in range(4)]
    pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
    options = MatchingOptions(matcher=matcher)

    one, two = (match(features, pairs, options, run=Executor(threads)) for threads in (1, 2))

    assert [(m.i, m.j) for m in one] == pairs
    for a, b in zip(one, two, strict=True):
        assert np.array_equal(a.raw, b.raw)
        assert np.array_equal(a.pairs, b.pairs)
