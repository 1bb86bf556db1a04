"""Which ray each pixel sees, and the way back, through the lens."""

import numpy as np
import pytest

from panostitch.geometry import rotation
from panostitch.geometry.sampling import rescale
from panostitch.model.camera import Camera
from tolerances import PIXEL, RELATIVE, UNIT

SIZE = (800, 600)
FOCAL = 700.0
POSE = rotation.from_angles(0.7, -0.2, 0.1)

# k1, k2 of lenses that do not fold inside the picture, which reaches to 0.71 focal lengths
LENSES = [(0.0, 0.0), (-0.12, 0.02), (0.1, 0.0), (-0.2, 0.0), (0.0, -0.05), (0.15, -0.1), (-0.25, 0.12)]

# px of the small picture; rounding its size moves an edge by up to half a pixel, half of it on either side
ASPECT_ROUNDING = 0.25

# share of the fold's radius: close to it, safely on one side
BEFORE_FOLD, BEHIND_FOLD = 0.97, 1.01


def camera(k1=0.0, k2=0.0, *, centre=(391.0, 307.5), pose=POSE, size=SIZE):
    return Camera(size, FOCAL, centre, pose, k1, k2)


def pixels():
    x, y = np.meshgrid(np.linspace(-0.5, SIZE[0] - 0.5, 21), np.linspace(-0.5, SIZE[1] - 0.5, 17))
    return np.column_stack([x.ravel(), y.ravel()])


@pytest.mark.parametrize(("k1", "k2"), LENSES)
def test_project_undoes_rays(k1, k2):
    cam = camera(k1, k2)

    np.testing.assert_allclose(cam.project(cam.rays(pixels())), pixels(), rtol=0, atol=PIXEL)


def test_the_centre_looks_along_the_axis():
    cam = camera(-0.1, 0.02)

    ray = cam.rays(np.array([cam.centre]))

    np.testing.assert_allclose(ray, [POSE.T @ [0, 0, 1]], rtol=0, atol=UNIT)


def test_lens_is_brown_conrady():
    cam = camera(-0.1, 0.02, pose=np.eye(3))
    x, y = 0.3, -0.4  # at half a focal length from the axis: 1 + k1 / 4 + k2 / 16
    factor = 1 - 0.1 * 0.25 + 0.02 * 0.0625

    found = cam.project(np.array([[x, y, 1.0]]))

    np.testing.assert_allclose(found, [[391.0 + FOCAL * x * factor, 307.5 + FOCAL * y * factor]], rtol=0, atol=PIXEL)


def test_a_photo_of_the_right_side_has_the_world_at_its_left():
    cam = camera(pose=rotation.from_angles(0.3, 0, 0))

    ahead = cam.project(np.array([[0.0, 0.0, 1.0]]))

    np.testing.assert_allclose(ahead, [[391.0 - FOCAL * np.tan(0.3), 307.5]], rtol=0, atol=PIXEL)


@pytest.mark.parametrize(("k1", "k2"), LENSES)
def test_nothing_behind_the_camera(k1, k2):
    cam = camera(k1, k2)
    in_front = cam.rays(pixels())

    assert np.isnan(cam.project(-in_front)).all()
    sideways = np.array([[1.0, 0, 0], [0, -1, 0]]) @ POSE
    assert np.isnan(cam.project(sideways)).all()


def test_the_length_of_a_ray_does_not_matter():
    cam = camera(-0.12, 0.02)
    rays = cam.rays(pixels())

    np.testing.assert_allclose(cam.project(rays * 1000), cam.project(rays), rtol=0, atol=PIXEL)


FOLDS = {  # k1, k2 and the radius at which r (1 + k1 r^2 + k2 r^4) stops growing
    (-0.3, 0.0): np.sqrt(1 / 0.9),
    (0.0, -0.2): 1.0,
    (-0.5, 0.05): np.sqrt(3 - np.sqrt(5)),
    (0.1, -0.26): 1.0,
}


@pytest.mark.parametrize("lens", FOLDS)
def test_nothing_beyond_the_fold_of_the_lens(lens):
    cam = camera(*lens, pose=np.eye(3))
    radius = FOLDS[lens]

    inside = cam.project(np.array([[radius * BEFORE_FOLD, 0, 1]]))
    outside = cam.project(np.array([[radius * BEHIND_FOLD, 0, 1]]))

    assert np.isfinite(inside).all()
    assert np.isnan(outside).all()
    np.testing.assert_allclose(cam.rays(inside)[0, 0], radius * BEFORE_FOLD, rtol=RELATIVE)


@pytest.mark.parametrize("lens", [(0.2, 0.0), (0.0, 0.1), (-0.2, 0.1), (0.0, 0.0)])
def test_a_lens_without_fold_sees_everything_in_front(lens):
    far = np.array([[30.0, -20.0, 1.0]])

    assert np.isfinite(camera(*lens, pose=np.eye(3)).project(far)).all()


@pytest.mark.parametrize(("k1", "k2"), LENSES[:2])
def test_nothing_in_nothing_out(k1, k2):
    assert camera(k1, k2).rays(np.empty((0, 2))).shape == (0, 3)
    assert camera(k1, k2).project(np.empty((0, 3))).shape == (0, 2)


@pytest.mark.parametrize("factor", [0.5, 0.25, 2.0])
def test_scaled_obeys_the_pixel_centre_rule(factor):
    cam = camera(-0.12, 0.02)
    size = (round(SIZE[0] * factor), round(SIZE[1] * factor))
    rays = cam.rays(pixels())

    small = cam.scaled(size)

    assert small.size == size
    np.testing.assert_allclose(small.project(rays), rescale(pixels(), factor), rtol=0, atol=PIXEL)
    np.testing.assert_allclose(small.project(rays), (pixels() + 0.5) * factor - 0.5, rtol=0, atol=PIXEL)


def test_scaled_to_a_rounded_size():
    cam = camera(size=(401, 301), centre=(200.0, 150.0))
    xy = np.array([[-0.5, -0.5], [400.5, 300.5], [200, 150]])

    small = cam.scaled((200, 150))

    expected = (xy + 0.5) * (200 / 401, 150 / 301) - 0.5
    np.testing.assert_allclose(small.project(cam.rays(xy)), expected, rtol=0, atol=ASPECT_ROUNDING)


def test_scaled_to_its_own_size_is_the_same():
    cam = camera()

    assert cam.scaled(SIZE) is cam


def test_turned_sees_the_same_in_a_turned_world():
    cam = camera(-0.12, 0.02)
    old_from_new = rotation.from_angles(-1.0, 0.5, 2.0)

    turned = cam.turned(old_from_new)

    new_rays = cam.rays(pixels()) @ old_from_new  # new = old_from_new^T old
    np.testing.assert_allclose(turned.project(new_rays), pixels(), rtol=0, atol=PIXEL)


def test_corners_are_centres_of_pixels_clockwise():
    np.testing.assert_array_equal(camera().corners, [[0, 0], [799, 0], [799, 599], [0, 599]])


def test_outline_runs_along_the_outer_edge():
    outline = camera().outline(points_per_side=8)

    assert len(outline) == 4 * 8
    on_side = np.isin(outline[:, 0], [-0.5, SIZE[0] - 0.5]) | np.isin(outline[:, 1], [-0.5, SIZE[1] - 0.5])
    assert on_side.all()
    assert len(np.unique(outline, axis=0)) == len(outline)
    np.testing.assert_array_equal(outline.min(0), [-0.5, -0.5])
    np.testing.assert_array_equal(outline.max(0), [SIZE[0] - 0.5, SIZE[1] - 0.5])
