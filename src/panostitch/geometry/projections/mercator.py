"""Mercator: u = longitude, v = asinh(tan latitude); shapes are kept, any width, never the poles.

Snyder 1987, chapter 7.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def forward(rays: Floats) -> Floats:
    """Rays (n, 3) to the plane (n, 2); NaN at the poles."""
    radius = np.hypot(rays[:, 0], rays[:, 2])
    with np.errstate(divide="ignore", invalid="ignore"):
        height = np.where(radius > 1e-9 * np.abs(rays[:, 1]), np.arcsinh(rays[:, 1] / radius), np.nan)
    return np.column_stack([np.arctan2(rays[:, 0], rays[:, 2]), height])


def inverse(uv: Floats) -> Floats:
    """The plane (n, 2) to rays (n, 3): cos latitude = 1 / cosh v, sin latitude = tanh v."""
    flat = 1 / np.cosh(np.clip(uv[:, 1], -700, 700))
    return np.column_stack([np.sin(uv[:, 0]) * flat, np.tanh(uv[:, 1]), np.cos(uv[:, 0]) * flat])
