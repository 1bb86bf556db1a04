"""Miller: u = longitude, v = 1.25 asinh(tan(0.8 latitude)); Mercator made milder: any width, with the poles.

Snyder 1987, chapter 11.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

HIGHEST = 1.25 * np.arcsinh(np.tan(0.4 * np.pi))  # v of the poles


def forward(rays: Floats) -> Floats:
    """Rays (n, 3) to the plane (n, 2)."""
    latitude = np.arctan2(rays[:, 1], np.hypot(rays[:, 0], rays[:, 2]))
    return np.column_stack([np.arctan2(rays[:, 0], rays[:, 2]), 1.25 * np.arcsinh(np.tan(0.8 * latitude))])


def inverse(uv: Floats) -> Floats:
    """The plane (n, 2) to rays (n, 3); NaN beyond the poles: latitude = 1.25 atan(sinh(0.8 v))."""
    height = np.where(np.abs(uv[:, 1]) <= HIGHEST + 1e-9, uv[:, 1], np.nan)
    latitude = 1.25 * np.arctan(np.sinh(0.8 * height))
    flat = np.cos(latitude)
    return np.column_stack([np.sin(uv[:, 0]) * flat, np.sin(latitude), np.cos(uv[:, 0]) * flat])
