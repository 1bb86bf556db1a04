"""Reprojection error between turning cameras and its derivatives, for all matches of all pairs at once.

A point p of photo i is undistorted, turned into the frame of camera j, projected and distorted; the residual is its
distance to the matched point of photo j. Parameters of a camera: a rotation vector applied from the left to
`cam_from_world` (3), and its lens: relative change of the focal length, k1, k2 (3).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from panostitch.geometry import lens
from panostitch.geometry.rotation import cross_matrix
from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints, VerifiedMatch

Floats = NDArray[np.float64]

MATCHES_PER_LINK = 200  # more make the adjustment slower, not better
BEHIND = 1e3  # px, residual of a point that camera j cannot see; finite, so that a bad start can still improve


def thinned(link: VerifiedMatch, most: int = MATCHES_PER_LINK) -> ControlPoints:
    """At most `most` matches of a link, evenly from all of them: they come spread over the photo."""
    index = np.linspace(0, link.inliers - 1, min(link.inliers, most)).astype(int)
    return ControlPoints(link.i, link.j, link.xy_i[index], link.xy_j[index])


@dataclass(frozen=True)
class Matches:
    """All matches in a row: photos and points (m, 2) px; `bounds` (pairs + 1,) says where each pair begins."""

    i: NDArray[np.intp]
    j: NDArray[np.intp]
    xy_i: Floats
    xy_j: Floats
    bounds: NDArray[np.intp]


def in_a_row(observations: Sequence[ControlPoints]) -> Matches:
    """All matches of all pairs, pair by pair."""
    counts = [len(o.xy_i) for o in observations]
    return Matches(
        np.repeat([o.i for o in observations], counts),
        np.repeat([o.j for o in observations], counts),
        np.vstack([o.xy_i for o in observations]),
        np.vstack([o.xy_j for o in observations]),
        np.concatenate([[0], np.cumsum(counts)]),
    )


@dataclass(frozen=True)
class Lenses:
    """Intrinsics of the camera of each match: focal (m,) px, centre (m, 2) px, k1 (m,), k2 (m,)."""

    focal: Floats
    centre: Floats
    k1: Floats
    k2: Floats


@dataclass(frozen=True)
class Residuals:
    """Residuals of m matches, in px of photo j.

    value:    (m, 2); large where a ray falls behind the camera
    jacobian: (m, 2, 12) by rotation i, rotation j, lens i, lens j
    """

    value: Floats
    jacobian: Floats


def reprojection(cameras: Sequence[Camera], matches: Matches) -> Floats:
    """Residuals (m, 2) px alone."""
    _, local, _, lens_j = _turned(cameras, matches)
    ideal, seen, _ = _projected(local)
    with np.errstate(invalid="ignore"):
        xy = lens.distort(ideal, lens_j.k1, lens_j.k2) * lens_j.focal[:, None] + lens_j.centre
    residual = np.where(seen[:, None], xy - matches.xy_j, BEHIND)
    return np.asarray(np.nan_to_num(residual, nan=BEHIND))


def linearise(cameras: Sequence[Camera], matches: Matches) -> Residuals:
    """Residuals with their derivatives."""
    ray, local, lens_i, lens_j = _turned(cameras, matches)
    ideal, seen, depth = _projected(local)
    square = (ideal**2).sum(1)
    factor = lens.factor(square, lens_j.k1, lens_j.k2)
    value = lens_j.focal[:, None] * ideal * factor[:, None] + lens_j.centre - matches.xy_j

    by_local = _projection_by_ray(lens_j, ideal, square, factor, depth)
    by_ray = by_local @ _j_from_i(cameras, matches)
    jacobian = np.concatenate(
        [
            by_ray @ cross_matrix(ray),
            -by_local @ cross_matrix(local),
            by_ray[:, :, :2] @ _plane_by_lens(lens_i, ray[:, :2]),
            _projection_by_lens(lens_j, ideal, square, factor),
        ],
        axis=2,
    )
    jacobian[~seen] = 0.0
    return Residuals(np.where(seen[:, None], value, BEHIND), jacobian)


def _turned(cameras: Sequence[Camera], matches: Matches) -> tuple[Floats, Floats, Lenses, Lenses]:
    """Rays (m, 3) of the points of photo i in the frames of camera i and of camera j, and both lenses."""
    lens_i, lens_j = _lenses(cameras, matches.i), _lenses(cameras, matches.j)
    distorted = (matches.xy_i - lens_i.centre) / lens_i.focal[:, None]
    ray = np.column_stack([lens.undistort(distorted, lens_i.k1, lens_i.k2), np.ones(len(distorted))])
    return ray, np.einsum("mab,mb->ma", _j_from_i(cameras, matches), ray), lens_i, lens_j


def _lenses(cameras: Sequence[Camera], index: NDArray[np.intp]) -> Lenses:
    focal, x, y, k1, k2 = np.array([(c.focal, *c.centre, c.k1, c.k2) for c in cameras])[index].T
    return Lenses(focal, np.column_stack([x, y]), k1, k2)


def _j_from_i(cameras: Sequence[Camera], matches: Matches) -> Floats:
    """Relative rotation (m, 3, 3) of the pair of each match."""
    first = matches.bounds[:-1]
    world = np.array([camera.cam_from_world for camera in cameras])
    pairs = world[matches.j[first]] @ world[matches.i[first]].transpose(0, 2, 1)
    return np.repeat(pairs, np.diff(matches.bounds), axis=0)


def _projected(local: Floats) -> tuple[Floats, NDArray[np.bool_], Floats]:
    """Ideal image coordinates (m, 2), whether the ray points forward (m,), and its depth (m,)."""
    seen = np.asarray(local[:, 2] > 1e-6)
    depth = np.where(seen, local[:, 2], 1.0)
    return local[:, :2] / depth[:, None], seen, depth


def _projection_by_ray(lenses: Lenses, ideal: Floats, square: Floats, factor: Floats, depth: Floats) -> Floats:
    """Derivative (m, 2, 3) of the pixel with respect to the ray in the camera's frame."""
    bend = 2 * lenses.k1 + 4 * lenses.k2 * square
    plane = bend[:, None, None] * ideal[:, :, None] * ideal[:, None, :] + factor[:, None, None] * np.eye(2)
    flat = np.concatenate([np.broadcast_to(np.eye(2), (len(ideal), 2, 2)), -ideal[:, :, None]], axis=2)
    return np.asarray((lenses.focal / depth)[:, None, None] * plane @ flat)


def _projection_by_lens(lenses: Lenses, ideal: Floats, square: Floats, factor: Floats) -> Floats:
    """Derivative (m, 2, 3) of the pixel with respect to relative focal length, k1, k2."""
    columns = np.stack([factor, square, square**2], axis=1)
    return np.asarray(lenses.focal[:, None, None] * ideal[:, :, None] * columns[:, None, :])


def _plane_by_lens(lenses: Lenses, plane: Floats) -> Floats:
    """Derivative (m, 2, 3) of the undistorted point with respect to relative focal length, k1, k2.

    The undistorted radius r solves r (1 + k1 r^2 + k2 r^4) = distorted radius: the implicit function theorem.
    """
    square = (plane**2).sum(1)
    factor = lens.factor(square, lenses.k1, lenses.k2)
    columns = np.stack([factor, square, square**2], axis=1) / lens.slope(square, lenses.k1, lenses.k2)[:, None]
    return np.asarray(-plane[:, :, None] * columns[:, None, :])
