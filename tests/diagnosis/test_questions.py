"""What is worth explaining: photos alone, groups apart, and weak links that nothing backs."""

import numpy as np
import pytest

from panostitch.diagnosis.questions import MOST_QUESTIONS, Question, questions, weak_links
from panostitch.matching import find_groups
from panostitch.model.match import Rejection, VerifiedMatch
from panostitch.model.photo import Photo
from panostitch.synthetic.render import ArraySource


def link(i, j, *, inliers=60, overlap=0.4):
    points = np.zeros((inliers, 2))
    return VerifiedMatch(i, j, points, points, np.eye(3), inliers + 10, overlap, 0.5, inliers + 20)


def asked(count, links):
    source = ArraySource(np.zeros((30, 40, 3), np.uint8))
    photos = [Photo(f"p{n}.jpg", (40, 30), source) for n in range(count)]
    return questions(photos, links, find_groups(count, links))


def test_nothing_is_asked_where_all_photos_are_well_linked():
    assert asked(3, [link(0, 1), link(1, 2), Rejection(0, 2, "no", 20, 6, 12)]) == []


def test_a_photo_alone_is_compared_with_its_best_partners_and_its_neighbours():
    refused = [Rejection(n, 9, "no", 20, inliers, 12) for n, inliers in enumerate((2, 7, 1, 9, 3, 0, 0, 0, 0))]
    links = [*(link(n, n + 1) for n in range(8)), *refused]

    assert asked(10, links) == [Question(9, (3, 1, 4, 8))]


def test_of_groups_apart_the_nearest_miss_is_explained():
    links = [link(0, 1), link(1, 2), link(3, 4), Rejection(2, 3, "no", 30, 9, 17), Rejection(0, 4, "no", 30, 4, 17)]

    assert asked(5, links) == [Question(3, (2,))]


@pytest.mark.parametrize("weak", [link(1, 2, overlap=0.03), link(1, 2, inliers=12)])
def test_a_weak_link_counts_where_nothing_else_holds(weak):
    assert weak_links(3, [link(0, 1), weak]) == [weak]
    assert weak_links(3, [link(0, 1), weak, link(0, 2)]) == []
    assert asked(3, [link(0, 1), weak]) == [Question(1, (2,), weak=True)]


def test_two_weak_links_back_each_other():
    assert weak_links(4, [link(0, 1), link(2, 3), link(0, 2, overlap=0.03), link(1, 3, overlap=0.03)]) == []


def test_a_large_heap_is_not_explained_for_ever():
    links = [Rejection(i, j, "no", 20, 5, 12) for i in range(40) for j in range(i + 1, 40)]

    assert len(asked(40, links)) == MOST_QUESTIONS
