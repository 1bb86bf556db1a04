"""Radial lens distortion, Brown-Conrady as in OpenCV: `x' = x (1 + k1 r^2 + k2 r^4)`, x in focal lengths.

k1 and k2 are numbers, or arrays (n,) with a lens for each of n points.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Coefficient = float | Floats

NEWTON_STEPS = 12
CONVERGED = 1e-13  # focal lengths
WIDEST = 1e6  # square of a radius that no lens reaches


def factor(square: Floats, k1: Coefficient, k2: Coefficient) -> Floats:
    """By how much (n,) a point at the radius whose square (n,) is given moves outwards."""
    return np.asarray(1 + square * (k1 + square * k2))


def slope(square: Floats, k1: Coefficient, k2: Coefficient) -> Floats:
    """Derivative (n,) of the distorted with respect to the ideal radius."""
    return np.asarray(1 + square * (3 * np.asarray(k1) + square * 5 * k2))


def fold(k1: Coefficient, k2: Coefficient) -> Floats:
    """Square of the radius at which the polynomial turns back; rays beyond it are not in the picture."""
    b, a = 3 * np.asarray(k1, np.float64), 5 * np.asarray(k2, np.float64)  # 1 + b s + a s^2 = 0
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(b * b - 4 * a)
        # in this form the root stays exact, and right, where a vanishes
        candidates = np.stack([2 / (-b + root), 2 / (-b - root)])
    candidates = np.where((candidates > 0) & np.isfinite(candidates), candidates, np.inf)
    return np.asarray(np.minimum(candidates.min(0), WIDEST))


def distort(xy: Floats, k1: Coefficient, k2: Coefficient) -> Floats:
    """Ideal to distorted coordinates (n, 2); NaN beyond the fold."""
    if not (np.any(k1) or np.any(k2)):
        return xy
    square = (xy**2).sum(1)
    square = np.where(square < fold(k1, k2), square, np.nan)
    return np.asarray(xy * factor(square, k1, k2)[:, None])


def undistort(xy: Floats, k1: Coefficient, k2: Coefficient) -> Floats:
    """Distorted to ideal coordinates (n, 2), by Newton's method on the radius; at most out to the fold."""
    if not (np.any(k1) or np.any(k2)):
        return xy
    distorted = np.hypot(xy[:, 0], xy[:, 1])
    limit = np.sqrt(fold(k1, k2))
    radius = np.minimum(distorted, limit)
    for _ in range(NEWTON_STEPS):
        square = radius**2
        step = (radius * factor(square, k1, k2) - distorted) / np.maximum(slope(square, k1, k2), 1e-3)
        radius = np.clip(radius - step, 0, limit)
        if np.abs(step).max(initial=0.0) < CONVERGED:
            break
    return np.asarray(xy * (radius / np.maximum(distorted, 1e-12))[:, None])
