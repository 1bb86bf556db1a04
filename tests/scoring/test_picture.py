"""The judge of finished pictures, which has to find by itself where the photos lie in them."""

import cv2
import numpy as np
import pytest

from panostitch.model.photo import Photo
from panostitch.scoring import judge, summary
from panostitch.scoring.register import register
from panostitch.synthetic.render import ArraySource
from scoring.planted import CAMERAS, LINE, WIDE, cut, ghost, perfect, photos, tinted

MAP_ERROR = 0.5  # px, 95 %, of where a photo is found in the picture; observed 0.2
LITTLE = 0.35  # of a perfect picture's total; observed 0.2
ENLARGED = 1.5  # times
PLANTED = 4.0  # px


@pytest.fixture(scope="module")
def given():
    return photos()


@pytest.fixture(scope="module")
def flawless(given):
    return summary(judge(perfect(), given))


def test_photos_are_found_where_they_are(given):
    maps = register(perfect(), given)
    assert [n for n, _ in maps] == [0, 1]
    x, y = np.meshgrid(np.arange(40, 490, 20.0), np.arange(40, 160, 20.0))
    xy = np.column_stack([x.ravel(), y.ravel()])
    for n, known in maps:
        true = CAMERAS[n].project(WIDE.rays(xy))
        inside = ((true > 20) & (true < np.array(CAMERAS[n].size) - 20)).all(1)
        assert np.quantile(np.hypot(*(known(xy) - true)[inside].T), 0.95) < MAP_ERROR


def test_a_perfect_picture_scores_near_zero(flawless):
    assert flawless.places > 100
    assert flawless.known > 0.3
    assert flawless.total < LITTLE


@pytest.mark.parametrize(
    ("plant", "sizes"),
    [(cut, (1.0, 8.0)), (ghost, (8.0,)), (tinted, (0.2,))],
    ids=["cut", "ghost", "tint"],
)
def test_larger_defects_score_higher(given, flawless, plant, sizes):
    totals = [flawless.total, *(summary(judge(plant(perfect(), size), given)).total for size in sizes)]
    assert totals == sorted(totals)
    assert totals[-1] > 2 * totals[0]


def test_px_are_those_of_the_photos_and_places_those_of_the_picture(given):
    flawed = cut(perfect(), PLANTED)
    size = round(flawed.shape[1] * ENLARGED), round(flawed.shape[0] * ENLARGED)
    places = judge(cv2.resize(flawed, size, interpolation=cv2.INTER_CUBIC), given)
    on_line = np.abs(places.xy[:, 0] - LINE * ENLARGED) < 12
    # some of the shift goes into the maps: most of what a photo shows lies on one side of the line
    assert 0.6 * PLANTED < np.nanmedian(places.displacement[on_line]) < 1.1 * PLANTED


def test_strangers_say_nothing():
    noise = [np.random.default_rng(n).integers(0, 255, (200, 300, 3), np.uint8) for n in range(3)]
    strangers = [Photo(f"p{n}", (300, 200), ArraySource(pixels)) for n, pixels in enumerate(noise[1:])]
    score = summary(judge(noise[0], strangers))
    assert score.places == 0
    assert score.total is None
    assert score.worst == ()
