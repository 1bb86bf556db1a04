"""Compressed rectilinear: verticals stay straight, so do horizontals of a wall straight ahead; slanting lines bend.

u = 2 tan(longitude / 2), v = tan latitude / cos longitude: the sides of a rectilinear picture are pushed together, as
in drawings of architecture; less than 180 degrees. OpenCV's CompressedRectilinearWarper with A = 2, B = 1.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def forward(rays: Floats) -> Floats:
    """Rays (n, 3) to the plane (n, 2); NaN for rays that do not point forward.

    u = 2 x / (z + hypot(x, z)), v = y / z.
    """
    depth = np.where(rays[:, 2] > 1e-9, rays[:, 2], np.nan)
    return np.column_stack([2 * rays[:, 0] / (depth + np.hypot(rays[:, 0], depth)), rays[:, 1] / depth])


def inverse(uv: Floats) -> Floats:
    """The plane (n, 2) to rays (n, 3); NaN beyond 90 degrees to the side: x / z = u / (1 - u^2 / 4)."""
    half = np.where(np.abs(uv[:, 0]) < 2, uv[:, 0] / 2, np.nan)
    return np.column_stack([2 * half / (1 - half**2), uv[:, 1], np.where(np.isfinite(half), 1.0, np.nan)])
