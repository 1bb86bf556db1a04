"""Panini: verticals and lines through the middle stay straight; wide views without the stretch of rectilinear.

A cylinder seen from a point `distance` radii behind its axis: with S = (d + 1) / (d + cos longitude), u = S sin
longitude, v = S tan latitude. d = 0 is rectilinear, d = 1 the usual one, a large d squeezes the sides. Sharpless,
Postle & German 2010, Pannini: A New Projection for Rendering Wide Angle Perspective Images.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

DISTANCE = 1.0


def forward(rays: Floats, distance: float = DISTANCE) -> Floats:
    """Rays (n, 3) to the plane (n, 2); NaN behind the farthest longitude, and at the poles."""
    radius = np.hypot(rays[:, 0], rays[:, 2])
    with np.errstate(divide="ignore", invalid="ignore"):
        sine, cosine, tangent = rays[:, 0] / radius, rays[:, 2] / radius, rays[:, 1] / radius
        nearest = -min(distance, 1 / distance) if distance else 0.0
        shown = (cosine > nearest + 1e-9) & (radius > 1e-9 * np.abs(rays[:, 1]))
        stretch = np.where(shown, (distance + 1) / (distance + cosine), np.nan)
    return np.column_stack([stretch * sine, stretch * tangent])


def inverse(uv: Floats, distance: float = DISTANCE) -> Floats:
    """The plane (n, 2) to rays (n, 3); NaN where nothing is shown.

    With k = u^2 / (d + 1)^2: cos longitude = (-k d + sqrt(1 + k (1 - d^2))) / (1 + k).
    """
    k = (uv[:, 0] / (distance + 1)) ** 2
    square = 1 + k * (1 - distance**2)
    cosine = (-k * distance + np.sqrt(np.where(square >= 0, square, np.nan))) / (1 + k)
    shrink = (distance + cosine) / (distance + 1)
    return np.column_stack([uv * shrink[:, None], cosine])
