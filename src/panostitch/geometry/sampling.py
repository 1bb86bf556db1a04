"""The pixel-centre rule, written once: pixel (0, 0) is the centre of the top-left pixel.

A coordinate x of a picture becomes `(x + 0.5) * s - 0.5` in the same picture at s times the size.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def rescale(xy: NDArray[np.floating], factor: float | Floats) -> Floats:
    """Move coordinates (..., 2) px from a picture to the same picture at `factor` times its size.

    `factor` is one number, or one for each axis (2,).
    """
    return np.asarray((np.asarray(xy, np.float64) + 0.5) * factor - 0.5, np.float64)
