"""Equidistant fisheye: r = theta; angles from straight ahead are to scale; the whole sphere in a circle.

Snyder 1987, chapter 25 (azimuthal equidistant).
"""

import numpy as np
from numpy.typing import NDArray

from panostitch.geometry.projections.azimuthal import angles

Floats = NDArray[np.float64]


def forward(rays: Floats) -> Floats:
    """Rays (n, 3) to the plane (n, 2)."""
    theta, towards = angles(rays)
    return np.asarray(theta[:, None] * towards)


def inverse(uv: Floats) -> Floats:
    """The plane (n, 2) to rays (n, 3); NaN beyond straight back."""
    radius = np.hypot(uv[:, 0], uv[:, 1])
    theta = np.where(radius <= np.pi + 1e-9, radius, np.nan)
    return np.column_stack([uv * np.sinc(theta / np.pi)[:, None], np.cos(theta)])
