"""What projections around straight ahead have in common: an angle from it becomes a distance from the middle.

With theta the angle between a ray and straight ahead, a point lies in the direction of its ray at distance r(theta) of
the middle (Snyder 1987, Map Projections: A Working Manual, chapter 20, calls them azimuthal).
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def angles(rays: Floats) -> tuple[Floats, Floats]:
    """Angles (n,) from straight ahead, and unit vectors (n, 2) to the side; straight back is said to lie right."""
    aside = np.hypot(rays[:, 0], rays[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        towards = np.where(aside[:, None] > 0, rays[:, :2] / aside[:, None], [1.0, 0.0])
    return np.arctan2(aside, rays[:, 2]), np.asarray(towards)
