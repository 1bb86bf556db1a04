"""What directions the photos cover: rays all over them, and the arc of longitudes."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from panostitch.model.camera import Camera

Floats = NDArray[np.float64]

GRID = 24  # rays along each side of a photo that find its extent
AROUND = 720  # rays around a point where a projection ends
HAIR = 1e-9  # radians
POLES = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])


def rays_over(cameras: Sequence[Camera]) -> Floats:
    """Rays (n, 3) all over the photos: their outlines, and where projections end or tear, if a photo shows it."""
    return np.vstack([*(camera.rays(_grid(camera)) for camera in cameras), _at_ends(cameras)])


def shows_pole(cameras: Sequence[Camera]) -> bool:
    """Whether a photo shows the zenith or the nadir."""
    return bool(covered_rays(cameras, POLES).any())


def arc(cameras: Sequence[Camera]) -> tuple[float, float]:
    """Start and width (radians of longitude) of what the photos cover, without the widest gap between them."""
    if shows_pole(cameras):
        return -np.pi, 2 * np.pi
    intervals = sorted(_interval(camera) for camera in cameras)
    first = intervals[0][0]
    gaps, end = [], first
    for start, width in [*intervals, (first + 2 * np.pi, 0.0)]:
        gaps.append((start - end, start))
        end = max(end, start + width)
    gap, start = max(gaps)
    if start > np.pi / 2:  # keep straight ahead inside the canvas, where the photos were centred
        start -= 2 * np.pi
    return float(start), float(2 * np.pi - max(gap, 0.0))


def _interval(camera: Camera) -> tuple[float, float]:
    """Start in -pi..pi and width (radians of longitude) of what one photo covers; it must not show a pole."""
    rays, ahead = camera.rays(_grid(camera)), camera.cam_from_world[2]
    middle = np.arctan2(ahead[0], ahead[2])
    aside = (np.arctan2(rays[:, 0], rays[:, 2]) - middle + np.pi) % (2 * np.pi) - np.pi
    start = (middle + aside.min() + np.pi) % (2 * np.pi) - np.pi
    return float(start), float(aside.max() - aside.min())


def _grid(camera: Camera) -> Floats:
    """Pixels (n, 2) all over a photo, its outline among them."""
    width, height = camera.size
    x, y = np.meshgrid(np.linspace(-0.5, width - 0.5, GRID), np.linspace(-0.5, height - 0.5, GRID))
    return np.column_stack([x.ravel(), y.ravel()])


def _at_ends(cameras: Sequence[Camera]) -> Floats:
    """Rays (n, 3) around zenith, nadir and straight back, and on both sides of the horizon behind: those in a photo."""
    turn = np.linspace(-np.pi, np.pi, AROUND)
    x, y, one = HAIR * np.cos(turn), HAIR * np.sin(turn), np.ones(AROUND)
    behind = np.linspace(np.pi / 2, 3 * np.pi / 2, AROUND)
    horizon = [np.column_stack([np.sin(behind), s * HAIR * one, np.cos(behind)]) for s in (-1, 1)]
    rings = [np.column_stack([y, -one, x]), np.column_stack([y, one, x]), np.column_stack([x, y, -one])]
    rays = np.vstack([*rings, *horizon])
    return np.asarray(rays[covered_rays(cameras, rays)])


def covered_rays(cameras: Sequence[Camera], rays: Floats) -> NDArray[np.bool_]:
    """Which rays (n,) a photo shows; none that are NaN."""
    seen = np.zeros(len(rays), bool)
    with np.errstate(invalid="ignore"):
        for camera in cameras:
            xy = camera.project(rays)
            seen |= ((xy >= -0.5) & (xy <= np.array(camera.size) - 0.5)).all(1)
    return seen
