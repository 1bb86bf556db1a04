"""Cameras by their angles: turned about one point, or in front of a plane."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from panostitch.geometry.rotation import from_angles
from panostitch.model.camera import Camera

Angles = Sequence[float] | NDArray[np.floating] | float


def rig(
    yaws: Angles,
    pitches: Angles = 0.0,
    rolls: Angles = 0.0,
    *,
    size: tuple[int, int],
    focal: float | None = None,
    hfov: float | None = None,
    k1: float = 0.0,
    k2: float = 0.0,
) -> list[Camera]:
    """Cameras turned about one point (radians; see `geometry.rotation.from_angles`), all with the same lens.

    Give `focal` in px or `hfov`, the horizontal field of view in radians before distortion.
    """
    if (focal is None) == (hfov is None):
        raise ValueError("give either focal or hfov")
    length = focal if focal is not None else size[0] / 2 / np.tan((hfov or 0.0) / 2)
    centre = ((size[0] - 1) / 2, (size[1] - 1) / 2)
    angles = np.broadcast_arrays(*(np.atleast_1d(np.asarray(a, np.float64)) for a in (yaws, pitches, rolls)))
    return [
        Camera(size, float(length), centre, from_angles(*(float(a) for a in turn)), k1, k2)
        for turn in zip(*angles, strict=True)
    ]


def step_for_overlap(overlap: float, hfov: float) -> float:
    """Yaw (radians) between level photos that share this part (0 to 1) of their width in each of them."""
    half = hfov / 2
    return float(half + np.arctan((1 - 2 * overlap) * np.tan(half)))


def view_of_plane(
    size: tuple[int, int], *, focal: float, at: tuple[float, float, float], turn: tuple[float, float, float]
) -> Camera:
    """A camera that looks at the plane z = 0 of a flat scene; its rays are then (x, y, 1) on that plane.

    focal: px
    at:    place of the camera; x right, y down, z = -d for d units before the plane
    turn:  yaw, pitch, roll in radians; zero looks straight at it
    """
    intrinsics = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]])
    rotation = from_angles(*turn)
    # the plane's point (x, y, 0) seen from `at`: R ((x, y, 0) - at) = R [e1 e2 -at] (x, y, 1)
    homography = intrinsics @ rotation @ np.column_stack([np.eye(3)[:, :2], -np.array(at)])
    return Camera(size, 1.0, (0.0, 0.0), homography / homography[2, 2])
