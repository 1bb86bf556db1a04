"""Reprojection error between two turning cameras and its derivatives.

A point p of photo i is undistorted, turned into the frame of camera j, projected and distorted; the residual is its
distance to the matched point of photo j. Parameters of a camera: a rotation vector applied from the left to
`cam_from_world` (3), and its lens: relative change of the focal length, k1, k2 (3).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from panostitch.geometry.rotation import cross_matrix
from panostitch.model.camera import Camera

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Residuals:
    """Residuals of n matches, in px of photo j.

    value:          (n, 2); large where a ray falls behind the camera
    by_rotation_i, by_rotation_j, by_lens_i, by_lens_j: (n, 2, 3) derivatives
    """

    value: Floats
    by_rotation_i: Floats
    by_rotation_j: Floats
    by_lens_i: Floats
    by_lens_j: Floats


BEHIND = 1e3  # px, residual of a point that camera j cannot see; finite, so that a bad start can still improve


def reprojection(camera_i: Camera, camera_j: Camera, xy_i: Floats, xy_j: Floats) -> Floats:
    """Residuals (n, 2) px alone."""
    projected = camera_j.project(camera_i.rays(xy_i))
    return np.asarray(np.nan_to_num(projected - xy_j, nan=BEHIND))


def linearise(camera_i: Camera, camera_j: Camera, xy_i: Floats, xy_j: Floats) -> Residuals:
    """Residuals with their derivatives."""
    plane = camera_i.undistort((xy_i - camera_i.centre) / camera_i.focal)
    ray = np.column_stack([plane, np.ones(len(plane))])
    j_from_i = camera_j.cam_from_world @ camera_i.cam_from_world.T
    local = ray @ j_from_i.T
    seen = local[:, 2] > 1e-6
    depth = np.where(seen, local[:, 2], 1.0)
    ideal = local[:, :2] / depth[:, None]
    square = (ideal**2).sum(1)
    factor = 1 + square * (camera_j.k1 + square * camera_j.k2)
    projected = camera_j.focal * ideal * factor[:, None] + camera_j.centre

    by_local = _projection_by_ray(camera_j, ideal, square, factor, depth)
    by_ray = by_local @ j_from_i
    derivatives = [
        by_ray @ cross_matrix(ray),
        -by_local @ cross_matrix(local),
        by_ray[:, :, :2] @ _plane_by_lens(camera_i, plane),
        _projection_by_lens(camera_j, ideal, square, factor),
    ]
    for block in derivatives:
        block[~seen] = 0.0
    return Residuals(np.where(seen[:, None], projected - xy_j, BEHIND), *derivatives)


def _projection_by_ray(camera: Camera, ideal: Floats, square: Floats, factor: Floats, depth: Floats) -> Floats:
    """Derivative (n, 2, 3) of the pixel with respect to the ray in the camera's frame."""
    slope = 2 * camera.k1 + 4 * camera.k2 * square
    lens = slope[:, None, None] * ideal[:, :, None] * ideal[:, None, :] + factor[:, None, None] * np.eye(2)
    flat = np.concatenate([np.broadcast_to(np.eye(2), (len(ideal), 2, 2)), -ideal[:, :, None]], axis=2)
    return np.asarray(camera.focal * lens @ flat / depth[:, None, None])


def _projection_by_lens(camera: Camera, ideal: Floats, square: Floats, factor: Floats) -> Floats:
    """Derivative (n, 2, 3) of the pixel with respect to relative focal length, k1, k2."""
    columns = [factor, square, square**2]
    return np.asarray(camera.focal * ideal[:, :, None] * np.stack(columns, axis=1)[:, None, :])


def _plane_by_lens(camera: Camera, plane: Floats) -> Floats:
    """Derivative (n, 2, 3) of the undistorted point with respect to relative focal length, k1, k2.

    The undistorted radius r solves r (1 + k1 r^2 + k2 r^4) = distorted radius: the implicit function theorem.
    """
    square = (plane**2).sum(1)
    factor = 1 + square * (camera.k1 + square * camera.k2)
    slope = 1 + square * (3 * camera.k1 + square * 5 * camera.k2)
    columns = [-factor / slope, -square / slope, -(square**2) / slope]
    return np.asarray(plane[:, :, None] * np.stack(columns, axis=1)[:, None, :])
