"""The metric must tell right from wrong, and say by how many pixels."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from panostitch.geometry.rotation import exp, from_angles
from panostitch.synthetic.scene import FLAT_PLANS, PLANS, rig
from panostitch.synthetic.score import pair_errors, score

ZERO = 1e-6  # px: float64 through two cameras, one of them solved by Newton's method
SMALL_ANGLE = 0.03  # relative: a turn moves a point by focal * angle to first order, by more towards the edges


def turned(camera, vector):
    """The camera, wrongly turned by a rotation vector (radians) in its own axes."""
    return replace(camera, cam_from_world=exp(np.array(vector, float)) @ camera.cam_from_world)


@pytest.fixture
def long_lens():
    """Two photos through a long lens, where angles are small and an error has one size all over."""
    return rig([-0.05, 0.05], size=(800, 600), focal=4000)


@pytest.mark.parametrize("name", PLANS)
def test_a_common_turn_is_no_error(name):
    cameras = PLANS[name]()
    turn = np.diag([1.1, 0.9, 1.0]) if name in FLAT_PLANS else from_angles(0.7, -0.4, 1.9)
    result = score(cameras, [camera.turned(turn) for camera in cameras])
    assert result.worst < ZERO
    assert result.pairs >= len(cameras) - 1
    assert result.missing == ()


@pytest.mark.parametrize("pixels", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_turn_of_one_camera_counts_in_pixels(long_lens, pixels, which, axis):
    wrong = list(long_lens)
    vector = np.zeros(3)
    vector[axis] = pixels / 4000
    wrong[which] = turned(wrong[which], vector)
    result = score(long_lens, wrong)
    assert result.rms == pytest.approx(pixels, rel=SMALL_ANGLE)
    assert result.rms <= result.p95 * (1 + SMALL_ANGLE)
    assert result.p95 <= result.worst


def test_a_common_focal_error_counts_in_pixels(long_lens):
    wrong = [replace(camera, focal=camera.focal * 1.01) for camera in long_lens]
    # sent through the angle between the photos, 400 px at this focal length, which is now 1 % longer
    along_x = 0.01 * 400
    assert score(long_lens, wrong).rms == pytest.approx(along_x, rel=SMALL_ANGLE)


def test_damage_to_one_side_is_seen_from_both(long_lens):
    for which in (0, 1):
        wrong = list(long_lens)
        wrong[which] = replace(wrong[which], focal=wrong[which].focal * 1.01)
        there, back = (pair_errors((long_lens[i], long_lens[1 - i]), (wrong[i], wrong[1 - i])) for i in (0, 1))
        for errors in (there, back):
            # 1 % of the distance to the centre of the damaged photo, which is 0 to 500 px here
            assert 1.0 < np.sqrt((errors**2).mean()) < 5.0


@pytest.mark.parametrize("damage", ["turn", "roll", "focal", "k1"])
def test_more_damage_is_more_error(damage):
    true = PLANS["row"]()
    results = []
    for size in (0.0, 0.0005, 0.002, 0.01):
        wrong = list(true)
        wrong[2] = {
            "turn": lambda c, s: turned(c, (0, s, 0)),
            "roll": lambda c, s: turned(c, (0, 0, s)),
            "focal": lambda c, s: replace(c, focal=c.focal * (1 + s)),
            "k1": lambda c, s: replace(c, k1=c.k1 + s),
        }[damage](wrong[2], size)
        results.append(score(true, wrong))
    for lesser, greater in pairwise(results):
        assert lesser.rms < greater.rms
        assert lesser.worst < greater.worst
    assert results[0].worst < ZERO


def test_a_missing_photo_is_named_and_its_pairs_are_not_counted():
    true = PLANS["row"]()
    estimated = [None if i == 5 else camera for i, camera in enumerate(true)]
    result = score(true, estimated)
    assert result.missing == (5,)
    assert result.pairs == score(true, true).pairs - 1
    assert result.worst < ZERO


def test_nothing_to_judge_is_not_a_good_score():
    true = PLANS["pair"]()
    result = score(true, [None, None])
    assert result.pairs == 0
    assert result.rms == np.inf


def test_a_camera_that_looks_away_is_infinitely_wrong():
    true = PLANS["pair"]()
    assert score(true, [true[0], turned(true[1], (0, np.pi, 0))]).worst == np.inf


def test_only_common_points_count():
    apart = rig([0.0, np.pi], size=(80, 60), focal=80)
    assert len(pair_errors((apart[0], apart[1]), (apart[0], apart[1]))) == 0
    half = rig([0.0, np.arctan(0.5)], size=(80, 60), focal=80)
    points = pair_errors((half[0], half[1]), (half[0], half[1]), grid=(10, 10))
    assert 35 <= len(points) <= 60


def test_cameras_of_other_photos_are_refused():
    true = PLANS["pair"]()
    with pytest.raises(ValueError, match="different photos"):
        score(true, [camera.scaled((400, 300)) for camera in true])
    with pytest.raises(ValueError, match="2 true cameras but 1"):
        score(true, true[:1])
