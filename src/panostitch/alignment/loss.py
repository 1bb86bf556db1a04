"""A robust loss: what a residual costs, and how much its match then counts.

Cauchy's: half the square where a residual is small, hardly more where it is large. Huber, "Robust Statistics", 1981.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def cost(square: Floats, scale: float) -> float:
    """Sum of the losses (px^2) of residuals whose squared lengths (m,) px^2 are given; `scale` in px."""
    return float(0.5 * scale**2 * np.log1p(square / scale**2).sum())


def weight(square: Floats, scale: float) -> Floats:
    """Weights (m,), 0 to 1, under which least squares has the gradient of the loss."""
    return np.asarray(1 / (1 + square / scale**2))


def noise(square: Floats, scale: float) -> float:
    """Root mean square (px) of each of the two numbers of a residual, those counting less that are far off."""
    w = weight(square, scale)
    return float(np.sqrt((w * square).sum() / (2 * w.sum())))


def variance(square: Floats, scale: float, unknowns: int) -> float:
    """By what the inverse of the weighted normal equations is multiplied to become a covariance; px^2.

    Huber's formula for estimates from a loss instead of squares, residuals being two numbers each. Infinite where the
    residuals are no more than the unknowns.
    """
    surplus = 2 * len(square) - unknowns
    if surplus <= 0:
        return float("inf")
    w = weight(square, scale)
    # mean derivative of w r by r, over both directions of r
    steepness = float((w - w**2 * square / scale**2).mean())
    return float((w**2 * square).sum() / surplus * w.mean() / max(steepness, 1e-3) ** 2)
