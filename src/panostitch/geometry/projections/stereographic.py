"""Stereographic: r = 2 tan(theta / 2); shapes are kept, circles stay circles; all but straight back.

Looking straight down it makes a little planet. Snyder 1987, chapter 21.
"""

import numpy as np
from numpy.typing import NDArray

from panostitch.geometry.projections.azimuthal import angles

Floats = NDArray[np.float64]


def forward(rays: Floats) -> Floats:
    """Rays (n, 3) to the plane (n, 2); NaN straight back: 2 (x, y) / (|ray| + z)."""
    theta, towards = angles(rays)
    theta = np.where(theta < np.pi - 1e-9, theta, np.nan)
    return np.asarray(2 * np.tan(theta / 2)[:, None] * towards)


def inverse(uv: Floats) -> Floats:
    """The plane (n, 2) to rays (n, 3): with q = r^2 / 4, (u, v, 1 - q)."""
    return np.column_stack([uv, 1 - (uv**2).sum(1) / 4])
