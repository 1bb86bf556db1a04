"""Agreement beyond chance: nothing in random matches, and what was planted among them."""

import numpy as np
import pytest

from panostitch.diagnosis.agreement import NO_CHANCE, epipolar, find_agreement, motions

SIZE = (480, 360)
SEEDS = 40
NOISE = 1.0  # px, of planted matches; the finest tolerance is 2.4 px
SAME = 0.02  # of the planted factor: two matches 100 px apart, each off by NOISE


def random_matches(rng, count):
    return rng.uniform(0, SIZE, (2, count, 2))


def planted(rng, count, *, factor=1.0, shift=(40.0, -20.0)):
    there = rng.uniform((60, 60), (300, 240), (count, 2))
    return there, there * factor + np.array(shift) + rng.normal(0, NOISE, (count, 2))


@pytest.mark.parametrize("count", [8, 40, 200])
def test_random_matches_agree_on_nothing(count, rng):
    found = [find_agreement(*random_matches(rng, count), SIZE) for _ in range(SEEDS)]

    assert not any(found)
    assert all(one.chance >= NO_CHANCE for one in found)


@pytest.mark.parametrize("factor", [1.0, 0.6, 1.7])
def test_a_few_true_matches_among_many_wrong_ones_are_found(factor, rng):
    (wrong_i, wrong_j), (true_i, true_j) = random_matches(rng, 40), planted(rng, 10, factor=factor)

    found = find_agreement(np.vstack([wrong_i, true_i]), np.vstack([wrong_j, true_j]), SIZE)

    assert found
    assert found.agree[40:].sum() >= 8  # the model goes through two of them, which are off themselves
    assert found.agree[:40].sum() <= 3
    assert found.j_from_i[0, 0] == pytest.approx(factor, abs=SAME * 3)


def test_one_match_given_many_times_is_one_match(rng):
    (there,), (here,) = planted(rng, 1)

    assert not find_agreement(np.tile(there, (50, 1)), np.tile(here, (50, 1)), SIZE)


@pytest.mark.parametrize("count", range(4))
def test_too_few_matches_agree_on_nothing(count, rng):
    found = find_agreement(*planted(rng, count), SIZE)

    assert not found
    assert found.agree.shape == (count,)


def test_things_that_move_by_themselves_are_counted_one_by_one(rng):
    groups = [planted(rng, 20, shift=shift) for shift in ((80, 10), (-50, 60), (10, -50))]
    xy_i, xy_j = (np.vstack([group[side] for group in groups]) for side in (0, 1))

    assert len(motions(xy_i, xy_j, SIZE)) == 3
    assert motions(*random_matches(rng, 60), SIZE) == []


def test_one_moving_camera_explains_every_depth(rng):
    there = rng.uniform(0, SIZE, (80, 2))
    here = there + np.column_stack([rng.uniform(-60, 60, 80), np.zeros(80)])

    assert epipolar(there, here, tolerance=2.0, seed=0) >= 76
    assert epipolar(*random_matches(rng, 80), tolerance=2.0, seed=0) < 40
    assert epipolar(there[:9], here[:9], tolerance=2.0, seed=0) == 0
