"""From stored pixels to those that are asked for: at a scale, and upright."""

from typing import Any, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

TRANSPOSED = (5, 6, 7, 8)  # EXIF orientations that swap width and height
Array = TypeVar("Array", bound=NDArray[Any])


def asked_for(array: Array, whole: tuple[int, int], scale: float, orientation: int) -> Array:
    """Stored pixels (h, w, ...), whole or reduced already, at `scale` <= 1 of the whole (width, height) and upright."""
    if scale < 1:
        size = max(1, round(whole[0] * scale)), max(1, round(whole[1] * scale))
        array = cv2.resize(array, size, interpolation=cv2.INTER_AREA)  # type: ignore[assignment]
    return upright(array, orientation)


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
