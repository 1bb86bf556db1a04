"""Whether two photos really show the same thing: one homography must explain enough of the matches.

Brown & Lowe 2007: a pair is accepted if its inliers exceed 8 + 0.3 times its matches in the overlap. The estimate is
MAGSAC++ (geometry.homography).
"""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.geometry import homography
from panostitch.model.features import Features
from panostitch.model.match import Link, PutativeMatch, Rejection, VerifiedMatch, needed_inliers
from panostitch.model.photo import Photo
from panostitch.options import MatchingOptions

Floats = NDArray[np.float64]

MIN_OVERLAP = 0.01  # of the smaller photo; less than this is a chance agreement in a corner


def unpromising(pair: tuple[int, int], matches: int) -> Rejection:
    """The rejection of a pair in which a first look at the largest features saw so few matches."""
    return Rejection(*pair, "too few matches among the largest key points", matches, needed=needed_inliers(0))


def verify_pair(
    photos: Sequence[Photo], features: Sequence[Features], putative: PutativeMatch, *, options: MatchingOptions
) -> Link:
    """The link between two photos, or why there is none."""
    i, j, count = putative.i, putative.j, len(putative.pairs)
    if count < needed_inliers(0):
        return Rejection(i, j, "too few matches", putative=count, needed=needed_inliers(0))
    xy_i = features[i].xy[putative.pairs[:, 0]].astype(np.float64)
    xy_j = features[j].xy[putative.pairs[:, 1]].astype(np.float64)
    threshold = options.ransac_threshold * features[j].pixel_size
    found = homography.estimate(xy_i, xy_j, threshold=threshold, seed=options.seed)
    if found is None:
        return Rejection(i, j, "no homography explains the matches", putative=count, needed=needed_inliers(count))
    j_from_i, inliers = found
    overlap, in_overlap = _overlap(j_from_i, xy_i, xy_j, photos[i].size, photos[j].size)
    needed = needed_inliers(int((in_overlap | inliers).sum()))
    reason = _objection(j_from_i, int(inliers.sum()), needed, overlap, photos[i].size, photos[j].size)
    if reason:
        return Rejection(i, j, reason, count, int(inliers.sum()), needed, overlap)
    errors = homography.transfer_error(j_from_i, xy_i[inliers], xy_j[inliers])
    rms = float(np.sqrt((errors**2).mean()))
    both = min(
        _seen_by(features[i].xy, j_from_i, photos[j].size),
        _seen_by(features[j].xy, np.asarray(np.linalg.inv(j_from_i), np.float64), photos[i].size),
    )
    return VerifiedMatch(i, j, xy_i[inliers], xy_j[inliers], j_from_i, count, overlap, rms, both)


def _objection(
    j_from_i: Floats, inliers: int, needed: int, overlap: float, size_i: tuple[int, int], size_j: tuple[int, int]
) -> str:
    """Why a homography is not believed; empty if it is."""
    if inliers < needed:
        return "too few matches agree"
    i_from_j = np.asarray(np.linalg.inv(j_from_i), np.float64)
    if not (homography.is_sane(j_from_i, size_i) and homography.is_sane(i_from_j, size_j)):
        return "the matches agree on an impossible view"
    if overlap < MIN_OVERLAP:
        return "the overlap is too small"
    return ""


def _overlap(
    j_from_i: Floats, xy_i: Floats, xy_j: Floats, size_i: tuple[int, int], size_j: tuple[int, int]
) -> tuple[float, NDArray[np.bool_]]:
    """Share of the smaller photo that both see, and which matches (n,) lie where both see."""
    with np.errstate(invalid="ignore"):
        there = homography.apply(j_from_i, xy_i)
        back = homography.apply(np.asarray(np.linalg.inv(j_from_i), np.float64), xy_j)
        inside = _inside(there, size_j) | _inside(back, size_i)
    share = overlap_of(j_from_i, size_i, size_j)
    return (float(inside.mean()) if share is None else share), inside


def overlap_of(j_from_i: Floats, size_i: tuple[int, int], size_j: tuple[int, int]) -> float | None:
    """Share of the smaller photo that both see; None where a corner is behind the horizon, and nobody can tell."""
    corners = np.array([[0, 0], [size_i[0], 0], [size_i[0], size_i[1]], [0, size_i[1]]], np.float64)
    seen = homography.apply(j_from_i, corners)
    frame = np.array([[0, 0], [size_j[0], 0], [size_j[0], size_j[1]], [0, size_j[1]]], np.float32)
    if not np.isfinite(seen).all():
        return None
    area, _ = cv2.intersectConvexConvex(cv2.convexHull(seen.astype(np.float32)), frame)
    zoom = abs(float(cv2.contourArea(seen.astype(np.float32)))) / (size_i[0] * size_i[1])
    smaller = min(zoom * size_i[0] * size_i[1], size_j[0] * size_j[1])
    return float(min(area / max(smaller, 1e-9), 1.0))


def _seen_by(xy: NDArray[np.float32], other_from_this: Floats, size: tuple[int, int]) -> int:
    """How many features (n, 2) px of a photo lie where the other photo, of this size, sees them as well."""
    with np.errstate(invalid="ignore"):
        return int(_inside(homography.apply(other_from_this, xy.astype(np.float64)), size).sum())


def _inside(xy: Floats, size: tuple[int, int]) -> NDArray[np.bool_]:
    return np.asarray((xy >= -0.5).all(1) & (xy <= np.array(size) - 0.5).all(1))
