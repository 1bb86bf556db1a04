"""SURF: places, sizes and directions of known blobs, and matches between pictures related by a known warp."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from skimage import data

from panostitch.features.surf import SurfFeatures, detect_and_describe

Grey = NDArray[np.uint8]

PLACE_PX = 0.02  # px; asked for in small blobs; fitting parabolas to box sums errs by about 0.01
BIAS_PX = 0.005  # px; mean over sub-pixel centres, where errors without a preferred side cancel
SCALE_OF_BLOB = 0.715  # s over the blob's sigma, measured: the 9 px filter fits more than its "1.2 px"
SCALE_SPREAD = 0.05  # relative; the layers of octave 1 are 6 px apart
ZOOM_SPREAD = 0.1  # relative; median over the matches of a real picture
ZOOM_PLACE_PX = 0.1  # px in the large picture, median; half a pixel's shift would show as 0.5 px
ANGLE_RAD = 0.02  # rad; a quarter turn maps the grids and the bins onto each other
WARP_PX = 3.0  # px; what the robust estimators of the next stage accept as right
WARP_RIGHT = 0.8  # share of the matches after ratio 0.8 and cross-check, as the matching stage has them
TURN_RAD = 0.05  # rad; median error of the turn between matched directions, single ones vary by 0.1
SAME_DISTANCE = 0.1  # descriptor distance (2 at the most); only rounding differs


def blob(x: float, y: float, sigma: float, *, height: float = 200.0) -> Grey:
    """A Gaussian blob, dark for negative heights, on a grey ground."""
    rows, columns = np.mgrid[:181, :201]
    bump = np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / (2 * sigma**2))
    return np.round(20 + max(-height, 0) + height * bump).astype(np.uint8)


def matches(first: SurfFeatures, second: SurfFeatures, ratio: float = 0.8) -> NDArray[np.intp]:
    """Rows (i, j) that are nearest to each other and pass the ratio test."""
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    there = matcher.knnMatch(first.descriptors, second.descriptors, k=2)
    back = [match.trainIdx for match in matcher.match(second.descriptors, first.descriptors)]
    close = [a for a, b in there if a.distance < ratio * b.distance and back[a.trainIdx] == a.queryIdx]
    return np.array([(match.queryIdx, match.trainIdx) for match in close])


def turn_between(first: NDArray[np.float32], second: NDArray[np.float32]) -> NDArray[np.float32]:
    """Differences of angles in -pi..pi."""
    return (second - first + np.pi) % (2 * np.pi) - np.pi


@pytest.mark.parametrize("sigma", [2.5, 3.0, 3.5, 6.0])
def test_blob_is_found_where_it_is(sigma: float) -> None:
    errors = []
    for dx in (-0.5, -0.2, 0.0, 0.2, 0.5):
        for dy in (-0.3, 0.0, 0.3):
            found = detect_and_describe(blob(100 + dx, 90 + dy, sigma), max_features=1)
            errors.append(found.xy[0] - (100 + dx, 90 + dy))
    assert np.abs(errors).max() < PLACE_PX
    assert np.abs(np.mean(errors, axis=0)).max() < BIAS_PX


@pytest.mark.parametrize("sigma", [2.5, 3.5, 6.0, 12.0])
def test_scale_follows_the_size_of_the_blob(sigma: float) -> None:
    found = detect_and_describe(blob(100.3, 89.8, sigma), max_features=1)
    assert found.scale[0] / sigma == pytest.approx(SCALE_OF_BLOB, rel=SCALE_SPREAD)


def test_laplacian_tells_dark_from_light() -> None:
    light = detect_and_describe(blob(100, 90, 3, height=150), max_features=1)
    dark = detect_and_describe(blob(100, 90, 3, height=-150), max_features=1)
    assert (light.laplacian[0], dark.laplacian[0]) == (-1, 1)


def test_quarter_turn_turns_keypoints_and_keeps_descriptors() -> None:
    grey = data.camera()[:505, :505]  # 504 is a multiple of the coarsest step: the grids turn into each other
    upright = detect_and_describe(grey, max_features=300)
    turned = detect_and_describe(np.ascontiguousarray(np.rot90(grey, -1)), max_features=300)
    expected = np.stack([504 - upright.xy[:, 1], upright.xy[:, 0]], axis=1)
    distance = np.linalg.norm(expected[:, None] - turned.xy, axis=2)
    distance += np.abs(upright.scale[:, None] - turned.scale)
    partner = distance.argmin(axis=1)
    same = distance.min(axis=1) < PLACE_PX
    assert same.mean() > 0.98
    turn = turn_between(upright.angle[same], turned.angle[partner[same]])
    aligned = np.abs(turn_between(np.float32(np.pi / 2), turn)) < ANGLE_RAD
    assert aligned.mean() > 0.95
    change = np.linalg.norm(upright.descriptors[same] - turned.descriptors[partner[same]], axis=1)
    assert np.median(change) < SAME_DISTANCE


def test_enlargement_doubles_the_scale() -> None:
    grey = cv2.GaussianBlur(data.astronaut()[:, :, 1], (0, 0), 1.0)
    small = detect_and_describe(grey, max_features=500)
    enlarged = cv2.resize(grey, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
    large = detect_and_describe(enlarged, max_features=1000)
    pairs = matches(small, large)
    assert len(pairs) > 200
    zoom = large.scale[pairs[:, 1]] / small.scale[pairs[:, 0]]
    assert np.median(zoom) == pytest.approx(2, rel=ZOOM_SPREAD)
    shift = large.xy[pairs[:, 1]] - ((small.xy[pairs[:, 0]] + 0.5) * 2 - 0.5)  # pixel centres
    assert np.abs(np.median(shift, axis=0)).max() < ZOOM_PLACE_PX


@pytest.mark.parametrize("name", ["astronaut", "camera", "coffee", "chelsea", "brick", "grass"])
def test_warped_picture_matches(name: str) -> None:
    picture = getattr(data, name)()
    grey = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    height, width = grey.shape
    warp = np.vstack([cv2.getRotationMatrix2D((width / 2, height / 2), -25, 1.0), [0, 0, 1]])
    warp[2, 0] = 1e-4  # some perspective
    seen = cv2.warpPerspective(grey, warp, (width, height), flags=cv2.INTER_CUBIC)
    first = detect_and_describe(grey, max_features=1000)
    second = detect_and_describe(seen, max_features=1000)
    pairs = matches(first, second)
    truth = cv2.perspectiveTransform(first.xy[pairs[:, 0], None].astype(np.float64), warp)[:, 0]
    right = np.linalg.norm(truth - second.xy[pairs[:, 1]], axis=1) < WARP_PX
    assert right.sum() > 50
    assert right.mean() >= WARP_RIGHT
    turn = turn_between(first.angle[pairs[right, 0]], second.angle[pairs[right, 1]])
    assert abs(np.median(turn) - np.deg2rad(25)) < TURN_RAD


def test_exposure_hardly_changes_descriptors() -> None:
    grey = data.camera()
    darker = np.round(grey * 0.6 + 30).astype(np.uint8)
    first = detect_and_describe(grey, max_features=300)
    second = detect_and_describe(darker, max_features=300)
    near = np.linalg.norm(first.xy[:, None] - second.xy, axis=2) + np.abs(first.scale[:, None] - second.scale)
    same = near.min(axis=1) < 0.1  # px
    assert same.mean() > 0.9
    change = np.linalg.norm(first.descriptors - second.descriptors[near.argmin(axis=1)], axis=1)[same]
    assert np.quantile(change, 0.9) < SAME_DISTANCE


@pytest.mark.parametrize(
    "grey",
    [
        np.full((200, 300), 130, np.uint8),
        np.zeros((1, 1), np.uint8),
        np.arange(64, dtype=np.uint8).reshape(8, 8),
        np.arange(250, dtype=np.uint8)[None],
        np.arange(250, dtype=np.uint8)[:, None],
        np.zeros((0, 0), np.uint8),
    ],
    ids=["flat", "1x1", "8x8", "row", "column", "empty"],
)
def test_pictures_without_blobs_give_empty_results(grey: Grey) -> None:
    found = detect_and_describe(grey, max_features=100)
    shapes = [a.shape for a in (found.xy, found.scale, found.angle, found.response, found.laplacian)]
    assert shapes == [(0, 2), (0,), (0,), (0,), (0,)]
    assert found.descriptors.shape == (0, 64)
    floats = (found.xy, found.scale, found.angle, found.response, found.descriptors)
    assert {array.dtype for array in floats} == {np.dtype(np.float32)}
    assert found.laplacian.dtype == np.int8


@pytest.mark.parametrize("shape", [(9, 9, 3), (9,), (1, 40000)])
def test_other_shapes_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="SURF"):
        detect_and_describe(np.zeros(shape, np.uint8), max_features=10)


def test_other_values_are_refused() -> None:
    with pytest.raises(ValueError, match="float64"):
        detect_and_describe(np.zeros((9, 9)), max_features=10)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="max_features"):
        detect_and_describe(np.zeros((9, 9), np.uint8), max_features=-1)


def test_sums_beyond_32_bits_do_not_matter() -> None:
    white = np.full((3000, 3000), 255, np.uint8)  # 9 Mpx: the integral image exceeds 2^31
    spot = 255 - blob(100.3, 90.2, 3)
    white[-181:, -201:] = spot
    alone = detect_and_describe(np.ascontiguousarray(white[-300:, -300:]), max_features=1)
    within = detect_and_describe(white, max_features=1)
    assert np.abs(within.xy - 2700 - alone.xy).max() < PLACE_PX
    assert within.response[0] == alone.response[0]


def test_result_depends_neither_on_run_nor_on_threads() -> None:
    grey = cv2.cvtColor(data.coffee(), cv2.COLOR_RGB2GRAY)
    before = cv2.getNumThreads()
    results = []
    try:
        for threads in (1, 2, 2):
            cv2.setNumThreads(threads)
            results.append(detect_and_describe(grey, max_features=700))
    finally:
        cv2.setNumThreads(before)
    for other in results[1:]:
        for field in ("xy", "scale", "angle", "response", "laplacian", "descriptors"):
            np.testing.assert_array_equal(getattr(results[0], field), getattr(other, field))


def test_strongest_come_first_normalised_and_at_most_as_many_as_asked_for() -> None:
    many = detect_and_describe(data.camera(), max_features=100_000)
    few = detect_and_describe(data.camera(), max_features=50)
    assert len(few.xy) == 50 < len(many.xy)
    assert np.all(np.diff(many.response) <= 0)
    np.testing.assert_array_equal(few.xy, many.xy[:50])
    np.testing.assert_allclose(np.linalg.norm(many.descriptors, axis=1), 1, atol=1e-5)
    assert np.abs(many.angle).max() <= np.float32(np.pi)
    assert len(detect_and_describe(data.camera(), max_features=100_000, threshold=1000).xy) < len(many.xy)
