"""Control points are measured again at full resolution, pair by pair, or stay as they are."""

import numpy as np
import pytest

from alignment.planted import common_points
from panostitch.alignment.pictures import pictures_of
from panostitch.alignment.refine import refined
from panostitch.model.match import ControlPoints
from panostitch.model.photo import Photo
from panostitch.runtime.executor import Executor, serial
from panostitch.synthetic.render import ArraySource, photograph_plan
from panostitch.synthetic.scene import procedural_texture, rig, sphere_scene

EXACT = 0.03  # px median, eight bits and cubic splines; 0.015 seen


@pytest.fixture(scope="module")
def scene():
    return sphere_scene(np.asarray(procedural_texture(2048, 1024, 5), np.uint8))


@pytest.fixture(scope="module")
def three(scene):
    """Cameras, photos and, for the pairs (0, 1) and (1, 2), true points."""
    cameras = rig([-0.3, 0.0, 0.3], size=(480, 360), hfov=1.0)
    rng = np.random.default_rng(3)
    points = [ControlPoints(i, j, *common_points(cameras[i], cameras[j], 60, rng)) for i, j in ((0, 1), (1, 2))]
    return cameras, photograph_plan(scene, cameras), points


def moved(points, by, rng):
    return [ControlPoints(p.i, p.j, p.xy_i, p.xy_j + rng.uniform(-by, by, p.xy_j.shape)) for p in points]


def errors_of(cameras, points):
    return np.hypot(*(cameras[points.j].project(cameras[points.i].rays(points.xy_i)) - points.xy_j).T)


def test_every_pair_becomes_exact(three, rng):
    cameras, photos, points = three

    found = refined(pictures_of(photos), cameras, moved(points, 1.0, rng), pixel_size=1.0, run=serial)

    assert [(pair.i, pair.j) for pair in found] == [(0, 1), (1, 2)]
    for pair in found:
        assert len(pair) > 20
        assert np.median(errors_of(cameras, pair)) < EXACT


def test_far_off_key_points_of_large_photos(three, rng):
    """Where working pixels are large, reduced photos tell where to begin."""
    cameras, photos, points = three

    near = refined(pictures_of(photos), cameras, moved(points, 1.0, rng), pixel_size=1.0, run=serial)
    far = refined(pictures_of(photos), cameras, moved(points, 10.0, rng), pixel_size=9.0, run=serial)

    for pair, known in zip(far, near, strict=True):
        assert len(pair) > 0.7 * len(known)
        assert np.median(errors_of(cameras, pair)) < EXACT


def test_a_pair_that_shows_nothing_keeps_its_key_points(three, rng):
    cameras, photos, points = three
    grey = Photo("grey", photos[2].size, ArraySource(np.full((360, 480, 3), 99, np.uint8)))
    given = moved(points, 1.0, rng)

    found = refined(pictures_of([photos[0], photos[1], grey]), cameras, given, pixel_size=1.0, run=serial)

    assert np.median(errors_of(cameras, found[0])) < EXACT
    assert found[1] is given[1]


def test_points_that_would_run_away_are_left_out(three, rng):
    cameras, photos, points = three
    (given, _) = moved(points, 0.0, rng)
    lost = np.arange(len(given)) % 3 == 0
    given.xy_j[lost] += [4.0, 0.0]

    (found,) = refined(pictures_of(photos), cameras, [given], pixel_size=1.0, run=serial)

    assert errors_of(cameras, found).max() < 1
    assert len(found) <= (~lost).sum()


def test_the_number_of_threads_changes_nothing(three, rng):
    cameras, photos, points = three
    given = moved(points, 1.0, rng)

    one = refined(pictures_of(photos), cameras, given, pixel_size=1.0, run=serial)
    many = refined(pictures_of(photos), cameras, given, pixel_size=1.0, run=Executor(4))

    for a, b in zip(one, many, strict=True):
        np.testing.assert_array_equal(a.xy_i, b.xy_i)
        np.testing.assert_array_equal(a.xy_j, b.xy_j)
