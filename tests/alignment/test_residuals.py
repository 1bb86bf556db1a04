"""The analytic derivatives of the reprojection error against differences."""

from dataclasses import replace

import numpy as np
import pytest

from alignment.planted import common_points, link_of
from panostitch.alignment.residuals import in_a_row, linearise, reprojection, thinned
from panostitch.geometry import rotation
from panostitch.model.match import ControlPoints
from panostitch.synthetic.scene import rig
from tolerances import PIXEL

STEP = 1e-5  # rad, or share of the focal length, or units of k1 and k2
# px per unit of each parameter, where entries are up to 2000: the lens is inverted to 1e-13 focal lengths, which two
# such differences over 2e-5 make 1e-5 px; the third derivative adds less.
DIFFERENCES = 2e-4

LENSES = [(0.0, 0.0), (-0.12, 0.02), (0.08, 0.0), (0.05, -0.03), (-0.05, 0.08)]
COLUMNS = {"rotation_i": (0, 3), "rotation_j": (3, 6), "focal_i": (6, 7), "k1_i": (7, 8), "k2_i": (8, 9)}
COLUMNS |= {"focal_j": (9, 10), "k1_j": (10, 11), "k2_j": (11, 12)}


def planted(lens_i, lens_j, rng):
    """Two cameras, a little beside where they were, and what they saw."""
    first = rig([-0.2], [0.05], [0.1], size=(800, 600), focal=700, k1=lens_i[0], k2=lens_i[1])[0]
    second = rig([0.25], [-0.1], [-0.3], size=(700, 500), focal=650, k1=lens_j[0], k2=lens_j[1])[0]
    xy_i, xy_j = common_points(first, second, 30, rng)
    moved = replace(second, cam_from_world=rotation.exp(np.array([0.01, -0.02, 0.015])) @ second.cam_from_world)
    return [first, moved], in_a_row([ControlPoints(0, 1, xy_i, xy_j)])


def changed(cameras, column, step):
    """The cameras with one of the twelve parameters changed."""
    turn = column < 6
    n = column // 3 if turn else (column - 6) // 3
    k = column % 3
    camera = cameras[n]
    if turn:
        vector = np.zeros(3)
        vector[k] = step
        camera = replace(camera, cam_from_world=rotation.exp(vector) @ camera.cam_from_world)
    elif k == 0:
        camera = replace(camera, focal=camera.focal * (1 + step))
    elif k == 1:
        camera = replace(camera, k1=camera.k1 + step)
    else:
        camera = replace(camera, k2=camera.k2 + step)
    return [camera if m == n else other for m, other in enumerate(cameras)]


@pytest.mark.parametrize("parameter", COLUMNS)
@pytest.mark.parametrize("lens_i", LENSES)
@pytest.mark.parametrize("lens_j", LENSES[:3])
def test_derivatives_agree_with_differences(parameter, lens_i, lens_j, rng):
    cameras, matches = planted(lens_i, lens_j, rng)

    jacobian = linearise(cameras, matches).jacobian

    assert np.abs(jacobian).max() > 100
    for column in range(*COLUMNS[parameter]):
        ahead, behind = (reprojection(changed(cameras, column, step), matches) for step in (STEP, -STEP))
        np.testing.assert_allclose(jacobian[:, :, column], (ahead - behind) / (2 * STEP), rtol=0, atol=DIFFERENCES)


@pytest.mark.parametrize("lens", LENSES)
def test_values_are_the_reprojection(lens, rng):
    cameras, matches = planted(lens, LENSES[1], rng)

    value = reprojection(cameras, matches)

    np.testing.assert_allclose(linearise(cameras, matches).value, value, atol=PIXEL)
    by_camera = cameras[1].project(cameras[0].rays(matches.xy_i)) - matches.xy_j
    np.testing.assert_allclose(value, by_camera, atol=PIXEL)
    assert np.abs(value).max() > 1


def test_points_behind_the_camera_are_far_off_and_pull_nowhere(rng):
    cameras, matches = planted(LENSES[0], LENSES[0], rng)
    away = replace(cameras[1], cam_from_world=rotation.exp(np.array([0, np.pi, 0])) @ cameras[1].cam_from_world)

    residuals = linearise([cameras[0], away], matches)

    assert (residuals.value > 500).all()
    assert not residuals.jacobian.any()
    np.testing.assert_array_equal(reprojection([cameras[0], away], matches), residuals.value)


def test_swapped_is_the_same_pair_from_the_other_side(rng):
    xy_i, xy_j = rng.uniform(0, 500, (2, 20, 2))
    one = ControlPoints(2, 5, xy_i, xy_j)

    assert (one.swapped().i, one.swapped().j) == (5, 2)
    assert one.swapped().xy_i is xy_j
    back = one.swapped().swapped()
    assert (back.i, back.j) == (2, 5)
    assert back.xy_i is xy_i


def test_in_a_row_keeps_pairs_apart(rng):
    pairs = [ControlPoints(i, j, *rng.uniform(0, 9, (2, n, 2))) for i, j, n in ((0, 1, 3), (1, 2, 5), (0, 2, 2))]

    row = in_a_row(pairs)

    assert row.bounds.tolist() == [0, 3, 8, 10]
    assert row.i.tolist() == [0] * 3 + [1] * 5 + [0] * 2
    assert row.j.tolist() == [1] * 3 + [2] * 5 + [2] * 2
    np.testing.assert_array_equal(row.xy_i[3:8], pairs[1].xy_i)
    np.testing.assert_array_equal(row.xy_j[8:], pairs[2].xy_j)


@pytest.mark.parametrize("most", [1, 7, 40, 100])
def test_thinning_keeps_partners_and_takes_from_everywhere(most, rng):
    xy = rng.uniform(0, 500, (40, 2))
    link = link_of(0, 1, xy, xy + np.array([30, 10]))

    few = thinned(link, most)

    assert len(few.xy_i) == min(most, 40)
    np.testing.assert_allclose(few.xy_j - few.xy_i, np.tile((30.0, 10.0), (len(few.xy_i), 1)))
    assert len(np.unique(few.xy_i, axis=0)) == len(few.xy_i)
    if most > 1:
        assert (few.xy_i[[0, -1]] == xy[[0, -1]]).all()
