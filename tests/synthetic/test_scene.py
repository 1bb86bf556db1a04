"""Scenes, rigs and plans."""

import numpy as np
import pytest

from panostitch.geometry.rotation import angle
from panostitch.synthetic.plans import SIZE
from panostitch.synthetic.scene import (
    FLAT_PLANS,
    PLANS,
    gallery_texture,
    plane_scene,
    procedural_texture,
    rig,
    sphere_scene,
    step_for_overlap,
)
from panostitch.synthetic.score import GRID, pair_errors
from panostitch.synthetic.textures import even_on_sphere

EXACT = 1e-9  # px or radians: closed forms in float64
SEAM_RATIO = 1.3  # step across the texture's edge per mean step between columns; 1 but for chance


@pytest.fixture(scope="module")
def texture():
    return procedural_texture(1024, 512, seed=3)


def test_straight_ahead_is_the_middle_of_the_texture(texture):
    for scene in (sphere_scene(texture), plane_scene(texture)):
        middle = scene.coordinates(np.array([[0.0, 0.0, 1.0]]))
        np.testing.assert_allclose(middle, [[511.5, 255.5]], atol=EXACT)


def test_right_is_right_and_down_is_down(texture):
    for scene in (sphere_scene(texture), plane_scene(texture)):
        x, y = scene.coordinates(np.array([[0.1, 0.2, 1.0]]))[0]
        assert x > 512
        assert y > 256


def test_a_ray_away_from_a_plane_meets_nothing(texture):
    assert np.isnan(plane_scene(texture).coordinates(np.array([[0.1, 0.2, -1.0]]))).all()


def test_patch_goes_on_round_the_back(texture):
    patch = sphere_scene(texture).patch(range(1020, 1030), range(100, 110))
    np.testing.assert_array_equal(patch[:, :4], texture[100:110, 1020:])
    np.testing.assert_array_equal(patch[:, 4:], texture[100:110, :6])


def test_patch_goes_on_over_the_poles(texture):
    scene = sphere_scene(texture)
    np.testing.assert_array_equal(scene.patch(range(10), range(-2, 0)), texture[1::-1, 512:522])
    np.testing.assert_array_equal(scene.patch(range(10), range(512, 514)), texture[:509:-1, 512:522])


def test_a_sphere_refuses_another_aspect(texture):
    with pytest.raises(ValueError, match="twice as wide"):
        sphere_scene(texture[:, :1000])


def test_texture_wraps_and_is_reproducible(texture):
    np.testing.assert_array_equal(texture, procedural_texture(1024, 512, seed=3))
    assert (texture != procedural_texture(1024, 512, seed=4)).mean() > 0.5
    columns = texture.astype(float)
    usual = np.abs(np.diff(columns, axis=1)).mean()
    assert np.abs(columns[:, 0] - columns[:, -1]).mean() < SEAM_RATIO * usual


def test_rig_has_the_field_of_view_it_was_asked_for():
    (camera,) = rig(0.3, size=(800, 600), hfov=1.0)
    # the field of view ends at the outer edges of the pixels
    left, right = camera.rays(np.array([[-0.5, 299.5], [799.5, 299.5]]))
    across = np.arctan2(right[0], right[2]) - np.arctan2(left[0], left[2])
    assert across == pytest.approx(1.0, abs=EXACT)


def test_rig_turns_right_up_and_clockwise():
    right, up, clockwise = rig([0.2, 0, 0], [0, 0.2, 0], [0, 0, 0.2], size=(80, 60), focal=100)
    ahead, side = np.array([[0.0, 0.0, 1.0]]), np.array([[0.1, 0.0, 1.0]])
    assert right.project(ahead)[0, 0] < 39.5
    assert up.project(ahead)[0, 1] > 29.5
    assert clockwise.project(side)[0, 1] < 29.5


def test_rig_wants_one_of_focal_and_hfov():
    for wrong in ({}, {"focal": 100.0, "hfov": 1.0}):
        with pytest.raises(ValueError, match="either"):
            rig(0.0, size=(80, 60), **wrong)


@pytest.mark.parametrize("overlap", [0.1, 0.35, 0.7])
def test_step_leaves_the_overlap_it_promises(overlap):
    left, right = rig([0, step_for_overlap(overlap, 1.0)], size=(801, 601), hfov=1.0)
    edge = left.project(right.rays(np.array([[-0.5, 300.0]])))[0, 0]
    assert (800.5 - edge) / 801 == pytest.approx(overlap, abs=EXACT)


@pytest.mark.parametrize("name", PLANS)
def test_every_photo_of_a_plan_overlaps_another(name):
    cameras = PLANS[name]()
    for i, camera in enumerate(cameras):
        others = [other for j, other in enumerate(cameras) if j != i]
        assert any(len(pair_errors((camera, other), (camera, other))) >= 30 for other in others)


@pytest.mark.parametrize("name", sorted(set(PLANS) - FLAT_PLANS))
def test_cameras_that_turn_are_rotations(name):
    for camera in PLANS[name]():
        matrix = camera.cam_from_world
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=EXACT)


def shares(cameras):
    """Part (n, n) of photo i that photo j sees too."""
    points = GRID[0] * GRID[1]
    return np.array([[0 if a is b else len(pair_errors((a, b), (a, b))) / points for b in cameras] for a in cameras])


# least and most of the share that a photo has in common with the one it overlaps most
BEST_SHARE = {
    "pair": (0.45, 0.5),
    "low_overlap": (0.13, 0.17),
    "mosaic": (0.3, 0.5),
    "sphere": (0.3, 0.55),
    "zoomed": (0.35, 0.7),
}


@pytest.mark.parametrize("name", BEST_SHARE)
def test_overlap_of_a_plan(name):
    best = shares(PLANS[name]()).max(1)
    low, high = BEST_SHARE[name]
    assert best.min() > low
    assert best.max() < high


@pytest.mark.parametrize("name", PLANS)
def test_photos_of_every_plan_are_of_one_size(name):
    assert {camera.size for camera in PLANS[name]()} == {SIZE}


def test_mosaic_is_five_by_eight_and_holds_together():
    cameras = PLANS["mosaic"]()
    assert len(cameras) == 40
    neighbours = (shares(cameras) > 0.2).sum(1)
    # two in the corners, four in the middle
    assert neighbours.min() >= 2
    assert neighbours.max() >= 4


def test_sphere_leaves_nothing_out():
    cameras = PLANS["sphere"]()
    directions = np.random.default_rng(0).normal(size=(20_000, 3))
    seen = np.zeros(len(directions), bool)
    for camera in cameras:
        at = camera.project(directions)
        seen |= ((at >= 0) & (at <= np.array(SIZE) - 1)).all(1)
    assert seen.all()


def test_zoomed_zooms():
    focal = [camera.focal for camera in PLANS["zoomed"]()]
    assert max(focal) / min(focal) == pytest.approx(1.6)
    assert len(set(focal)) == len(focal)


def test_barrel_is_bent_and_nothing_else_is():
    for name, plan in PLANS.items():
        assert {(c.k1, c.k2) for c in plan()} == ({(-0.12, 0.02)} if name == "barrel" else {(0.0, 0.0)})


def test_even_texture_is_as_fine_at_the_poles_as_at_the_equator(texture):
    even = even_on_sphere(texture)
    np.testing.assert_array_equal(even[[255, 256]], texture[[255, 256]])
    steps = np.abs(np.diff(even.astype(float), axis=1)).mean((1, 2))
    # at 80 degrees a pixel is 5.8 times as narrow as at the equator: neighbours must differ less, as in the raw one not
    high = int(512 * 10 / 180)
    assert steps[high] < 0.5 * steps[256]
    assert np.abs(np.diff(texture[high].astype(float), axis=0)).mean() > 0.6 * steps[256]
    # the first row runs round the pole in three pixels
    assert (even[0].std(0) < 0.3 * texture[0].std(0)).all()
    # it still wraps
    assert np.abs(even[:, 0].astype(float) - even[:, -1]).mean() < SEAM_RATIO * steps.mean()


def test_ring_is_closed():
    cameras = PLANS["ring"]()
    first, last = cameras[0], cameras[-1]
    assert np.rad2deg(angle(first.cam_from_world @ last.cam_from_world.T)) < 40


def test_gallery_wraps_and_has_no_hole():
    texture = gallery_texture(512)
    assert texture.shape == (256, 512, 3)
    columns = texture.astype(float)
    assert np.abs(columns[:, 0] - columns[:, -1]).mean() < 2 * np.abs(np.diff(columns, axis=1)).mean()
    # neither empty nor burnt out: walls, floor and ceiling all have a tone
    for band in np.array_split(columns, 8):
        assert 40 < band.mean() < 245
