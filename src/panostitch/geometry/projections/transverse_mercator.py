"""Transverse Mercator: Mercator along the meridian straight ahead; shapes are kept, any height, never sideways.

u = atanh(cos latitude sin longitude), v = atan2(tan latitude, cos longitude). Snyder 1987, chapter 8.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def forward(rays: Floats) -> Floats:
    """Rays (n, 3) to the plane (n, 2); NaN straight right and left."""
    radius = np.hypot(rays[:, 1], rays[:, 2])
    with np.errstate(divide="ignore", invalid="ignore"):
        aside = np.where(radius > 1e-9 * np.abs(rays[:, 0]), np.arcsinh(rays[:, 0] / radius), np.nan)
    return np.column_stack([aside, np.arctan2(rays[:, 1], rays[:, 2])])


def inverse(uv: Floats) -> Floats:
    """The plane (n, 2) to rays (n, 3); NaN beyond straight back, above or below."""
    height = np.where(np.abs(uv[:, 1]) <= np.pi + 1e-9, uv[:, 1], np.nan)
    flat = 1 / np.cosh(np.clip(uv[:, 0], -700, 700))
    return np.column_stack([np.tanh(uv[:, 0]), np.sin(height) * flat, np.cos(height) * flat])
