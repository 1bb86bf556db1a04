"""Plane homographies: robust estimate, refinement, error, sanity, focal length.

Hartley & Zisserman, "Multiple View Geometry", 2nd ed. 2004, chapter 4; MAGSAC++: Barath et al., CVPR 2020;
focal length: Szeliski & Shum, SIGGRAPH 1997.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

MAX_ITERATIONS = 10_000  # enough for 15 % true matches; with 2000 a third of such pairs is lost
CONFIDENCE = 0.9999
REFINE_STEPS = 8
ARRIVED = 1e-9  # in coordinates of spread one: a step below this is the last
FEWEST_INLIERS = 7  # of the robust estimate, below which making it exact is of no use
MIN_POINTS = 4


def apply(homography: Floats, xy: NDArray[np.floating]) -> Floats:
    """Send points (n, 2) through a homography (3, 3); points behind its horizon come out as NaN."""
    p = np.asarray(xy, np.float64) @ homography[:, :2].T + homography[:, 2]
    depth = np.where(p[:, 2:] > 1e-12, p[:, 2:], np.nan)
    return np.asarray(p[:, :2] / depth)


def transfer_error(homography: Floats, src: Floats, dst: Floats) -> Floats:
    """Distance (n,) px between the images of `src` (n, 2) and `dst` (n, 2); infinite behind the horizon."""
    with np.errstate(invalid="ignore"):
        error = np.linalg.norm(apply(homography, src) - dst, axis=1)
    return np.asarray(np.nan_to_num(error, nan=np.inf))


def estimate(src: Floats, dst: Floats, *, threshold: float, seed: int) -> tuple[Floats, Booleans] | None:
    """Homography (3, 3) from contaminated pairs of points (n, 2) px, and which are inliers (n,).

    MAGSAC++ finds it, robust least squares on its inliers makes it exact. None if there is none to be found:
    fewer than four points, or all of them on a line.
    """
    if len(src) < MIN_POINTS:
        return None
    found, _ = cv2.findHomography(
        np.ascontiguousarray(src, np.float64), np.ascontiguousarray(dst, np.float64), usac(threshold, seed)
    )
    if found is None or not np.isfinite(found).all():
        return None
    homography = normalised(np.asarray(found, np.float64), src.mean(0))
    inliers = transfer_error(homography, src, dst) <= threshold
    for _ in range(2):  # the better fit has a few more inliers; they have settled after the second round
        if inliers.sum() < FEWEST_INLIERS:
            break
        homography = refine(homography, src[inliers], dst[inliers], scale=threshold / 3)
        inliers = transfer_error(homography, src, dst) <= threshold
    return homography, inliers


def normalised(homography: Floats, at: Floats) -> Floats:
    """The homography scaled so that the depth at this point (2,) is one.

    A homography is known up to a factor, sign included; depths are positive where a camera looks only if the sign is
    chosen at a point that it sees.
    """
    depth = float(homography[2, :2] @ at + homography[2, 2])
    return np.asarray(homography / depth if abs(depth) > 1e-12 else homography)


def usac(threshold: float, seed: int) -> Any:
    """What OpenCV's robust estimators take for MAGSAC++ with this threshold (px)."""
    params = cv2.UsacParams()
    params.score = cv2.SCORE_METHOD_MAGSAC
    params.threshold = threshold
    params.confidence = CONFIDENCE
    params.maxIterations = MAX_ITERATIONS
    params.randomGeneratorState = seed
    params.loMethod = cv2.LOCAL_OPTIM_SIGMA
    params.isParallel = False
    return params


def refine(homography: Floats, src: Floats, dst: Floats, *, scale: float) -> Floats:
    """Least squares of the transfer error with Cauchy weights of width `scale` px, from a good start.

    Gauss-Newton over eight parameters, in coordinates shifted and scaled for good conditioning.
    """
    to_src, to_dst = _normalisation(src), _normalisation(dst)
    h = to_dst @ homography @ np.linalg.inv(to_src)
    h /= h[2, 2]
    a, b = apply(to_src, src), apply(to_dst, dst)
    width = scale * to_dst[0, 0]
    for _ in range(REFINE_STEPS):
        p = a @ h[:, :2].T + h[:, 2]
        if (p[:, 2] <= 1e-9).any():
            return homography
        uv = p[:, :2] / p[:, 2:]
        residual = b - uv
        weight = 1 / (1 + (residual**2).sum(1) / width**2)
        root = np.sqrt(weight)[:, None]
        rows = (_jacobian(a, uv, p[:, 2]) * root[..., None]).reshape(-1, 8)
        normal, right = rows.T @ rows, rows.T @ (residual * root).reshape(-1)
        step = np.linalg.lstsq(normal, right, rcond=None)[0]
        h = h + np.append(step, 0.0).reshape(3, 3)
        if np.abs(step).max() < ARRIVED:
            break
    refined = np.asarray(np.linalg.inv(to_dst) @ h @ to_src, np.float64)
    return normalised(refined, src.mean(0)) if np.isfinite(refined).all() else homography


def _jacobian(a: Floats, uv: Floats, depth: Floats) -> Floats:
    """Derivative (n, 2, 8) of the images `uv` of the points `a` with respect to the first eight entries."""
    rows = np.zeros((len(a), 2, 8))
    point = np.column_stack([a, np.ones(len(a))]) / depth[:, None]
    rows[:, 0, 0:3] = point
    rows[:, 1, 3:6] = point
    rows[:, :, 6:8] = -uv[:, :, None] * point[:, None, :2]
    return rows


def _normalisation(xy: Floats) -> Floats:
    """Similarity (3, 3) that moves points to mean zero and mean distance one (Hartley 1997)."""
    mean = xy.mean(0)
    spread = max(float(np.linalg.norm(xy - mean, axis=1).mean()), 1e-9)
    return np.array([[1 / spread, 0, -mean[0] / spread], [0, 1 / spread, -mean[1] / spread], [0, 0, 1]])


def is_sane(homography: Floats, size: tuple[int, int], *, max_zoom: float = 6.0) -> bool:
    """Whether a homography could relate two photos: no mirror, no fold inside the photo, no absurd zoom.

    `size` is (width, height) px of the photo it is applied to; `max_zoom` bounds the local change of scale at
    the centre either way.
    """
    width, height = size
    corners = np.array([[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1]], np.float64)
    centre = np.array([[(width - 1) / 2, (height - 1) / 2]])
    depth = np.vstack([corners, centre]) @ homography[2, :2] + homography[2, 2]
    if depth[-1] <= 0:
        return False
    local = _local_scale(homography, centre[0])
    if not 1 / max_zoom**2 < local < max_zoom**2:
        return False
    # wide pairs may put a far corner behind the horizon; the half next to the centre may not be
    halfway = depth[:-1] / 2 + depth[-1] / 2
    return bool((halfway > 0).all())


def _local_scale(homography: Floats, xy: Floats) -> float:
    """Signed change of area of a homography at a point; negative for a mirror."""
    depth = homography[2, :2] @ xy + homography[2, 2]
    return float(np.linalg.det(homography) / depth**3)


def focal_lengths(homography: Floats, centre_src: Floats, centre_dst: Floats) -> list[float]:
    """Focal lengths (px) that a homography between two photos of a turning camera allows; may be empty.

    Each end gives at most one: the rows of `R = K'^-1 H K` are orthogonal and of equal length.
    """
    shift_src, shift_dst = np.eye(3), np.eye(3)
    shift_src[:2, 2], shift_dst[:2, 2] = centre_src, -np.asarray(centre_dst)
    h = shift_dst @ homography @ shift_src
    return [f for f in (_focal(h), _focal(np.asarray(np.linalg.inv(h), np.float64))) if f is not None]


def _focal(h: Floats) -> float | None:
    """Focal length from the first two rows of a centred homography having equal length and being orthogonal."""
    row0, row1 = h[0], h[1]
    cross = row0[2] * row1[2]
    squares = row1[2] ** 2 - row0[2] ** 2
    inner = -(row0[0] * row1[0] + row0[1] * row1[1])
    lengths = row0[0] ** 2 + row0[1] ** 2 - row1[0] ** 2 - row1[1] ** 2
    # both equations are linear in f^2; take the better conditioned one
    above, below = (cross, inner) if abs(inner) > abs(lengths) else (squares, lengths)
    square = above / below if below else -1.0
    return float(np.sqrt(square)) if square > 0 and np.isfinite(square) else None
