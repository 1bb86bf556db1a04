"""The analytic derivatives of the reprojection error against differences."""

from dataclasses import replace

import numpy as np
import pytest

from alignment.planted import common_points, link_of
from panostitch.alignment.residuals import (
    BEHIND,
    arrays_of,
    by_lens,
    by_turn,
    cameras_of,
    in_a_row,
    tangent,
    thinned,
    view,
)
from panostitch.geometry import rotation
from panostitch.model.match import ControlPoints
from panostitch.synthetic.scene import rig
from tolerances import PIXEL

STEP = 1e-5  # rad, or share of the focal length, or units of k1 and k2
# px per unit of each parameter, where entries are up to 2000: the lens is inverted to 1e-13 focal lengths, which two
# such differences over 2e-5 make 1e-5 px; the third derivative adds less.
DIFFERENCES = 2e-4

LENSES = [(0.0, 0.0), (-0.12, 0.02), (0.08, 0.0), (0.05, -0.03), (-0.05, 0.08)]
PARAMETERS = ("focal", "k1", "k2", "x", "y")  # the order of the columns of a lens


def planted(lens_i, lens_j, rng):
    """Two cameras, a little beside where they were, and what they saw."""
    first = rig([-0.2], [0.05], [0.1], size=(800, 600), focal=700, k1=lens_i[0], k2=lens_i[1])[0]
    second = rig([0.25], [-0.1], [-0.3], size=(700, 500), focal=650, k1=lens_j[0], k2=lens_j[1])[0]
    xy_i, xy_j = common_points(first, second, 30, rng)
    moved = replace(second, cam_from_world=rotation.exp(np.array([0.01, -0.02, 0.015])) @ second.cam_from_world)
    return [first, moved], in_a_row([ControlPoints(0, 1, xy_i, xy_j)])


def residuals(cameras, matches):
    return view(arrays_of(cameras), matches).value


def changed(camera, parameter, step):
    if parameter == "focal":
        return replace(camera, focal=camera.focal * (1 + step))
    if parameter in "xy":
        return replace(camera, centre=tuple(np.add(camera.centre, [step, 0] if parameter == "x" else [0, step])))
    return replace(camera, **{parameter: getattr(camera, parameter) + step})


def difference(cameras, matches, n, change):
    """Residuals (2, m) by a change of camera n."""
    ahead, behind = (
        residuals([change(c, step) if m == n else c for m, c in enumerate(cameras)], matches) for step in (STEP, -STEP)
    )
    return (ahead - behind) / (2 * STEP)


@pytest.mark.parametrize("number", [0, 1])
@pytest.mark.parametrize("parameter", PARAMETERS)
@pytest.mark.parametrize("lens_i", LENSES)
@pytest.mark.parametrize("lens_j", LENSES[:3])
def test_derivatives_by_the_lens_agree_with_differences(number, parameter, lens_i, lens_j, rng):
    cameras, matches = planted(lens_i, lens_j, rng)
    seen = view(arrays_of(cameras), matches)

    jacobian = by_lens(seen, tangent(seen), terms=2, centres=True)[number]

    expected = difference(cameras, matches, number, lambda camera, step: changed(camera, parameter, step))
    np.testing.assert_allclose(jacobian[:, PARAMETERS.index(parameter)], expected, rtol=0, atol=DIFFERENCES)
    assert np.abs(jacobian).max() > 100


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("lens", LENSES)
def test_derivatives_by_the_turn_agree_with_differences(axis, lens, rng):
    cameras, matches = planted(LENSES[1], lens, rng)
    seen = view(arrays_of(cameras), matches)

    jacobian = by_turn(seen, tangent(seen))

    def turn(camera, step):
        return replace(camera, cam_from_world=rotation.exp(step * np.eye(3)[axis]) @ camera.cam_from_world)

    expected = difference(cameras, matches, 1, turn)
    np.testing.assert_allclose(jacobian[:, axis], expected, rtol=0, atol=DIFFERENCES)
    assert np.abs(jacobian).max() > 100


@pytest.mark.parametrize("lens_i", LENSES)
def test_derivatives_by_the_point_agree_with_differences(lens_i, rng):
    cameras, matches = planted(lens_i, LENSES[1], rng)
    arrays = arrays_of(cameras)
    seen = view(arrays, matches)

    jacobian = tangent(seen).by_point

    for axis in range(2):
        shift = STEP * np.eye(2)[axis][:, None]
        ahead, behind = (view(arrays, replace(matches, xy_i=matches.xy_i + s)).value for s in (shift, -shift))
        np.testing.assert_allclose(jacobian[:, axis], (ahead - behind) / (2 * STEP), rtol=0, atol=DIFFERENCES)


@pytest.mark.parametrize("lens", LENSES)
def test_values_are_the_reprojection(lens, rng):
    cameras, matches = planted(lens, LENSES[1], rng)

    value = residuals(cameras, matches)

    by_camera = cameras[1].project(cameras[0].rays(matches.xy_i.T)) - matches.xy_j.T
    np.testing.assert_allclose(value.T, by_camera, atol=PIXEL)
    assert np.abs(value).max() > 1


def test_points_behind_the_camera_are_far_off_and_pull_nowhere(rng):
    cameras, matches = planted(LENSES[0], LENSES[0], rng)
    away = replace(cameras[1], cam_from_world=rotation.exp(np.array([0, np.pi, 0])) @ cameras[1].cam_from_world)

    seen = view(arrays_of([cameras[0], away]), matches)
    slopes = tangent(seen)

    assert (seen.value == BEHIND).all()
    assert not by_turn(seen, slopes).any()
    for jacobian in by_lens(seen, slopes, terms=2, centres=True):
        assert not jacobian.any()


def test_cameras_become_arrays_and_come_back(rng):
    cameras, _ = planted(LENSES[1], LENSES[2], rng)

    back = cameras_of(arrays_of(cameras), cameras)

    for camera, same in zip(cameras, back, strict=True):
        np.testing.assert_array_equal(camera.cam_from_world, same.cam_from_world)
        assert replace(camera, cam_from_world=None) == replace(same, cam_from_world=None)


def test_swapped_is_the_same_pair_from_the_other_side(rng):
    xy_i, xy_j = rng.uniform(0, 500, (2, 20, 2))
    one = ControlPoints(2, 5, xy_i, xy_j)

    assert (one.swapped().i, one.swapped().j) == (5, 2)
    assert one.swapped().xy_i is xy_j
    back = one.swapped().swapped()
    assert (back.i, back.j) == (2, 5)
    assert back.xy_i is xy_i


def test_in_a_row_keeps_pairs_apart_and_passes_over_empty_ones(rng):
    pairs = [
        ControlPoints(i, j, *rng.uniform(0, 9, (2, n, 2))) for i, j, n in ((0, 1, 3), (1, 3, 0), (1, 2, 5), (0, 2, 2))
    ]

    row = in_a_row(pairs)

    assert row.bounds.tolist() == [0, 3, 8, 10]
    assert row.i.tolist() == [0] * 3 + [1] * 5 + [0] * 2
    assert row.j.tolist() == [1] * 3 + [2] * 5 + [2] * 2
    np.testing.assert_array_equal(row.xy_i[:, 3:8].T, pairs[2].xy_i)
    np.testing.assert_array_equal(row.xy_j[:, 8:].T, pairs[3].xy_j)


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
