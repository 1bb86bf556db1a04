"""Which pairs are compared: all that matter, and no more than grows with the number of photos."""

import numpy as np
import pytest

from matching.mosaics import SIZE, mosaic
from panostitch.matching import link_photos, pairs
from panostitch.matching.pairs import choose_pairs, in_succession, promising
from panostitch.matching.preliminary import count_matches, largest
from panostitch.matching.propagate import second_neighbours
from panostitch.matching.retrieval import best_partners, vlad
from panostitch.model.match import Rejection, VerifiedMatch
from panostitch.model.photo import Photo
from panostitch.options import MatchingOptions
from panostitch.runtime.executor import Executor
from panostitch.synthetic.render import ArraySource

# Pairs looked at for each photo of a large mosaic: 12 alike, half of them shared with a partner, and 2 in succession.
FIRST_LOOKS = 14
# Pairs compared in full for each photo: 4 that overlap a side, 4 that overlap a corner, halved; some more at random.
FULL = 8


@pytest.fixture(scope="module")
def many():
    """A hundred photos, more than are all compared with each other."""
    return mosaic(10, 10, seed=4, named_at_random=True)


def photos_of(names, taken=None):
    taken = taken or [None] * len(names)
    source = ArraySource(np.zeros((1, 1, 3), np.uint8))
    return [Photo(name, SIZE, source, taken=when) for name, when in zip(names, taken, strict=True)]


def by_name(photos, chosen):
    return {frozenset((photos[i].name, photos[j].name)) for i, j in chosen}


@pytest.fixture(scope="module")
def links(many):
    return linked(many)


def linked(photos):
    return link_photos(photos.photos, photos.features, MatchingOptions(), run=Executor(2))


def cost_so_much_for_each_and_no_neighbour_is_missed(photos, links):
    verified = {(link.i, link.j) for link in links if link}
    compared = [link for link in links if link or "largest" not in link.reason]

    assert verified >= photos.neighbours
    assert len(links) <= FIRST_LOOKS * len(photos.photos)
    assert len(compared) <= FULL * len(photos.photos)


def test_many_photos_cost_so_much_for_each_and_no_neighbour_is_missed(many, links):
    cost_so_much_for_each_and_no_neighbour_is_missed(many, links)


@pytest.mark.slow
def test_three_hundred_photos_cost_no_more_for_each():
    three_hundred = mosaic(20, 15, seed=4, named_at_random=True)

    cost_so_much_for_each_and_no_neighbour_is_missed(three_hundred, linked(three_hundred))


def test_every_first_look_is_accounted_for(many, links):
    told = [(link.i, link.j) for link in links]

    assert told == sorted(set(told))
    assert set(told) >= set(choose_pairs(many.photos, many.features, seed=0))


def test_the_order_of_photos_does_not_change_the_pairs(many, rng):
    order = rng.permutation(len(many.photos))
    photos, features = many.shuffled(order)

    first = by_name(many.photos, choose_pairs(many.photos, many.features, seed=0))

    assert by_name(photos, choose_pairs(photos, features, seed=0)) == first


@pytest.mark.parametrize("count", [0, 1, 2, 8])
def test_of_a_few_photos_all_pairs_are_compared_in_full(count):
    small = mosaic(count, 1)

    links = link_photos(small.photos, small.features, MatchingOptions())

    assert len(links) == count * (count - 1) // 2
    assert not [link for link in links if isinstance(link, Rejection) and "largest" in link.reason]


def test_of_a_few_dozen_photos_all_pairs_get_a_first_look():
    photos = photos_of([str(n) for n in range(pairs.ALL_PAIRS_UP_TO)])

    assert len(choose_pairs(photos, [None] * len(photos), seed=0)) == 40 * 39 // 2


def test_a_first_look_sees_neighbours_and_hardly_anything_else():
    flat = mosaic(5, 4)
    counts = count_matches(flat.features, choose_pairs(flat.photos, flat.features, seed=0), ratio=0.8)
    apart = {(i, j) for i, j in counts if abs(i % 5 - j % 5) > 1 or abs(i // 5 - j // 5) > 1}

    assert min(counts[pair] for pair in flat.neighbours) >= pairs.PROMISING
    assert np.mean([counts[pair] >= pairs.PROMISING for pair in apart]) < 0.02


def test_the_largest_features_come_first():
    one = mosaic(1, 1).features[0]

    few = largest(one, 30)

    assert len(few) == 30
    assert few.scale.min() >= np.sort(one.scale)[-30]


def test_a_pair_is_kept_for_its_matches_its_rank_or_its_place_in_the_row():
    photos = photos_of([f"p{n}.jpg" for n in range(12)])
    counts = dict.fromkeys(choose_pairs(photos, [None] * 12, seed=0), 1)
    counts |= {(0, 5): pairs.PROMISING, (0, 6): pairs.PROMISING, (0, 7): pairs.PROMISING, (2, 9): 2}

    kept = set(promising(photos, counts))

    assert kept >= {(0, 5), (0, 6), (0, 7), (2, 9)} | {(n, n + 1) for n in range(11)}
    assert len(kept) < 40
    assert (3, 8) not in kept


def test_time_goes_before_names_and_names_are_numbers():
    photos = photos_of(["p10", "p9", "p1", "x"], taken=[5.0, 7.0, 7.5, 6.0])

    near = by_name(photos, in_succession(photos, reach=1))

    in_time = {frozenset(pair) for pair in (("p10", "x"), ("x", "p9"), ("p9", "p1"))}
    in_name = {frozenset(pair) for pair in (("p1", "p9"), ("p9", "p10"), ("p10", "x"))}
    assert near == in_time | in_name


def test_photos_without_a_time_are_neighbours_by_name_only():
    photos = photos_of(["a", "b", "c"], taken=[1.0, None, None])

    assert in_succession(photos, reach=1) == {(0, 1), (1, 2)}


@pytest.mark.parametrize("binary", [False, True])
def test_partners_are_those_that_share_features(binary, rng):
    shared = rng.normal(size=(3, 60, 32))
    sets = [np.concatenate([shared[n // 2], rng.normal(size=(60, 32))]) for n in range(6)]
    rows = [(np.packbits(one > 0, axis=1) if binary else one / np.linalg.norm(one, axis=1)[:, None]) for one in sets]
    descriptors = [one if binary else one.astype(np.float32) for one in rows]

    assert best_partners(descriptors, 1, seed=0) == [(0, 1), (2, 3), (4, 5)]


def test_a_photo_without_features_is_like_none(rng):
    some = rng.normal(size=(400, 16)).astype(np.float32)

    vectors = vlad([some, some[:0], some[:200]], seed=0)

    np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), [1, 0, 1], atol=1e-5)
    assert best_partners([some[:0], some[:0]], 3, seed=0) == [(0, 1)]


def shift(i, j, right):
    """A link of two photos of which the second shows what is `right` px further right."""
    points = np.zeros((20, 2))
    return VerifiedMatch(i, j, points, points, np.array([[1.0, 0, -right], [0, 1, 0], [0, 0, 1]]), 30, 0.5, 0.5, 30)


def test_neighbours_of_neighbours_are_tried_if_they_overlap():
    photos = photos_of("abcd")
    chain = [shift(0, 1, 150), shift(1, 2, 150), shift(2, 3, 240)]

    assert second_neighbours(photos, chain) == [(0, 2)]  # 100 px in common; 1 and 3 are 390 px apart, 10 in common


def test_what_was_tried_is_not_proposed_again():
    photos = photos_of("abc")

    assert second_neighbours(photos, [shift(0, 1, 100), Rejection(0, 2, "no"), shift(1, 2, 100)]) == []


def test_a_photo_that_had_its_share_of_partners_gets_no_more():
    many = 60
    photos = photos_of([str(n) for n in range(many)])
    star = [shift(0, n, 2.0 * n) for n in range(1, many)]

    proposed = np.bincount(np.array(second_neighbours(photos, star)).ravel(), minlength=many)

    assert proposed.max() < 24
    assert proposed[0] == 0


def test_narrow_overlaps_are_found_by_way_of_a_third_photo(monkeypatch):
    monkeypatch.setattr(pairs, "BEST", 0)
    monkeypatch.setattr(pairs, "PROMISING", 40)  # corners share 16 % of a photo: too little for the first look
    flat = mosaic(4, 3)
    corners = {(0, 5), (1, 4), (5, 10)}

    links = link_photos(flat.photos, flat.features, MatchingOptions())

    assert {(link.i, link.j) for link in links if link} >= corners
    looks = count_matches(flat.features, sorted(corners), ratio=0.8)
    assert max(looks.values()) < 40
