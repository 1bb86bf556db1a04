"""Flow between small photos: what lies far off and sheared is found, and nothing is believed without reason."""

from functools import cache

import cv2
import numpy as np
import pytest

from panostitch.alignment.flow import followed
from panostitch.model.camera import Camera
from panostitch.synthetic.scene import procedural_texture

SIZE = (320, 240)
FAR = 32.0  # px, a tenth of the photo, by which the lowest line is off: a patch that is sought within 8 px misses it
EXACT = 0.4  # px, rms: 0.15 and 0.19 seen; what is wrong is off by whole pixels
MOST = 0.9  # of the points that both photos see: 0.975 seen
CHANCE = (
    0.02  # of points in unrelated photos that may happen to be believed: 0.002 seen, 0.03 without one of the checks
)


def camera():
    return Camera(SIZE, 300.0, (159.5, 119.5), np.eye(3))


@cache
def texture(seed):
    grey = cv2.cvtColor(procedural_texture(640, 480, seed=seed), cv2.COLOR_RGB2GRAY)
    return np.ascontiguousarray(grey[100:340, 100:420])


def off(y):
    """Px by which the lower half is off, ever more."""
    return FAR * np.clip(y / (SIZE[1] / 2) - 1, 0, None)


def moved(grey):
    """What photo i shows at x, this shows at x + off."""
    y, x = np.indices(grey.shape, np.float32)
    return cv2.remap(grey, x - off(y).astype(np.float32), y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)


def points():
    x, y = np.meshgrid(np.arange(10, SIZE[0] - 50, 8), np.arange(10, SIZE[1] - 10, 8))
    return np.column_stack([x.ravel(), y.ravel()])


@pytest.mark.parametrize(("gain", "offset"), [(1.0, 0.0), (0.6, 30.0)])
def test_what_lies_far_off_is_found_in_any_light(gain, offset):
    dim = (moved(texture(1)) * gain + offset).clip(0, 255).astype(np.uint8)

    here, there = followed(points(), camera(), camera(), texture(1), dim)

    wrong = there - here - np.column_stack([off(here[:, 1]), np.zeros(len(here))])
    assert len(here) > MOST * len(points())
    assert (here[:, 1] > 0.9 * SIZE[1]).any()
    assert np.sqrt((wrong**2).sum(1).mean()) < EXACT


def test_unrelated_photos_share_nothing():
    here, _ = followed(points(), camera(), camera(), texture(1), texture(2))

    assert len(here) <= CHANCE * len(points())


def test_what_shows_nothing_is_not_believed():
    plain = texture(1).copy()
    plain[:, 100:200] = 201

    here, _ = followed(points(), camera(), camera(), plain, plain)

    assert len(here)
    assert not ((here[:, 0] > 110) & (here[:, 0] < 190)).any()


def test_nothing_is_found_beyond_the_other_photo():
    turn = 0.5  # rad: the other photo sees about the right half
    aside = np.array([[np.cos(turn), 0, -np.sin(turn)], [0, 1, 0], [np.sin(turn), 0, np.cos(turn)]])
    other = Camera(SIZE, 300.0, (159.5, 119.5), aside)

    here, there = followed(points(), camera(), other, texture(1), texture(1))

    seen = other.project(camera().rays(here))
    assert ((seen > 0) & (seen < np.array(SIZE) - 1)).all()
    assert ((there >= 0) & (there <= np.array(SIZE) - 1)).all()


@pytest.mark.parametrize("size", [(3, 3), (40, 5)])
def test_the_smallest_photos_are_no_failure(size):
    small = Camera(size, 30.0, (size[0] / 2, size[1] / 2), np.eye(3))
    grey = np.zeros(size[::-1], np.uint8)

    here, there = followed(np.zeros((1, 2), int), small, small, grey, grey)

    assert len(here) == len(there) == 0


def test_threads_change_nothing():
    threads = cv2.getNumThreads()
    found = []
    for count in (1, 3):
        cv2.setNumThreads(count)
        found.append(followed(points(), camera(), camera(), texture(1), moved(texture(1))))
    cv2.setNumThreads(threads)

    np.testing.assert_array_equal(found[0][1], found[1][1])
