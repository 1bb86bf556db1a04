"""The benchmark of parallax: which matches it holds for true, without any contestant's geometry."""

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from panostitch.model.photo import Photo
from panostitch.synthetic.render import ArraySource

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
SIZE = (400, 300)  # px
SHIFT = np.array([7.0, 2.0])  # px, of what is far
NEARER = np.array([60.0, 2.0])  # px, of what is near: along the same lines


@pytest.fixture(scope="module")
def parallax():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        import parallax

        yield parallax
        del sys.modules["parallax"]


def scattered(seed, count, low, high):
    return np.random.default_rng(seed).uniform(low, high, (count, 2))


@pytest.fixture(scope="module")
def pair():
    """Two photos of grain at two depths, by a camera that moved sideways; below is the near one."""
    grain = cv2.GaussianBlur(np.random.default_rng(2).uniform(0, 255, (400, 600)), (0, 0), 2.0)
    grain = np.clip(128 + 5 * (grain - grain.mean()), 0, 255).astype(np.uint8)
    views = []
    for shift in ((0, 0), (1, 1)):
        far, near = (np.rint(shift * way).astype(int) for way in (SHIFT, NEARER))
        picture = np.roll(grain, far[::-1], (0, 1))[:300, :400].copy()
        picture[200:] = np.roll(grain, near[::-1], (0, 1))[200:300, :400]
        views.append(np.dstack([picture] * 3))
    return [Photo(f"{n}.png", SIZE, ArraySource(view)) for n, view in enumerate(views)]


def test_what_is_near_counts_and_what_is_wrong_does_not(parallax, pair):
    far = scattered(3, 60, (90, 30), (310, 180))
    near = scattered(4, 20, (90, 220), (310, 270))
    wrong = scattered(5, 15, (90, 30), (310, 180))
    xy_i = np.vstack([far, near, wrong])
    astray = wrong + scattered(6, 15, (-25, 9), (25, 40))
    xy_j = np.vstack([far + SHIFT, near + NEARER, astray])
    found = parallax.true_matches(pair, xy_i, xy_j)
    assert found[:60].mean() > 0.9
    assert found[60:80].mean() > 0.9
    assert not found[80:].any()


def test_a_post_among_posts_is_not_believed(parallax):
    grain = cv2.GaussianBlur(np.random.default_rng(1).uniform(0, 255, (120, 320)), (0, 0), 2.0).astype(np.float32)
    posts = np.tile(grain[:, :20], (1, 16))
    at = np.array([[160.0, 60.0]])
    assert parallax.unmistakable(grain, grain, *at, *at)
    assert not parallax.unmistakable(posts, posts, *at, *at)
    assert not parallax.unmistakable(grain, grain, *at, at[0] + [6, 0])
    assert not parallax.unmistakable(grain * 0, grain * 0, *at, *at)


def test_by_area_a_crowd_counts_no_more_than_one_alone(parallax):
    xy = np.array([[10.0, 10.0]] * 9 + [[250.0, 10.0]])

    weight = parallax.by_area(xy, 100.0)

    np.testing.assert_allclose(weight, [1 / 18] * 9 + [1 / 2])
