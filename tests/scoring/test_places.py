"""The rule itself, on a picture and photos that lie where they belong: planted defects raise what they should."""

import numpy as np
import pytest

from panostitch.model.canvas import Layer, Region
from panostitch.scoring.places import MARGIN, REACH, judge_tile
from panostitch.scoring.summary import summary
from scoring.planted import LINE, blurred, cut, ghost, perfect, tinted

SHIFTS = (0.5, 1.0, 2.0, 4.0, 8.0)  # px
LITTLE_SHIFT = 0.1  # px, 95 %, of a perfect picture; observed 0.03
NOISY_SHIFT = 0.3  # px, 95 %, where picture and photos have noise of their own; observed 0.15
LITTLE = 0.1  # of a perfect picture's total; observed 0.04
SHIFT_ERROR = 0.3  # px: patches that the line cuts see a mixture; observed 0.1
GAINS = (1.0, 0.8)  # of the light of the two photos


@pytest.fixture(scope="module")
def picture():
    return perfect()


def layer(pixels, mask=None):
    height, width = pixels.shape[:2]
    mask = np.ones((height, width), bool) if mask is None else mask
    return Layer(Region(0, 0, width, height), np.ascontiguousarray(pixels, np.float32), mask)


@pytest.fixture(scope="module")
def photos(picture):
    """Two photos of all that the picture shows, each with its own light and its own noise."""
    rng = np.random.default_rng(5)
    return [layer(np.clip(picture * gain + rng.normal(0, 1, picture.shape), 0, 255)) for gain in GAINS]


def scored(picture, photos):
    return summary(judge_tile(layer(picture), photos))


def test_a_perfect_picture_has_hardly_any_faults(picture, photos):
    score = scored(picture, photos)
    assert score.places > 300
    assert score.displacement_p95 < LITTLE_SHIFT
    assert score.total < LITTLE


def test_a_picture_of_the_same_pixels_has_none(picture):
    score = scored(picture, [layer(picture), layer(picture)])
    assert score.total < 1e-3  # correlation in single precision


@pytest.mark.parametrize(
    ("plant", "sizes", "measure"),
    [
        (cut, SHIFTS, "structure"),
        (ghost, SHIFTS, "structure"),
        (blurred, (0.5, 1.0, 2.0), "blur"),
        (tinted, (0.02, 0.05, 0.1, 0.2), "colour"),
    ],
)
def test_larger_defects_score_higher(picture, photos, plant, sizes, measure):
    scores = [scored(picture, photos), *(scored(plant(picture, size), photos) for size in sizes)]
    totals = [score.total for score in scores]
    measured = [getattr(score, measure) for score in scores]
    assert totals == sorted(totals)
    assert measured == sorted(measured)
    assert measured[-1] > 3 * max(measured[0], 0.01)


@pytest.mark.parametrize("px", SHIFTS)
def test_a_planted_shift_is_measured_along_its_line(picture, photos, px):
    places = judge_tile(layer(cut(picture, px)), photos)
    on_line = places.xy[:, 0] == LINE
    assert np.nanmedian(places.displacement[on_line]) == pytest.approx(px, abs=SHIFT_ERROR)
    far = np.abs(places.xy[:, 0] - LINE) > MARGIN
    assert np.nanquantile(places.displacement[far], 0.95) < NOISY_SHIFT


def test_two_copies_are_a_ghost_and_a_cut_is_less_of_one(picture, photos):
    assert scored(ghost(picture, 8), photos).ghost > 2 * scored(cut(picture, 8), photos).ghost > 0


def test_the_worst_places_lie_where_the_defect_is(picture, photos):
    for plant, size in ((cut, 4.0), (tinted, 0.2)):
        worst = scored(plant(picture, size), photos).worst
        assert len(worst) > 1
        assert abs(worst[0].x - LINE) <= REACH
        assert worst[0].fault >= worst[1].fault


def test_what_has_no_texture_says_nothing_of_displacement():
    plain = np.full((200, 200, 3), 120, np.uint8)
    places = judge_tile(layer(plain), [layer(plain), layer(plain)])
    assert len(places)
    assert np.isnan(places.displacement).all()
    assert (places.colour == 0).all()


def test_an_edge_says_nothing_of_displacement_but_its_break_is_seen():
    edge = np.full((200, 200, 3), 60, np.uint8)
    edge[100:] = 160
    broken = edge.copy()
    broken[96:, 100:] = 160
    whole, split = (judge_tile(layer(p), [layer(edge), layer(edge)]) for p in (edge, broken))
    assert np.isnan(whole.displacement).all()
    assert np.nanmax(whole.structure) == 0
    assert np.nanmax(split.structure) > 10  # grey levels, of an edge of 100


def test_what_one_photo_alone_shows_has_no_faults(picture, photos):
    left = np.zeros(picture.shape[:2], bool)
    left[:, :LINE] = True
    places = judge_tile(layer(cut(picture, 4.0)), [photos[0], layer(photos[1].pixels, left)])
    alone = places.xy[:, 0] > LINE + MARGIN
    assert alone.any()
    assert not places.fault[alone].any()
    assert places.fault[~alone].any()


def test_nobody_judges_by_one_photo_that_shows_something_else(picture):
    nothing = layer(picture, np.zeros(picture.shape[:2], bool))
    stranger = layer(np.roll(picture, 150, axis=1))
    fitting, other = (judge_tile(layer(picture), [photo, nothing]) for photo in (layer(picture), stranger))
    assert len(other) < len(fitting)
    assert not other.fault.any()


def test_a_seam_between_photos_that_agree_is_perfect(photos):
    """Each half as another photo has it: nothing is displaced, and no structure breaks."""
    joined = np.hstack([photos[0].pixels[:, :LINE], photos[1].pixels[:, LINE:] / GAINS[1]])
    assert scored(joined, photos).total < 2 * LITTLE
