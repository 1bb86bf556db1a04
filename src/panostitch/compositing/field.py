"""What is to be seen: all that the photos cover, or the field of view that was asked for, about straight ahead."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.coverage import arc, rays_over
from panostitch.errors import UsageError
from panostitch.geometry.projections import PROJECTIONS
from panostitch.model.camera import Camera
from panostitch.options import LayoutOptions

Floats = NDArray[np.float64]

STEPS = 181  # rays along the horizon, and along the meridian straight ahead
ASTRAY = 1e-6  # by which the edge of a field may leave its axis in the plane, focal lengths


@dataclass(frozen=True)
class View:
    """What the canvas is to hold.

    rays:         (n, 3) all over it
    start, width: arc of longitudes, radians
    across, down: the field of view that was asked for, radians; 0 where the photos decide
    """

    rays: Floats
    start: float
    width: float
    across: float = 0.0
    down: float = 0.0


def view_of(cameras: Sequence[Camera], options: LayoutOptions) -> View:
    """All that the photos cover, or what was asked for of it. Raises UsageError where no photo shows any of that."""
    if options.field is None:
        return View(rays_over(cameras), *arc(cameras))
    across, down = (np.deg2rad(angle or 0.0) for angle in options.field)
    if options.projection == "little-planet" and not down:
        down = across  # seen from above all sides are alike
    if down:
        return View(np.vstack([_arc_of(across, 0), _arc_of(down, 1)]), -across / 2, across, across, down)
    rays = rays_over(cameras)
    rays = rays[np.abs(np.arctan2(rays[:, 0], rays[:, 2])) <= across / 2]
    if not len(rays):
        raise UsageError(
            f"--fov {options.fov}: no photo is straight ahead",
            hint="turn there with --center-on or --yaw, or say how high as well, as in 90x60",
        )
    return View(rays, -across / 2, across, across)


def half_extent(projection: str, parameters: tuple[float, ...], angle: float, *, axis: int) -> float:
    """How far from straight ahead, in focal lengths, the plane shows half an angle (radians) across (0) or down (1).

    Raises UsageError where the projection does not reach so far.
    """
    edge = PROJECTIONS[projection].forward(_toward(np.array([angle / 2]), axis), *parameters)[0]
    if not (edge[axis] > 0 and abs(edge[1 - axis]) < ASTRAY):
        raise UsageError(
            f"--fov: {projection} does not show {np.rad2deg(angle):.0f} degrees {('across', 'down')[axis]}",
            hint="ask for less, or use --projection equirectangular, which shows 360x180",
        )
    return float(edge[axis])


def _arc_of(angle: float, axis: int) -> Floats:
    return _toward(np.linspace(-angle / 2, angle / 2, STEPS), axis)


def _toward(angles: Floats, axis: int) -> Floats:
    """Rays (n, 3) at these angles from straight ahead: to the right (axis 0) or down (1)."""
    rays = np.zeros((len(angles), 3))
    rays[:, axis], rays[:, 2] = np.sin(angles), np.cos(angles)
    return rays
