"""How much two photos differ where a seam may run."""

import cv2
import numpy as np

from panostitch.compositing.seams.whole import Booleans, Floats

GRADIENT_WEIGHT = 1.0
# Grey levels: grass and leaves in the wind differ by as much. What differs by more counts by the square, so that a seam
# goes a long way round somebody who moved.
COMMON = 12.0
LEAST = 1e-3  # grey levels: zero is for pixels that only one of them shows


def difference_between(a: Floats, b: Floats, overlap: Booleans) -> Floats:
    """Grey levels (h, w) by which two pictures differ, in colour and in gradient; zero outside the overlap only."""
    thirds = np.full((1, 3), 1 / 3, np.float32)
    change = cv2.transform(cv2.absdiff(a, b), thirds)
    grey = np.where(overlap, cv2.transform(cv2.subtract(a, b), thirds), np.float32(0))
    across, down = (cv2.Sobel(grey, cv2.CV_32F, *axis, scale=0.25) for axis in ((1, 0), (0, 1)))
    gradient = np.abs(across) + np.abs(down)
    total = change + GRADIENT_WEIGHT * gradient
    return np.where(overlap, total**2 / COMMON + LEAST, 0).astype(np.float32)
