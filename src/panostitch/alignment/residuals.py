"""Reprojection error between turning cameras and its derivatives, for all matches of all pairs at once.

A point p of photo i is undistorted, turned into the frame of camera j, projected and distorted; the residual is its
distance to the matched point of photo j. Only the relative rotation of a pair is seen: to turn camera i is to turn
camera j the other way, and one set of columns does for both. Arrays have the matches last.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from panostitch.geometry import lens
from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints, VerifiedMatch

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

MATCHES_PER_LINK = 200  # more make the adjustment slower, not better
BEHIND = 1e3  # px, residual of a point that camera j cannot see; finite, so that a bad start can still improve


def thinned(link: VerifiedMatch, most: int = MATCHES_PER_LINK) -> ControlPoints:
    """At most `most` matches of a link, evenly from all of them: they come spread over the photo."""
    index = np.linspace(0, link.inliers - 1, min(link.inliers, most)).astype(int)
    return ControlPoints(link.i, link.j, link.xy_i[index], link.xy_j[index])


@dataclass(frozen=True)
class Matches:
    """All matches in a row: photos (m,) and points (2, m) px; pair p is matches `bounds[p]` to `bounds[p + 1]`."""

    i: Indices
    j: Indices
    xy_i: Floats
    xy_j: Floats
    bounds: Indices


def in_a_row(observations: Sequence[ControlPoints]) -> Matches:
    """All matches of all pairs, pair by pair; pairs without any are passed over."""
    some = [o for o in observations if len(o)]
    counts = [len(o) for o in some]
    return Matches(
        np.repeat(np.array([o.i for o in some], np.intp), counts),
        np.repeat(np.array([o.j for o in some], np.intp), counts),
        np.ascontiguousarray(np.vstack([o.xy_i for o in some]).T, np.float64),
        np.ascontiguousarray(np.vstack([o.xy_j for o in some]).T, np.float64),
        np.concatenate([[0], np.cumsum(counts)]).astype(np.intp),
    )


@dataclass(frozen=True)
class Lenses:
    """Many lenses: focal (n,) px, centre (2, n) px, k1 (n,), k2 (n,)."""

    focal: Floats
    centre: Floats
    k1: Floats
    k2: Floats

    def of(self, index: Indices) -> "Lenses":
        """The lens of each match; what all lenses have in common stays one number, which is quicker."""
        return Lenses(*(_of(values, index) for values in (self.focal, self.centre, self.k1, self.k2)))


def _of(values: Floats, index: Indices) -> Floats:
    common = bool((values == values[..., :1]).all())
    return np.asarray(values[..., :1] if common else values[..., index])


@dataclass(frozen=True)
class CameraArrays:
    """Cameras as arrays: turns (3, 3, n) are `cam_from_world`."""

    turns: Floats
    lenses: Lenses


def arrays_of(cameras: Sequence[Camera]) -> CameraArrays:
    """The cameras as arrays."""
    focal, x, y, k1, k2 = np.array([(c.focal, *c.centre, c.k1, c.k2) for c in cameras], np.float64).T
    turns = np.array([camera.cam_from_world for camera in cameras], np.float64).transpose(1, 2, 0)
    return CameraArrays(np.ascontiguousarray(turns), Lenses(focal, np.stack([x, y]), k1, k2))


def cameras_of(arrays: CameraArrays, cameras: Sequence[Camera]) -> tuple[Camera, ...]:
    """The given cameras with the intrinsics and poses of the arrays."""
    values = zip(arrays.lenses.focal, arrays.lenses.centre.T, arrays.lenses.k1, arrays.lenses.k2, strict=True)
    return tuple(
        replace(
            camera,
            focal=float(focal),
            centre=(float(x), float(y)),
            cam_from_world=np.ascontiguousarray(turn),
            k1=float(k1),
            k2=float(k2),
        )
        for camera, turn, (focal, (x, y), k1, k2) in zip(cameras, arrays.turns.transpose(2, 0, 1), values, strict=True)
    )


@dataclass(frozen=True)
class View:
    """What the cameras make of m matches.

    value: (2, m) px of photo j, the residual; large where a ray falls behind the camera
    seen:  (m,) whether it does not
    plane_i, plane_j: (2, m) ideal image coordinates in photo i, and in photo j where they arrive
    j_from_i: (3, 3, m) relative rotation; depth: (m,) of the arriving ray (x, y, 1) along the axis of camera j
    """

    cameras: CameraArrays
    lens_i: Lenses
    lens_j: Lenses
    value: Floats
    seen: NDArray[np.bool_]
    plane_i: Floats
    plane_j: Floats
    j_from_i: Floats
    depth: Floats


def view(cameras: CameraArrays, matches: Matches) -> View:
    """Residuals, with what was computed on the way."""
    lens_i, lens_j = cameras.lenses.of(matches.i), cameras.lenses.of(matches.j)
    distorted = (matches.xy_i - lens_i.centre) / lens_i.focal
    plane = np.asarray(lens.undistort(distorted.T, lens_i.k1, lens_i.k2)).T
    relative = _relative(cameras, matches)
    local = relative[:, 0] * plane[0] + relative[:, 1] * plane[1] + relative[:, 2]
    forward = local[2] > 1e-6
    depth = np.where(forward, local[2], 1.0)
    ideal = local[:2] / depth
    square = ideal[0] ** 2 + ideal[1] ** 2
    seen = forward & (square < lens.fold(lens_j.k1, lens_j.k2))
    xy = lens_j.focal * ideal * lens.factor(square, lens_j.k1, lens_j.k2) + lens_j.centre
    value = np.where(seen, xy - matches.xy_j, BEHIND)
    return View(cameras, lens_i, lens_j, value, seen, plane, ideal, relative, depth)


def _relative(cameras: CameraArrays, matches: Matches) -> Floats:
    """Rotation (3, 3, m) from camera i to camera j of each match."""
    first = matches.bounds[:-1]
    turns = cameras.turns.transpose(2, 0, 1)
    pairs = np.matmul(turns[matches.j[first]], turns[matches.i[first]].transpose(0, 2, 1))
    return np.repeat(np.ascontiguousarray(pairs.transpose(1, 2, 0)), np.diff(matches.bounds), axis=2)


@dataclass(frozen=True)
class Tangent:
    """Derivatives (2, 2, m) of the residual by ideal point in photo j, by ideal point in photo i, by px of photo i."""

    by_plane_j: Floats
    by_plane_i: Floats
    by_point: Floats


def tangent(view: View) -> Tangent:
    """Derivatives by what a match passes through on its way from photo i to photo j; zero where it is not seen."""
    q = view.plane_j
    square = q[0] ** 2 + q[1] ** 2
    focal = np.where(view.seen, view.lens_j.focal, 0.0)
    bend = focal * (2 * view.lens_j.k1 + 4 * view.lens_j.k2 * square)
    last = np.empty((2, 2, len(square)))
    last[0, 1] = last[1, 0] = bend * q[0] * q[1]
    last[[0, 1], [0, 1]] = focal * lens.factor(square, view.lens_j.k1, view.lens_j.k2) + bend * q**2
    # by the depth it is divided by, a ray moves towards the middle
    turned = (view.j_from_i[:2, :2] - q[:, None] * view.j_from_i[2, :2]) / view.depth
    first = last[:, :1] * turned[0] + last[:, 1:] * turned[1]
    return Tangent(last, first, _by_point(view, first))


def _by_point(view: View, by_plane: Floats) -> Floats:
    """Derivative (2, 2, m) by the pixels of photo i. The inverse of `f (factor I + bend x x^T)`, Sherman-Morrison."""
    x, lens_i = view.plane_i, view.lens_i
    if not (lens_i.k1.any() or lens_i.k2.any()):
        return np.asarray(by_plane / lens_i.focal)
    square = x[0] ** 2 + x[1] ** 2
    factor, slope = lens.factor(square, lens_i.k1, lens_i.k2), lens.slope(square, lens_i.k1, lens_i.k2)
    along = (by_plane[:, 0] * x[0] + by_plane[:, 1] * x[1]) * ((2 * lens_i.k1 + 4 * lens_i.k2 * square) / slope)
    return np.asarray((by_plane - along[:, None] * x) / (factor * lens_i.focal))


def by_turn(view: View, tangent: Tangent) -> Floats:
    """Derivative (2, 3, m) by a rotation of the ray in the axes of camera j."""
    x, y = view.plane_j
    xy = x * y
    # the ideal point moves by v x (x, y, 1), and then towards the middle by the change of the depth
    moves = np.stack([np.stack([-xy, 1 + x * x, -y]), np.stack([-1 - y * y, xy, x])])
    return np.asarray(tangent.by_plane_j[:, :1] * moves[0] + tangent.by_plane_j[:, 1:] * moves[1])


def by_lens(view: View, tangent: Tangent, *, terms: int, centres: bool) -> tuple[Floats, Floats]:
    """Derivatives (2, c, m) by the lens of photo i and by that of photo j.

    Columns: relative focal length, as many of (k1, k2) as `terms`, and the centre (px) if `centres`.
    """
    x, y = view.plane_i
    square = x * x + y * y
    slope = lens.slope(square, view.lens_i.k1, view.lens_i.k2)
    # the ideal radius r solves r (1 + k1 r^2 + k2 r^4) = distorted radius: the implicit function theorem
    along = -(tangent.by_plane_i[:, 0] * x + tangent.by_plane_i[:, 1] * y) / slope
    first = [along * p for p in _powers(square, view.lens_i, terms)]
    ideal = view.plane_j
    radial = np.where(view.seen, view.lens_j.focal, 0.0) * ideal
    second = [radial * p for p in _powers(ideal[0] ** 2 + ideal[1] ** 2, view.lens_j, terms)]
    if centres:
        first += [-tangent.by_point[:, 0], -tangent.by_point[:, 1]]
        one, none = view.seen.astype(np.float64), np.zeros(len(view.seen))
        second += [np.stack([one, none]), np.stack([none, one])]
    return np.stack(first, axis=1), np.stack(second, axis=1)


def _powers(square: Floats, lenses: Lenses, terms: int) -> list[Floats]:
    """What focal length, k1 and k2 are multiplied by along the radius."""
    return [lens.factor(square, lenses.k1, lenses.k2), square, square**2][: 1 + terms]
