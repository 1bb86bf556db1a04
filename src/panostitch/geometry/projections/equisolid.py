"""Equisolid fisheye: r = 2 sin(theta / 2); equal solid angles have equal areas; the whole sphere in a circle.

Snyder 1987, chapter 24 (Lambert azimuthal equal-area).
"""

import numpy as np
from numpy.typing import NDArray

from panostitch.geometry.projections.azimuthal import angles

Floats = NDArray[np.float64]


def forward(rays: Floats) -> Floats:
    """Rays (n, 3) to the plane (n, 2)."""
    theta, towards = angles(rays)
    return np.asarray(2 * np.sin(theta / 2)[:, None] * towards)


def inverse(uv: Floats) -> Floats:
    """The plane (n, 2) to rays (n, 3); NaN beyond straight back.

    With s = sin(theta / 2) = r / 2: sin theta = 2 s sqrt(1 - s^2), cos theta = 1 - 2 s^2.
    """
    square = (uv**2).sum(1) / 4
    cosine = np.sqrt(np.where(square <= 1 + 1e-9, np.maximum(1 - square, 0), np.nan))
    return np.column_stack([uv * cosine[:, None], 1 - 2 * square])
