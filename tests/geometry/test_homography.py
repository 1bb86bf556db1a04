"""Plane homographies: found among outliers, refined, judged, and the focal length in them."""

import cv2
import numpy as np
import pytest

from panostitch.geometry import homography, rotation
from tolerances import PIXEL, RELATIVE

SIZE = (1000, 750)
FOCAL = 900.0
CENTRE = np.array([(SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2])

POINTS = 120
OUTLIERS = 0.4
NOISE = 0.5  # px, standard deviation of each coordinate
THRESHOLD = 3.0  # px, of an inlier
SEEDS = range(8)
SHIFT = np.array([5.0, -3.0])  # px

# px, rms over the photo, of the homography found from 72 points with NOISE among 48 outliers.
# Seen over 100 seeds: 0.08 to 0.33. A zero error would mean that the test looked at the truth.
LEAST_ERROR, MOST_ERROR = 0.02, 0.8

# px; the truth is found where there is no noise at all. Seen over 100 seeds: 2e-13.
NOISE_FREE = 1e-9

# Of the true matches, share that must be found: with noise of a sixth of the threshold none should be missed.
LEAST_FOUND = 0.98
# Of the outliers, share that may lie within the threshold by chance; the chance is 1e-4 for each.
MOST_WRONG = 0.05

# px; a lens this short would see 179 degrees
LEAST_FOCAL = 4.0

# The refined homography is better than four noisy points by this factor, in the median over the seeds; 5 seen.
IMPROVEMENT = 2.0


def between_views(yaw, pitch=0.0, roll=0.0, focal=FOCAL):
    """The homography of a camera that turns; depths are positive in front of it."""
    intrinsics = np.array([[focal, 0, CENTRE[0]], [0, focal, CENTRE[1]], [0, 0, 1]])
    return intrinsics @ rotation.from_angles(yaw, pitch, roll) @ np.linalg.inv(intrinsics)


TRUTH = between_views(0.3, 0.05, -0.04)


def grid():
    x, y = np.meshgrid(np.linspace(0, SIZE[0] - 1, 9), np.linspace(0, SIZE[1] - 1, 7))
    return np.column_stack([x.ravel(), y.ravel()])


def rms(found, truth=TRUTH):
    return float(np.sqrt((homography.transfer_error(found, grid(), homography.apply(truth, grid())) ** 2).mean()))


def planted(seed, *, noise=NOISE, outliers=OUTLIERS, truth=TRUTH):
    """Pairs of points, and which of them are true."""
    rng = np.random.default_rng(seed)
    src = rng.uniform((0, 0), SIZE, (POINTS, 2))
    dst = homography.apply(truth, src) + rng.normal(0, 1, (POINTS, 2)) * noise
    true = np.arange(POINTS) >= outliers * POINTS
    dst[~true] = rng.uniform((0, 0), SIZE, ((~true).sum(), 2))
    return src, dst, true


@pytest.mark.parametrize("seed", SEEDS)
def test_finds_a_planted_homography_among_outliers(seed):
    src, dst, true = planted(seed)

    found, inliers = homography.estimate(src, dst, threshold=THRESHOLD, seed=seed)

    assert LEAST_ERROR < rms(found) < MOST_ERROR
    assert inliers[true].mean() >= LEAST_FOUND
    assert inliers[~true].mean() <= MOST_WRONG


@pytest.mark.parametrize("seed", SEEDS)
def test_is_exact_without_noise(seed):
    src, dst, _ = planted(seed, noise=0)

    found, _ = homography.estimate(src, dst, threshold=THRESHOLD, seed=seed)

    assert rms(found) < NOISE_FREE


@pytest.mark.parametrize("yaw", [-0.7, 0.7])
def test_wide_views_whose_far_side_is_behind_the_horizon(yaw):
    # 100 degrees wide, turned by 40: the left or the right edge of one photo lies behind the other camera
    truth = between_views(yaw, focal=420.0)
    src = np.random.default_rng(0).uniform((0, 0), SIZE, (4 * POINTS, 2))
    dst = homography.apply(truth, src)
    with np.errstate(invalid="ignore"):
        both = ((dst >= 0) & (dst <= SIZE)).all(1)
    assert both.sum() > POINTS

    found = homography.estimate(src[both], dst[both], threshold=THRESHOLD, seed=0)

    assert found is not None
    assert found[1].all()
    assert homography.is_sane(found[0], SIZE)


def test_one_seed_one_answer():
    src, dst, _ = planted(0)

    answers = [homography.estimate(src, dst, threshold=THRESHOLD, seed=5)[0] for _ in range(10)]

    for answer in answers[1:]:
        np.testing.assert_array_equal(answer, answers[0])


def test_inliers_are_those_within_the_threshold():
    src, dst, _ = planted(1)

    found, inliers = homography.estimate(src, dst, threshold=THRESHOLD, seed=0)

    np.testing.assert_array_equal(inliers, homography.transfer_error(found, src, dst) <= THRESHOLD)


def test_refine_improves_on_noise():
    gains = []
    for seed in SEEDS:
        src, dst, _ = planted(seed, outliers=0)
        # four points far apart, as noisy as all others
        corners = [int(np.argmin(np.linalg.norm(src - c, axis=1))) for c in grid()[[0, 8, -9, -1]]]
        start = cv2.getPerspectiveTransform(src[corners].astype(np.float32), dst[corners].astype(np.float32))
        refined = homography.refine(start, src, dst, scale=1.0)
        gains.append(rms(start) / rms(refined))

    assert np.median(gains) > IMPROVEMENT


def test_refine_leaves_the_truth_alone():
    src, dst, _ = planted(0, noise=0, outliers=0)

    assert rms(homography.refine(TRUTH, src, dst, scale=1.0)) < PIXEL


def test_refine_is_not_pulled_away_by_an_outlier():
    src, dst, _ = planted(0, noise=0, outliers=0)
    dst[0] += 1000

    assert rms(homography.refine(TRUTH, src, dst, scale=1.0)) < MOST_ERROR


def degenerate():
    rng = np.random.default_rng(0)
    scattered = rng.uniform(0, 500, (60, 2))
    line = np.column_stack([scattered[:, 0], 2 * scattered[:, 0] + 3])
    one = np.tile([[10.0, 20.0]], (60, 1))
    return {
        "nothing": (scattered[:0], scattered[:0]),
        "three points": (scattered[:3], scattered[:3] + 5),
        "a line to a line": (line, line + 5),
        "a line to an area": (line, scattered),
        "one point": (one, one),
        "all to one point": (scattered, one),
        "not numbers": (scattered, scattered * np.nan),
    }


@pytest.mark.parametrize("case", degenerate())
def test_degenerate_points_have_no_homography(case):
    src, dst = degenerate()[case]

    assert homography.estimate(src, dst, threshold=THRESHOLD, seed=0) is None


def test_four_points_are_enough():
    src = np.array([[0, 0], [100, 0], [100, 80], [0, 80]], float)

    found, inliers = homography.estimate(src, src + SHIFT, threshold=THRESHOLD, seed=0)

    assert inliers.all()
    np.testing.assert_allclose(homography.apply(found, src), src + SHIFT, atol=NOISE_FREE)


def test_points_behind_the_horizon_are_nowhere():
    h = np.array([[1, 0, 0], [0, 1, 0], [-0.01, 0, 1.0]])  # the horizon is the column 100
    points = np.array([[50.0, 10], [150, 10]])

    image = homography.apply(h, points)

    np.testing.assert_allclose(image[0], [100, 20], atol=PIXEL)
    assert np.isnan(image[1]).all()
    np.testing.assert_array_equal(homography.transfer_error(h, points, image), [0, np.inf])


@pytest.mark.parametrize("angles", [(0.4, 0, 0), (0, 0.3, 0), (0.3, 0.3, 0), (-0.5, 0.1, 0.2), (0.2, 0.2, 1.5)])
def test_focal_length_of_a_turning_camera(angles):
    found = homography.focal_lengths(between_views(*angles), CENTRE, CENTRE)

    assert found == pytest.approx([FOCAL, FOCAL], rel=RELATIVE)


def test_each_end_has_its_own_focal_length():
    near, far = (np.array([[f, 0, CENTRE[0]], [0, f, CENTRE[1]], [0, 0, 1]]) for f in (700.0, 1100.0))
    h = far @ rotation.from_angles(0.3, 0.1, 0.05) @ np.linalg.inv(near)

    assert sorted(homography.focal_lengths(h, CENTRE, CENTRE)) == pytest.approx([700.0, 1100.0], rel=RELATIVE)


@pytest.mark.parametrize("h", [np.eye(3), between_views(0, 0, 0.3), np.array([[1, 0, 40.0], [0, 1, 7], [0, 0, 1]])])
def test_no_focal_length_where_the_camera_did_not_turn_aside(h):
    # rounding may leave something that no lens has
    assert [f for f in homography.focal_lengths(h, CENTRE, CENTRE) if f > LEAST_FOCAL] == []


SANE = {
    "nothing": np.eye(3),
    "moved": np.array([[1, 0, 400.0], [0, 1, -30], [0, 0, 1]]),
    "turned aside": between_views(0.5),
    "quarter turn": between_views(0.1, 0, np.pi / 2),
    "twice as large": np.diag([2.0, 2, 1]),
    "far corner behind the horizon": between_views(1.1),
}
INSANE = {
    "mirror": np.array([[-1, 0, SIZE[0]], [0, 1, 0], [0, 0, 1.0]]),
    "mirror upside down": np.array([[1, 0, 0], [0, -1, SIZE[1]], [0, 0, 1.0]]),
    "middle behind the horizon": np.array([[1, 0, 0], [0, 1, 0], [-1 / 300, 0, 1.0]]),
    "fold next to the middle": np.array([[1, 0, 0], [0, 1, 0], [-1 / (CENTRE[0] + 60), 0, 1.0]]),
    # 31 times the area at the middle is believed, but half-way to the right edge there is nothing any more
    "fold half-way to the edge": np.array([[1, 0, 0], [0, 1, 0], [-0.68 / CENTRE[0], 0, 1.0]]),
    "ten times as large": np.diag([10.0, 10, 1]),
    "a tenth": np.diag([0.1, 0.1, 1]),
}


@pytest.mark.parametrize("case", SANE)
def test_possible_views_are_sane(case):
    assert homography.is_sane(SANE[case], SIZE)


@pytest.mark.parametrize("case", INSANE)
def test_mirrors_folds_and_absurd_zooms_are_not(case):
    assert not homography.is_sane(INSANE[case], SIZE)


def test_the_zoom_that_is_absurd_can_be_said():
    assert not homography.is_sane(np.diag([2.0, 2, 1]), SIZE, max_zoom=1.5)
    assert homography.is_sane(np.diag([10.0, 10, 1]), SIZE, max_zoom=12)
