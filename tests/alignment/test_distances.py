"""Distances of many pairs at once are those of each camera for itself."""

import numpy as np
import pytest

from alignment.planted import common_points
from panostitch.alignment.distances import distances
from panostitch.alignment.residuals import BEHIND
from panostitch.model.match import ControlPoints
from panostitch.synthetic.scene import PLANS, rig
from tolerances import PIXEL


def bent():
    return rig([-0.3, 0.0, 0.3], [0.1, 0.0, -0.1], size=(400, 300), hfov=1.0, k1=-0.1, k2=0.02)


@pytest.mark.parametrize("cameras", [bent(), PLANS["plane_pair"]()], ids=["turning", "flat"])
def test_as_camera_by_camera(cameras, rng):
    pairs = [(0, 1), (1, 2), (2, 1)] if len(cameras) > 2 else [(0, 1), (1, 0)]
    points = []
    for n, (i, j) in enumerate(pairs):
        xy_i, xy_j = common_points(cameras[i], cameras[j], 20 + n, rng)
        points.append(ControlPoints(i, j, xy_i, xy_j + rng.normal(0, 2, xy_j.shape)))

    found = distances(cameras, points)

    for pair, errors in zip(points, found, strict=True):
        there = cameras[pair.j].project(cameras[pair.i].rays(pair.xy_i))
        np.testing.assert_allclose(errors, np.hypot(*(there - pair.xy_j).T), atol=PIXEL)


def test_points_that_cannot_be_seen():
    here, away = rig([0.0, 3.0], size=(400, 300), hfov=1.0)
    middle = np.array([[200.0, 150.0]])

    (errors,) = distances([here, away], [ControlPoints(0, 1, middle, middle)])

    assert errors.tolist() == [BEHIND]


def test_no_pairs():
    assert distances(bent(), []) == []
