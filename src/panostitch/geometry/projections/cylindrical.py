"""Cylindrical: verticals stay straight, any width, less than 180 degrees high."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def forward(rays: Floats) -> Floats:
    """Rays (n, 3) to the plane (n, 2); NaN at the poles."""
    radius = np.hypot(rays[:, 0], rays[:, 2])
    with np.errstate(divide="ignore", invalid="ignore"):
        height = np.where(radius > 1e-9, rays[:, 1] / radius, np.nan)
    return np.column_stack([np.arctan2(rays[:, 0], rays[:, 2]), height])


def inverse(uv: Floats) -> Floats:
    """The plane (n, 2) to rays (n, 3)."""
    return np.column_stack([np.sin(uv[:, 0]), uv[:, 1], np.cos(uv[:, 0])])
