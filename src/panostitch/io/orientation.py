"""Turning stored pixels upright."""

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

TRANSPOSED = (5, 6, 7, 8)  # EXIF orientations that swap width and height
Array = TypeVar("Array", bound=NDArray[Any])


def upright(array: Array, orientation: int) -> Array:
    """Apply an EXIF orientation (1 to 8) to an array (h, w, ...)."""
    turned: Any = array
    if orientation in TRANSPOSED:
        turned = turned.swapaxes(0, 1)
    if orientation in (2, 3, 6, 7):
        turned = turned[:, ::-1]
    if orientation in (3, 4, 7, 8):
        turned = turned[::-1]
    return np.ascontiguousarray(turned)  # type: ignore[return-value]
