"""What became of every photo, and how much of the panorama shows it."""

from types import SimpleNamespace

import numpy as np
import pytest

from panostitch.model.alignment import UNREADABLE, Alignment, LeftOut, PairTried
from panostitch.model.canvas import Canvas, Region
from panostitch.model.inclusion import inclusion
from panostitch.model.photo import Photo
from panostitch.synthetic.render import ArraySource

FACTOR = 4
LABELS = np.full((10, 20), -1, np.int16)
LABELS[:, :10], LABELS[:, 10:17], LABELS[0, 16] = 0, 1, 2


def alignment(count=4):
    source = ArraySource(np.zeros((30, 40, 3), np.uint8))
    photos = tuple(Photo(f"{n}.jpg", (40, 30), source) for n in range(count))
    left_out = (LeftOut("9.jpg", "not a picture", cause=UNREADABLE), LeftOut("10.jpg", "alone", cause="blur"))
    pairs = (
        PairTried("0.jpg", "1.jpg", 9, 9, 40, 30, 0, 0.4, 0.2, ""),
        PairTried("1.jpg", "10.jpg", 9, 9, 8, 3, 9, 0, 0, "few"),
    )
    return Alignment("rotation", photos, (), (), left_out, 0.3, 0.6, pairs=pairs)


def panorama(crop, *, wraps=False):
    canvas = Canvas("equirectangular", 100.0, (0.0, 0.0), (80, 40), wraps=wraps)
    return SimpleNamespace(canvas=canvas, plan=SimpleNamespace(labels=LABELS, crop=crop, factor=FACTOR))


def test_every_photo_has_a_row_in_natural_order_with_its_state():
    rows = inclusion(alignment(), panorama(Region(0, 0, 80, 40)))

    assert [(row.name, row.state) for row in rows] == [
        ("0.jpg", "used"),
        ("1.jpg", "used"),
        ("2.jpg", "partly hidden"),
        ("3.jpg", "hidden"),
        ("9.jpg", "unreadable"),
        ("10.jpg", "left out"),
    ]
    assert [row.included for row in rows] == [True] * 4 + [False] * 2
    assert (rows[4].reason, rows[4].cause) == ("not a picture", "")
    assert (rows[5].reason, rows[5].cause, rows[5].partner, rows[5].inliers) == ("alone", "blur", "1.jpg", 3)
    assert (rows[1].partner, rows[3].partner) == ("0.jpg", None)


def test_shares_are_of_the_pixels_that_photos_cover_and_add_up():
    shares = [row.share for row in inclusion(alignment(), panorama(Region(0, 0, 80, 40)))]

    assert shares[:4] == pytest.approx([100 / 170, 69 / 170, 1 / 170, 0])
    assert sum(shares) == pytest.approx(1)


def test_what_is_cropped_away_does_not_count():
    rows = inclusion(alignment(2), panorama(Region(0, 4, 40, 36)))

    assert [(row.state, row.share) for row in rows[:2]] == [("used", 1.0), ("hidden", 0.0)]


def test_a_crop_may_go_across_the_edge_of_a_full_turn():
    rows = inclusion(alignment(2), panorama(Region(60, 4, 40, 36), wraps=True))

    assert [row.share for row in rows[:2]] == pytest.approx([5 / 7, 2 / 7])


def test_without_a_panorama_there_are_no_shares():
    assert {row.share for row in inclusion(alignment())} == {None}
    assert {row.state for row in inclusion(alignment())} == {"used", "unreadable", "left out"}
