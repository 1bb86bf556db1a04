"""Rectilinear: straight lines stay straight; less than 180 degrees."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def forward(rays: Floats) -> Floats:
    """Rays (n, 3) to the plane (n, 2); NaN for rays that do not point forward."""
    depth = np.where(rays[:, 2:] > 1e-9, rays[:, 2:], np.nan)
    return np.asarray(rays[:, :2] / depth)


def inverse(uv: Floats) -> Floats:
    """The plane (n, 2) to rays (n, 3)."""
    return np.column_stack([uv, np.ones(len(uv))])
