"""Which way is up: the horizon is levelled by the photographer's own habits.

People hold a camera level far better than they hold it upright: the x axes of the cameras are all nearly horizontal,
whatever their pitch (Brown & Lowe 2007, section 5). A weak belief that cameras look at the horizon settles what a
narrow panorama leaves open. Both are squares, so the best up vector is an eigenvector.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from panostitch.geometry import rotation
from panostitch.model.camera import Camera

Floats = NDArray[np.float64]

ROLL_SPREAD = np.deg2rad(2.0)  # how far from level hand-held cameras are
PITCH_SPREAD = np.deg2rad(25.0)


def straighten(cameras: Sequence[Camera]) -> tuple[Camera, ...]:
    """The cameras in a world whose y axis points down and whose z axis points at the middle of the view."""
    axes = np.array([camera.cam_from_world for camera in cameras])
    right, down, forward = axes[:, 0], axes[:, 1], axes[:, 2]
    spread = right.T @ right / ROLL_SPREAD**2 + forward.T @ forward / PITCH_SPREAD**2
    vertical = np.linalg.eigh(spread)[1][:, 0]
    if vertical @ down.sum(0) < 0:
        vertical = -vertical
    return centre(cameras, vertical)


def centre(cameras: Sequence[Camera], down: Floats) -> tuple[Camera, ...]:
    """The cameras in a world with this y axis, looking along z at the middle of the directions they cover."""
    forward = np.array([camera.cam_from_world[2] for camera in cameras])
    level = forward - np.outer(forward @ down, down)
    middle = level.sum(0)
    if np.linalg.norm(middle) < 0.2 * len(cameras):
        middle = _opposite_of_gap(level, down)  # a ring has no middle: open it where it is thinnest
    z = middle / max(float(np.linalg.norm(middle)), 1e-12)
    old_from_new = rotation.nearest(np.column_stack([np.cross(down, z), down, z]))
    return tuple(camera.turned(old_from_new) for camera in cameras)


def _opposite_of_gap(level: Floats, down: Floats) -> Floats:
    """The direction opposite to the middle of the largest gap between the directions (n, 3)."""
    x = level[0] / max(float(np.linalg.norm(level[0])), 1e-12)
    y = np.cross(down, x)
    angles = np.sort(np.arctan2(level @ y, level @ x))
    gaps = np.diff(np.append(angles, angles[0] + 2 * np.pi))
    # equal gaps differ by rounding only: take the first of the largest
    widest = int(np.flatnonzero(gaps > gaps.max() - 1e-6)[0])
    away = angles[widest] + gaps[widest] / 2 + np.pi
    return np.asarray(np.cos(away) * x + np.sin(away) * y)
