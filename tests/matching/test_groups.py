"""Which photos belong together."""

import numpy as np
import pytest

from panostitch.matching import find_groups
from panostitch.model.match import Groups, Rejection, VerifiedMatch

POINTS = np.zeros((20, 2))


def link(i, j):
    return VerifiedMatch(i, j, POINTS, POINTS, np.eye(3), 30, 0.4, 0.5, 30)


def test_components_largest_first_then_by_the_first_photo():
    links = [link(8, 9), link(0, 7), link(2, 4), link(4, 5), link(1, 3), link(2, 5)]

    groups = find_groups(11, links)

    assert groups == Groups(((2, 4, 5), (0, 7), (1, 3), (8, 9)), (6, 10))


def test_chain_is_one_group():
    assert find_groups(5, [link(n, n + 1) for n in range(4)]).panoramas == ((0, 1, 2, 3, 4),)


def test_rejections_link_nothing():
    assert find_groups(3, [Rejection(0, 1, "no"), link(1, 2)]) == Groups(((1, 2),), (0,))


@pytest.mark.parametrize("count", [0, 1, 4])
def test_no_links_no_groups(count):
    assert find_groups(count, []) == Groups((), tuple(range(count)))


def test_order_of_links_does_not_matter(rng):
    links = [link(*sorted(rng.choice(30, 2, replace=False).tolist())) for _ in range(22)]

    first = find_groups(30, links)

    assert all(find_groups(30, [links[n] for n in rng.permutation(22)]) == first for _ in range(5))
    everyone = sorted([*first.singles, *(n for group in first.panoramas for n in group)])
    assert everyone == list(range(30))
