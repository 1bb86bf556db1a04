"""The renderer against a scene whose colours have a formula, so that nothing of its own is believed."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from panostitch.geometry.rotation import exp
from panostitch.model.camera import Camera
from panostitch.runtime.executor import Executor
from panostitch.synthetic.render import GAMMA, ArraySource, focal_length, photograph, photograph_plan
from panostitch.synthetic.scene import PLANS, plane_scene, rig, sphere_scene
from panostitch.synthetic.textures import procedural_texture

ROUNDED = 0.51  # grey levels: rounding to 8 bit is half a level; splines add 2e-5, averaging over a pixel 0.01
SHIFT = 0.1  # px: a renderer this much off must break ROUNDED by far
AGREEMENT = 0.5  # grey levels, mean: rounding of two 8-bit photos, one of them resampled; observed 0.30
LIGHT = 0.035  # relative: half a level of encoded values from 60 on, in two photos, times gamma
SIGMA = 0.05  # relative: deviation of 270,000 noise samples, rounding included


@cache
def texture():
    return procedural_texture(1024, 512, seed=1)


def waves(rays):
    """Colours (n, 3) of a scene with a formula: different waves over the direction in each channel."""
    x, y, z = (rays / np.linalg.norm(rays, axis=1, keepdims=True)).T
    phases = [9 * x + 4 * y, 11 * y - 5 * z + 1, 8 * z + 7 * x + 2]
    return np.column_stack([128 + 90 * np.sin(phase) for phase in phases])


@cache
def wavy_sphere():
    width, height = 1024, 512
    longitude = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    latitude = ((np.arange(height) + 0.5) / height - 0.5) * np.pi
    longitude, latitude = (a.ravel() for a in np.meshgrid(longitude, latitude))
    flat = np.cos(latitude)
    rays = np.column_stack([np.sin(longitude) * flat, np.sin(latitude), np.cos(longitude) * flat])
    return sphere_scene(waves(rays).reshape(height, width, 3).astype(np.float32))


def pinhole_rays(size, focal, cam_from_world, shift=0.0):
    """Rays (h w, 3), written without the Camera class."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(size[0]) + shift, np.arange(size[1])))
    local = np.column_stack([x - (size[0] - 1) / 2, y - (size[1] - 1) / 2, np.full(len(x), float(focal))])
    return local @ cam_from_world


# ahead, across the edge of the texture, over a pole, rolled
TURNS = [(0.0, 0.0, 0.0), (np.pi - 0.1, 0.1, 0.0), (2.0, np.pi / 2 - 0.2, 0.0), (1.0, -0.5, 0.7)]


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("supersample", [1, 2])
def test_photo_of_a_formula(turn, supersample):
    (camera,) = rig([turn[0]], turn[1], turn[2], size=(240, 180), focal=200)
    photo = photograph(wavy_sphere(), camera, supersample=supersample).reshape(-1, 3)
    truth = waves(pinhole_rays(camera.size, 200, camera.cam_from_world))
    assert np.abs(photo - truth).max() < ROUNDED


def test_a_small_shift_would_be_noticed():
    (camera,) = rig([0.4], size=(240, 180), focal=200)
    photo = photograph(wavy_sphere(), camera, supersample=1).reshape(-1, 3)
    shifted = waves(pinhole_rays(camera.size, 200, camera.cam_from_world, SHIFT))
    assert np.abs(photo - shifted).max() > 1.5 * ROUNDED


def test_lens_distortion_is_that_of_the_camera():
    k1, k2 = -0.12, 0.03
    (camera,) = rig([0.4], size=(240, 180), focal=150, k1=k1, k2=k2)
    photo = photograph(wavy_sphere(), camera, supersample=1)
    # forward: ideal points to where the lens puts them, and the photo read there
    ideal = np.stack(np.meshgrid(np.linspace(-0.6, 0.6, 20), np.linspace(-0.45, 0.45, 20)), -1).reshape(-1, 2)
    square = (ideal**2).sum(1, keepdims=True)
    x, y = (ideal * (1 + k1 * square + k2 * square**2) * 150 + camera.centre).T
    seen = np.column_stack([map_coordinates(photo[..., c].astype(float), [y, x], order=3) for c in range(3)])
    truth = waves(np.column_stack([ideal, np.ones(len(ideal))]) @ camera.cam_from_world)
    assert np.abs(seen - truth).max() < 2 * ROUNDED


def test_flat_scene_through_a_homography():
    width, height = 400, 300
    x, y = np.meshgrid((np.arange(width) - 199.5) / 200, (np.arange(height) - 149.5) / 200)

    def formula(x, y):
        return 128 + 80 * np.sin(5 * x + 2 * y)

    texture = np.repeat(formula(x, y)[..., None], 3, axis=2).astype(np.float32)
    homography = np.array([[90.0, 8.0, 100.0], [-6.0, 85.0, 70.0], [0.08, -0.05, 1.0]])
    camera = Camera((200, 140), 1.0, (0.0, 0.0), homography)
    photo = photograph(plane_scene(texture, background=(10, 20, 30)), camera, supersample=1)
    u, v = (a.ravel() for a in np.meshgrid(np.arange(200), np.arange(140)))
    x, y, w = np.linalg.inv(homography) @ np.stack([u, v, np.ones(len(u))])
    x, y = x / w, y / w
    # the outermost pixels of a texture have no neighbours to be interpolated with
    inside, outside = (np.abs(x) < 0.97) & (np.abs(y) < 0.72), (np.abs(x) > 1) | (np.abs(y) > 0.75)
    assert np.abs(photo.reshape(-1, 3)[inside, 0] - formula(x, y)[inside]).max() < ROUNDED
    assert outside.any()
    assert (photo.reshape(-1, 3)[outside] == [10, 20, 30]).all()


def test_two_photos_agree_where_the_cameras_say_so():
    scene = sphere_scene(texture())
    left, right = rig([-0.2, 0.2], [0.02, -0.03], [0.05, -0.04], size=(320, 240), focal=300, k1=-0.05)
    one, two = (photograph(scene, camera).astype(float) for camera in (left, right))
    x, y = (a.ravel() for a in np.meshgrid(np.arange(320.0), np.arange(240.0)))

    def difference(camera):
        u, v = camera.project(left.rays(np.column_stack([x, y]))).T
        inside = (u >= 2) & (u <= 317) & (v >= 2) & (v <= 237)
        there = np.column_stack([map_coordinates(two[..., c], [v[inside], u[inside]], order=3) for c in range(3)])
        return np.abs(there - one.reshape(-1, 3)[inside]).mean()

    assert difference(right) < AGREEMENT
    moved = replace(right, centre=(right.centre[0] + 0.5, right.centre[1]))
    assert difference(moved) > 3 * AGREEMENT


def test_fine_texture_does_not_alias():
    board = (np.indices((1024, 2048)).sum(0) % 2 * 255).astype(np.uint8)
    scene = sphere_scene(np.repeat(board[..., None], 3, axis=2))
    # 4 texture px in a pixel: an even grey is all that may be left of a board of single pixels
    (camera,) = rig([0.1], size=(80, 60), focal=2048 / (2 * np.pi) / 4)
    assert photograph(scene, camera).std() < 4
    assert photograph(scene, camera, supersample=1).std() > 40


def plain(level):
    return sphere_scene(np.full((64, 128, 3), level, np.uint8))


def light(photo):
    return (photo.astype(float) / 255) ** GAMMA


def test_one_ev_doubles_the_linear_light():
    scene = sphere_scene((0.5 * texture() + 60).astype(np.uint8))
    (camera,) = rig([0.0], size=(160, 120), focal=150)
    plain_light, brighter = (light(photograph(scene, camera, exposure=ev)) for ev in (0.0, 1.0))
    free = brighter < 0.98
    np.testing.assert_allclose(brighter[free] / plain_light[free], 2.0, rtol=LIGHT)


def test_vignetting_takes_its_share_in_the_corners():
    (camera,) = rig([0.0], size=(161, 121), focal=150)
    share = light(photograph(plain(200), camera, vignetting=0.3)) / light(np.array(200))
    np.testing.assert_allclose(share[[0, 0, -1, -1], [0, -1, 0, -1]], 0.7, rtol=LIGHT)
    np.testing.assert_allclose(share[60, 80], 1.0, rtol=LIGHT)
    # half-way to the corner a quarter of it
    np.testing.assert_allclose(share[30, 40], 1 - 0.3 / 4, rtol=LIGHT)


def test_noise_has_the_deviation_asked_for_and_follows_the_rng():
    (camera,) = rig([0.0], size=(300, 300), focal=150)
    shots = [photograph(plain(128), camera, noise=3.0, rng=np.random.default_rng(seed)) for seed in (5, 5, 6)]
    assert shots[0].std() == pytest.approx(3.0, rel=SIGMA)
    np.testing.assert_array_equal(shots[0], shots[1])
    assert (shots[0] != shots[2]).any()
    with pytest.raises(ValueError, match="rng"):
        photograph(plain(128), camera, noise=3.0)


def test_seam_of_the_sphere_is_invisible():
    (camera,) = rig([np.pi], size=(200, 150), focal=200)
    # half a turn of texture and camera together shows the same, now in the middle of the texture
    turned = camera.turned(exp(np.array([0.0, np.pi, 0.0])))
    across = photograph(sphere_scene(texture()), camera)
    middle = photograph(sphere_scene(np.roll(texture(), 512, axis=1)), turned)
    # a value on the border of two levels may be rounded either way
    assert np.abs(across.astype(int) - middle).max() <= 1
    assert (across != middle).mean() < 1e-3


def test_plan_yields_photos():
    scene = sphere_scene(texture())
    cameras = rig([-0.2, 0.2], size=(90, 61), focal=80)
    photos = photograph_plan(scene, cameras, exposures=[0.0, 0.5], focal_known=True)
    assert [photo.name for photo in photos] == ["photo_01", "photo_02"]
    assert [photo.size for photo in photos] == [(90, 61)] * 2
    # 80 px are 31.84 mm of full frame; metadata state 31.8
    assert [photo.lens for photo in photos] == ["synthetic 31.8 mm"] * 2
    assert [photo.focal for photo in photos] == [pytest.approx(80 * 31.8 / 31.839, rel=1e-4)] * 2
    assert photograph_plan(scene, cameras)[0].focal is None
    pixels, mask = photos[1].source.read()
    np.testing.assert_array_equal(pixels, photograph(scene, cameras[1], exposure=0.5))
    assert mask is None


def test_zoomed_photos_have_each_a_lens_of_its_own():
    cameras = [camera.scaled((60, 45)) for camera in PLANS["zoomed"]()]
    photos = photograph_plan(sphere_scene(texture()), cameras, supersample=1, focal_known=True)
    assert len({photo.lens for photo in photos}) == len(photos)
    for photo, camera in zip(photos, cameras, strict=True):
        assert photo.focal == pytest.approx(camera.focal, rel=2e-3)
        assert f"{focal_length(camera):g} mm" in photo.lens


def test_threads_change_nothing():
    cameras = rig([-0.2, 0.0, 0.2], size=(60, 45), focal=80)
    one, many = (
        photograph_plan(
            sphere_scene(texture()), cameras, noise=2.0, rng=np.random.default_rng(3), run=Executor(threads)
        )
        for threads in (1, 3)
    )
    for a, b in zip(one, many, strict=True):
        np.testing.assert_array_equal(a.source.pixels, b.source.pixels)
    # the noise of one photo is not that of another
    assert (one[0].source.pixels != one[1].source.pixels).any()


def test_a_flat_plan_has_no_focal_length():
    scene = plane_scene(texture())
    cameras = [camera.scaled((90, 68)) for camera in PLANS["plane_pair"]()]
    assert {photo.focal for photo in photograph_plan(scene, cameras, focal_known=True, supersample=1)} == {None}


@pytest.mark.parametrize(("scale", "size"), [(0.5, (45, 30)), (0.3, (27, 18)), (0.001, (1, 1))])
def test_source_reads_at_a_reduced_scale(scale, size):
    pixels = np.tile(np.arange(90, dtype=np.uint8)[None, :, None], (61, 1, 3))
    reduced, mask = ArraySource(pixels).read(scale)
    assert reduced.shape == (size[1], size[0], 3)
    assert mask is None
    assert abs(float(reduced.mean()) - float(pixels.mean())) < 1
