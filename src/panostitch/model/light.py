"""What makes photos equally bright: factors of their light, for each channel, and the fall-off of their lenses."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Encoded value = linear light ** (1 / GAMMA): a camera's tone curve is taken for a power law, under which a factor of
# the light is a factor of the encoded values as well.
GAMMA = 2.2
TERMS = 3  # of the fall-off: r^2, r^4, r^6


@dataclass(frozen=True)
class Light:
    """The correction of n photos.

    gains:    (n, 3) factor on the encoded pixels of each channel
    fall_off: (n, 3) a, b, c: of linear light, exp(-(a r^2 + b r^4 + c r^6)) is left at the radius r, which is 1 in
              the corners of the photo; all at least 0
    reason:   why these, one sentence
    spared:   for each photo a coarse map (rows, columns, 3) of it, 0..1: the share of a gain below 1 that white is
              spared there, as the photo is burnt; None where it is not, or not darkened; empty for no photo
    """

    gains: Floats
    fall_off: Floats
    reason: str = ""
    spared: tuple[NDArray[np.float32] | None, ...] = ()

    @property
    def brightness(self) -> Floats:
        """Factor (n,) on each photo's encoded pixels, the geometric mean of its channels."""
        return np.asarray(np.exp(np.log(self.gains).mean(1)))

    def has_fall_off(self, photo: int) -> bool:
        """Whether the photo is brightened towards its corners."""
        return bool(self.fall_off[photo].any())

    def brightening(self, photo: int, square: Floats) -> Floats:
        """Factor (...) on encoded pixels that undoes the fall-off where the square of the radius is `square` (...)."""
        a, b, c = self.fall_off[photo] / GAMMA
        return np.asarray(np.exp(square * (a + square * (b + square * c))))


def unchanged(count: int, reason: str = "") -> Light:
    """The light of photos that stay as they are."""
    return Light(np.ones((count, 3)), np.zeros((count, TERMS)), reason)


def radius_square(xy: Floats, size: tuple[int, int]) -> Floats:
    """Square of the radius (...) of pixels (..., 2) of a photo of this size; 1 in its corners."""
    x, y = (xy[..., k] - (size[k] - 1) / 2 for k in (0, 1))  # NumPy is slow along so short an axis
    return np.asarray(4 * (x * x + y * y) / (size[0] ** 2 + size[1] ** 2))
