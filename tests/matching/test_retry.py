"""What is tried again: bridges between what has stayed apart, and a bounded number of them."""

import numpy as np
import pytest

from panostitch.matching import find_groups, improved, pairs_to_retry
from panostitch.matching.retry import BRIDGES, MOST_APART
from panostitch.model.match import Rejection, VerifiedMatch
from panostitch.model.photo import Photo
from panostitch.synthetic.render import ArraySource


def link(i, j, inliers=20):
    points = np.zeros((inliers, 2))
    return VerifiedMatch(i, j, points, points, np.eye(3), 30, 0.4, 0.5, 30)


def no(i, j, inliers=0, putative=0):
    return Rejection(i, j, "no", putative=putative, inliers=inliers, needed=9)


def chosen(count, links):
    source = ArraySource(np.zeros((1, 1, 3), np.uint8))
    photos = [Photo(f"p{n}", (40, 30), source) for n in range(count)]
    return pairs_to_retry(photos, links, find_groups(count, links))


def test_nothing_is_tried_again_where_all_belong_together():
    assert chosen(4, [link(0, 1), link(1, 2), no(0, 2, 8), link(2, 3), no(0, 3, 8)]) == []


def test_a_lonely_photo_is_tried_with_its_best_partners_and_its_neighbours_in_order():
    chain = [link(n, n + 1) for n in range(8)]  # 9 is alone; it comes after 8
    evidence = [no(n, 9, inliers=inliers) for n, inliers in enumerate([1, 2, 7, 3, 6, 0, 5, 4])]

    assert chosen(10, chain + evidence) == [(2, 9), (4, 9), (6, 9), (8, 9)]


@pytest.mark.parametrize(("inliers", "expected"), [(4, []), (5, [(1, 3)])])
def test_between_groups_only_what_came_near_a_link_is_tried_again(inliers, expected):
    links = [link(0, 1), link(1, 2), no(0, 2, inliers=8), link(3, 4), no(1, 3, inliers=inliers)]

    assert chosen(5, links) == expected


@pytest.mark.parametrize("count", [10, 200])
def test_a_heap_of_strangers_costs_a_bounded_number(count, rng):
    links = [no(i, j, int(rng.integers(0, 9))) for i in range(count) for j in range(i + 1, count)]

    assert len(chosen(count, links)) <= min(count, MOST_APART) * (BRIDGES + 2)


def test_a_retry_counts_if_it_links_or_comes_nearer():
    before = [no(0, 1, inliers=5), no(0, 2, inliers=5), link(1, 2)]
    nearer, farther, new = no(0, 1, inliers=7), no(0, 2, inliers=3), link(0, 3)

    assert improved(before, [new, farther, nearer]) == [nearer, before[1], new, before[2]]
