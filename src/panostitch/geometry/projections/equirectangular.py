"""Equirectangular: longitude and latitude; the whole sphere."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def forward(rays: Floats) -> Floats:
    """Rays (n, 3) to the plane (n, 2)."""
    radius = np.hypot(rays[:, 0], rays[:, 2])
    return np.column_stack([np.arctan2(rays[:, 0], rays[:, 2]), np.arctan2(rays[:, 1], radius)])


def inverse(uv: Floats) -> Floats:
    """The plane (n, 2) to rays (n, 3); NaN beyond the poles."""
    longitude, latitude = uv[:, 0], np.where(np.abs(uv[:, 1]) <= np.pi / 2 + 1e-9, uv[:, 1], np.nan)
    flat = np.cos(latitude)
    return np.column_stack([np.sin(longitude) * flat, np.sin(latitude), np.cos(longitude) * flat])
