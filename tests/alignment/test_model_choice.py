"""The model is chosen by the evidence; the choice says by how much, and what else was near."""

import numpy as np
import pytest

from alignment.planted import common_points
from panostitch.alignment.model_choice import (
    FLAT,
    MANY,
    NOTICEABLE,
    Candidate,
    candidate,
    choose,
    flat_parameters,
    flat_to_try,
)
from panostitch.model.match import ControlPoints
from panostitch.synthetic.scene import rig


def candidates(rotation=None, similarity=None, affine=None, homography=None, *, photos=2, matches=200):
    errors = {"rotation": rotation, "similarity": similarity, "affine": affine, "homography": homography}
    return [
        Candidate(model, error, flat_parameters(model, photos) if model in FLAT else 3 * photos - 2, matches)
        for model, error in errors.items()
        if error is not None
    ]


# errors in working px of rotation, similarity, affine, homography; most are those of real photos
CASES = {
    "a turn": ((0.97, 7.2, 7.0, 0.67), "rotation"),
    "a turn, homography a little better": ((1.68, 9.6, 9.3, 0.89), "rotation"),
    "a turn with a long lens": ((0.87, 1.35, 1.22, 0.73), "rotation"),
    "a turn that fits, homography far better": ((0.49, 2.5, 2.5, 0.1), "rotation"),
    "a turn around, no plane": ((2.1, 37.0, 31.0, 4.9), "rotation"),
    "a wall, the camera moved": ((1.97, 9.8, 8.2, 0.68), "homography"),
    "scans": ((0.66, 0.67, 0.62, 0.59), "similarity"),
    "crumpled scans": ((1.81, 2.0, 1.62, 1.32), "affine"),
    "a screen shot": ((0.31, 0.24, 0.24, 0.24), "similarity"),
    "no error at all": ((1e-12, 3.0, 2.0, 1e-12), "rotation"),
    "scans without error": ((1e-3, 1e-12, 1e-12, 1e-12), "similarity"),
}


@pytest.mark.parametrize("pixel_size", [1.0, 3.5])
@pytest.mark.parametrize("case", CASES)
def test_the_model_that_the_errors_speak_for(case, pixel_size):
    errors, model = CASES[case]

    assert choose(candidates(*(pixel_size * e for e in errors)), pixel_size=pixel_size).model == model


def test_a_choice_says_by_how_much_and_what_else_was_near():
    choice = choose(candidates(1.97, 9.8, 8.2, 0.68), pixel_size=1.0)

    assert (choice.model, choice.runner_up) == ("homography", "rotation")
    assert choice.margin == pytest.approx(1.97 / 0.68, rel=0.02)
    assert choice.reason == (
        "a flat subject explains the key points clearly better "
        "(homography 0.68 px, rotation 1.97 px, affine 8.20 px, similarity 9.80 px)"
    )


def test_the_rule_may_be_taken_though_another_is_better():
    choice = choose(candidates(1.68, 9.6, 9.3, 0.89), pixel_size=1.0)

    assert (choice.model, choice.runner_up) == ("rotation", "homography")
    assert choice.margin < 1


def test_one_candidate_is_taken():
    for given in ({"rotation": 5.0}, {"homography": 5.0}):
        choice = choose(candidates(**given), pixel_size=1.0)
        assert (choice.model, choice.runner_up, choice.margin) == (*given, None, np.inf)
        assert "5.00 px" in choice.reason
    with pytest.raises(ValueError, match="no candidates"):
        choose([], pixel_size=1.0)


def test_unknowns_count_where_matches_are_few():
    # 8 of 12 numbers fitted: the homography's 0.7 px are 1.2 px of noise
    assert choose(candidates(1.5, 9.0, 9.0, 0.7, matches=200), pixel_size=1.0).model == "homography"
    assert choose(candidates(1.5, 9.0, 9.0, 0.7, matches=6), pixel_size=1.0).model == "rotation"
    assert Candidate("homography", 0.5, 8, 4).noise == np.inf


@pytest.mark.parametrize(
    ("error", "photos", "field", "tried"),
    [
        (0.5, 3, 60.0, ()),
        (0.5, 3, 12.0, FLAT),
        (0.5, 3, 160.0, FLAT),
        (0.5, MANY + 1, 12.0, ()),
        (1.5 * NOTICEABLE, 3, 60.0, FLAT),
        (1.5 * NOTICEABLE, MANY + 1, 60.0, FLAT),
    ],
)
def test_flat_models_are_tried_where_they_could_be_chosen(error, photos, field, tried):
    cameras = rig(np.zeros(photos), size=(800, 600), hfov=np.deg2rad(field))

    assert flat_to_try(Candidate("rotation", error, 3 * photos, 1000), cameras, pixel_size=1.0) == tried


def test_flat_models_are_tried_where_nothing_turns():
    assert flat_to_try(None, [], pixel_size=1.0) == FLAT


@pytest.mark.parametrize("share", [0.0, 0.1])
def test_the_error_of_a_candidate_is_that_of_most_matches(share, rng):
    cameras = rig([0.0, 0.3], size=(800, 600), hfov=np.deg2rad(55))
    xy_i, xy_j = common_points(*cameras, 400, rng)
    wrong = rng.random(400) < share
    noisy = xy_j + rng.normal(0, 0.5, xy_j.shape) + wrong[:, None] * 200.0

    found = candidate("rotation", cameras, [ControlPoints(0, 1, xy_i, noisy)], 4, scale=2.0)

    assert (found.model, found.parameters, found.observations) == ("rotation", 4, 400)
    # 0.5 px in each of two coordinates of one photo; a tenth at 280 px would make 90 px of a plain root mean square
    assert 0.6 < found.error < (4.0 if share else 0.8)
