"""Patch registration finds planted shifts, whatever the light, and refuses what it cannot know."""

import numpy as np
import pytest

from alignment.planted import common_points
from panostitch.alignment.registration import BORDER, HALF, measured_again
from panostitch.model.match import ControlPoints
from panostitch.synthetic.scene import rig
from tolerances import PIXEL

SIZE = (320, 240)
CLEAN = 0.01  # px, of clean photos: what interpolation and eight bits leave
NOISY = 3.5  # times the deviation that was announced: hardly ever more


def pattern(rng, *, shortest=7.0, longest=40.0, count=40):
    """A picture on the sphere as a function of rays: waves of random directions, lengths (px) and phases."""
    focal = cameras()[0].focal
    waves = rng.normal(size=(count, 3))
    waves *= 2 * np.pi * focal / (np.linalg.norm(waves, axis=1) * rng.uniform(shortest, longest, count))[:, None]
    phase = rng.uniform(0, 2 * np.pi, count)

    def brightness(rays):
        unit = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        return 128 + 90 * np.sin(unit @ waves.T + phase).sum(1) / np.sqrt(count)

    return brightness


def cameras():
    return rig([-0.1, 0.1], [0.01, -0.02], [0.02, -0.05], size=SIZE, hfov=0.7, k1=-0.1)


def photo_of(camera, brightness):
    """What the camera sees (h, w), exactly, at the centres of the pixels."""
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    rays = camera.rays(np.column_stack([x.ravel(), y.ravel()]))
    return brightness(rays).reshape(SIZE[::-1]).astype(np.float32)


@pytest.fixture
def pair(rng):
    """Two cameras, their photos, and true points that are a pixel off in photo j."""
    one, two = cameras()
    brightness = pattern(rng)
    inner = HALF + BORDER + 3
    xy_i, xy_j = common_points(one, two, 60, rng)
    inside = ((xy_i > inner) & (xy_i < np.array(SIZE) - 1 - inner)).all(1)
    inside &= ((xy_j > inner) & (xy_j < np.array(SIZE) - 1 - inner)).all(1)
    off = rng.uniform(-1, 1, (inside.sum(), 2))
    points = ControlPoints(0, 1, xy_i[inside], xy_j[inside] + off)
    assert len(points) > 20
    return one, two, photo_of(one, brightness), photo_of(two, brightness), points


def errors_of(measured, one, two):
    return np.hypot(*(two.project(one.rays(measured.xy_i)) - measured.xy_j).T)


def test_finds_the_true_place(pair):
    one, two, grey_i, grey_j, points = pair

    measured = measured_again(points, one, two, grey_i, grey_j)

    assert len(measured.index) == len(points)
    assert errors_of(measured, one, two).max() < CLEAN
    # the points are moved to whole pixels of photo i, no further
    assert np.abs(measured.xy_i - points.xy_i[measured.index]).max() <= 0.5 + PIXEL


# What light does to a photo: from pixels and coordinates from -1 to 1 across and down.
LIGHTS = {
    "half as bright": lambda p, _u, _v: 0.5 * p,
    "lifted": lambda p, _u, _v: p + 40,
    "vignetting": lambda p, u, v: p * (1 - 0.3 * (u**2 + v**2)),
    "a veil from one side": lambda p, u, _v: 0.8 * p + 30 * u,
    "all at once": lambda p, u, v: (0.7 * p + 10 * v) * (1 - 0.2 * (u**2 + v**2)) + 12,
}


@pytest.mark.parametrize("light", LIGHTS)
def test_is_blind_to_light(pair, light):
    one, two, grey_i, grey_j, points = pair
    u, v = np.meshgrid(np.linspace(-1, 1, SIZE[0]), np.linspace(-1, 1, SIZE[1]))
    lit = np.asarray(LIGHTS[light](grey_j, u, v), np.float32)

    measured = measured_again(points, one, two, grey_i, lit)

    assert len(measured.index) == len(points)
    assert errors_of(measured, one, two).max() < 2 * CLEAN


def test_announces_its_error(pair, rng):
    one, two, grey_i, grey_j, points = pair
    noisy = [np.asarray(grey + rng.normal(0, 4, grey.shape), np.float32) for grey in (grey_i, grey_j)]

    measured = measured_again(points, one, two, *noisy)

    ratio = errors_of(measured, one, two) / measured.deviation
    assert ratio.max() < NOISY
    assert 0.5 < np.sqrt((ratio**2).mean()) < 1.5


def test_a_wrong_camera_of_photo_j_does_not_matter(pair):
    """The search begins where the match is; the cameras only give the patch its shape."""
    one, two, grey_i, grey_j, points = pair
    (turned,) = rig([0.13], [0.0], [-0.05], size=SIZE, hfov=0.7, k1=-0.1)

    measured = measured_again(points, one, turned, grey_i, grey_j)

    assert len(measured.index) > 0.9 * len(points)
    assert np.median(errors_of(measured, one, two)) < 2 * CLEAN


def test_something_else_is_refused(pair):
    one, two, grey_i, _, points = pair
    elsewhere = photo_of(two, pattern(np.random.default_rng(99)))

    assert len(measured_again(points, one, two, grey_i, elsewhere).index) == 0


def test_stripes_are_refused(pair, rng):
    """Along stripes nothing can be told."""
    one, two, _, _, points = pair

    def stripes(rays):
        return 128 + 100 * np.sin(300 * rays[:, 0] / rays[:, 2])

    photos = [photo_of(camera, stripes) for camera in (one, two)]
    photos = [np.asarray(p + rng.normal(0, 1, p.shape), np.float32) for p in photos]

    assert len(measured_again(points, one, two, *photos).index) == 0


@pytest.mark.parametrize("level", [0.0, 127.0])
def test_nothing_to_see(pair, level):
    one, two, grey_i, grey_j, points = pair
    blank = np.full_like(grey_i, level)

    for photos in ((blank, blank), (grey_i, blank), (blank, grey_j)):
        assert len(measured_again(points, one, two, *photos).index) == 0


def test_points_at_the_edge_are_left_out(pair):
    one, two, grey_i, grey_j, _ = pair
    corner = np.array([[0.0, 0.0], [SIZE[0] - 1.0, 5.0], [160.0, SIZE[1] - 1.0]])

    measured = measured_again(ControlPoints(0, 1, corner, two.project(one.rays(corner))), one, two, grey_i, grey_j)

    assert len(measured.index) == 0


def test_no_points(pair):
    one, two, grey_i, grey_j, points = pair

    assert len(measured_again(points.take(np.zeros(0, int)), one, two, grey_i, grey_j).index) == 0
