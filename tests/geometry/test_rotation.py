"""Exponential and logarithm map, nearest rotation, turns of a camera."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from panostitch.geometry import rotation
from tolerances import UNIT

RANDOM_ROTATIONS = 200

# Angles (radians) that are hard: none at all, so small that squares vanish, close to half a turn.
ANGLES = [0.0, 1e-300, 1e-12, 1e-8, 1e-4, 0.5, np.pi / 2, 2.0, 3.0, np.pi - 1e-4, np.pi - 1e-8, np.pi - 1e-12]

AXES = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (1, 1, 1), (-1, 2, 0.5), (1e-9, 1, 0)]

# radians; turns by which the camera is told to move
TURN = 0.3


def unit(axis):
    return np.array(axis, float) / np.linalg.norm(axis)


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("angle", ANGLES)
def test_log_undoes_exp(axis, angle):
    vector = unit(axis) * angle

    np.testing.assert_allclose(rotation.log(rotation.exp(vector)), vector, rtol=0, atol=UNIT)


@pytest.mark.parametrize("axis", AXES)
def test_half_a_turn_comes_back_up_to_the_sign_of_its_axis(axis):
    vector = unit(axis) * np.pi

    found = rotation.log(rotation.exp(vector))

    assert min(np.abs(found - vector).max(), np.abs(found + vector).max()) < UNIT


def test_exp_undoes_log(rng):
    for vector in rng.normal(0, 2, (RANDOM_ROTATIONS, 3)):
        matrix = rotation.exp(vector)
        np.testing.assert_allclose(rotation.exp(rotation.log(matrix)), matrix, rtol=0, atol=UNIT)


def test_exp_agrees_with_scipy(rng):
    for vector in rng.normal(0, 2, (RANDOM_ROTATIONS, 3)):
        np.testing.assert_allclose(rotation.exp(vector), Rotation.from_rotvec(vector).as_matrix(), rtol=0, atol=UNIT)


def test_log_agrees_with_scipy(rng):
    for matrix in Rotation.random(RANDOM_ROTATIONS, rng).as_matrix():
        np.testing.assert_allclose(rotation.log(matrix), Rotation.from_matrix(matrix).as_rotvec(), rtol=0, atol=UNIT)


def test_angle_is_the_length_of_the_vector():
    assert rotation.angle(rotation.exp(unit((1, -2, 3)) * TURN)) == pytest.approx(TURN, abs=UNIT)
    # more than half a turn is the rest of it the other way
    assert rotation.angle(rotation.exp(unit((1, -2, 3)) * (2 * np.pi - TURN))) == pytest.approx(TURN, abs=UNIT)


def test_cross_matrix_multiplies_like_the_cross_product(rng):
    a, b = rng.normal(size=(2, 7, 3))

    products = np.einsum("nij,nj->ni", rotation.cross_matrix(a), b)

    np.testing.assert_allclose(products, np.cross(a, b), rtol=0, atol=UNIT)


def test_nearest_leaves_a_rotation_alone(rng):
    for matrix in Rotation.random(RANDOM_ROTATIONS, rng).as_matrix():
        np.testing.assert_allclose(rotation.nearest(matrix), matrix, rtol=0, atol=UNIT)


def test_nearest_is_a_rotation_and_none_is_nearer(rng):
    for _ in range(RANDOM_ROTATIONS):
        matrix = rng.normal(size=(3, 3))
        found = rotation.nearest(matrix)
        np.testing.assert_allclose(found @ found.T, np.eye(3), rtol=0, atol=UNIT)
        assert np.linalg.det(found) > 0
        others = Rotation.from_rotvec(rng.normal(0, 0.3, (20, 3))).as_matrix() @ found
        assert np.linalg.norm(matrix - found) < np.linalg.norm(matrix - others, axis=(1, 2)).min()


def test_nearest_to_a_scaled_rotation_is_the_rotation():
    matrix = rotation.exp(np.array([0.2, -0.4, 1.0]))

    np.testing.assert_allclose(rotation.nearest(7 * matrix), matrix, rtol=0, atol=UNIT)


@pytest.mark.parametrize(
    ("angles", "axis_of_camera", "seen_in_world"),
    [
        ((TURN, 0, 0), (0, 0, 1), (np.sin(TURN), 0, np.cos(TURN))),  # yaw: looks to the right
        ((0, TURN, 0), (0, 0, 1), (0, -np.sin(TURN), np.cos(TURN))),  # pitch: looks up
        ((0, 0, TURN), (0, 0, 1), (0, 0, 1)),  # roll: looks where it did,
        ((0, 0, TURN), (1, 0, 0), (np.cos(TURN), np.sin(TURN), 0)),  # with its right side lower
        ((np.pi / 2, TURN, 0), (0, 0, 1), (np.cos(TURN), -np.sin(TURN), 0)),  # first right, then up
    ],
)
def test_from_angles_turns_right_up_and_clockwise(angles, axis_of_camera, seen_in_world):
    cam_from_world = rotation.from_angles(*angles)

    np.testing.assert_allclose(cam_from_world.T @ np.array(axis_of_camera, float), seen_in_world, rtol=0, atol=UNIT)


def test_from_angles_of_nothing_is_the_identity():
    np.testing.assert_array_equal(rotation.from_angles(0, 0, 0), np.eye(3))
