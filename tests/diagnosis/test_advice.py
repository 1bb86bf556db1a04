"""Advice to the photographer: silence where all is well, three lines at most."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from panostitch.diagnosis import advice
from panostitch.model.alignment import Alignment, LinkSummary
from panostitch.model.finding import Finding
from panostitch.model.light import GAMMA
from panostitch.model.photo import Photo
from panostitch.synthetic.render import ArraySource

PHOTOS = tuple(Photo(f"{n}.jpg", (40, 30), ArraySource(np.zeros((30, 40, 3), np.uint8))) for n in range(4))
LINKS = tuple(LinkSummary(n, n + 1, 50, 0.3) for n in range(3))
GOOD = Alignment("rotation", PHOTOS, (), LINKS, (), 0.3, 0.6)


def lit(*ev):
    """What is asked of a panorama whose photos were exposed like this, in EV."""
    gains = 2.0 ** (-np.array(ev) / GAMMA)
    return SimpleNamespace(plan=SimpleNamespace(light=SimpleNamespace(brightness=gains)))


def narrow(first, second):
    return Finding(first, second, "too little overlap", "3 %", "take one more", weak=True)


def soft(name):
    return Finding(name, "0.jpg", "blur", "soft", "take it again", culprit=name)


@pytest.mark.parametrize("panorama", [None, lit(0, 0, 0, 0), lit(0, 0.6, -0.6, 0.9)])
def test_nothing_is_said_where_all_is_well(panorama):
    assert advice(GOOD, panorama) == []


def test_where_a_photo_is_missing_and_which_are_soft():
    found = replace(GOOD, findings=(narrow("2.jpg", "1.jpg"), soft("0.jpg"), soft("3.jpg")))

    assert advice(found) == [
        "0.jpg and 3.jpg are soft: hold still, focus once and lock it",
        "take one more photo between 1.jpg and 2.jpg",
    ]


def test_the_largest_jump_of_the_exposure():
    assert advice(GOOD, lit(0, 0.5, -2.0, -2.2)) == ["exposure jumps by 2.5 EV between 1.jpg and 2.jpg: lock it"]


def test_photos_that_do_not_follow_each_other_may_differ():
    assert advice(replace(GOOD, links=(LinkSummary(0, 3, 50, 0.3),)), lit(0, 1, 2, 3)) == []


def test_three_lines_at_most_and_each_once():
    pairs = [("0.jpg", "1.jpg"), ("1.jpg", "0.jpg"), ("1.jpg", "2.jpg"), ("2.jpg", "3.jpg"), ("0.jpg", "3.jpg")]

    said = advice(replace(GOOD, findings=tuple(narrow(*pair) for pair in pairs)))

    assert len(said) == 3 == len(set(said))
