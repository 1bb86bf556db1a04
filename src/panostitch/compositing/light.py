"""The correction of a photo's light on its pixels."""

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.warp import Blocks
from panostitch.model.light import Light, radius_square

Floats = NDArray[np.float32]

WHITE = np.float32(255)
BURNT = np.float32(240)  # grey levels from which on a channel is on its way to white
FARTHEST = 2.0  # square of a radius: coordinates go on beyond the photo, where the fall-off means nothing


def factors(light: Light, photo: int, grid: Blocks) -> Floats:
    """What to multiply a photo by in a region of the canvas: (h, w, 3), or (3,) where there is no fall-off.

    Exact on the coarse grid of coordinates, bilinear between: the same whatever region is asked for.
    """
    gains = np.asarray(light.gains[photo], np.float32)
    if not light.has_fall_off(photo):
        return gains
    square = np.where(grid.known, radius_square(grid.seen, grid.camera.size), FARTHEST)
    return grid.enlarged(with_fall_off(light, photo, square))


def with_fall_off(light: Light, photo: int, square: NDArray[np.float64]) -> Floats:
    """What to multiply a photo by (h, w, 3) where the squares of the radii are these (h, w)."""
    brighter = light.brightening(photo, np.minimum(square, FARTHEST))
    return np.asarray(brighter[..., None] * light.gains[photo], np.float32)


def expose(pixels: Floats, factor: Floats) -> Floats:
    """Pixels (h, w, 3) in 0..255 times a factor (3,) or (h, w, 3).

    What would be brighter than white keeps its hue. What is burnt may have been any brighter, and stays.
    """
    if factor.ndim == 1 and (factor == 1).all():
        return pixels
    exposed = _times(pixels, factor)
    if (factor.ndim > 1 or factor.min() < 1) and pixels.max(initial=0) > BURNT:
        _keep_burnt(pixels, exposed)
    if exposed.max(initial=0) > WHITE:
        _keep_hue(exposed)
    return exposed


def _times(pixels: Floats, factor: Floats) -> Floats:
    if factor.ndim > 1:
        return np.asarray(cv2.multiply(pixels, factor), np.float32)
    if np.ptp(factor) == 0:
        return np.asarray(pixels * factor[0], np.float32)
    return np.asarray(cv2.transform(pixels, np.diag(factor)), np.float32)


def _keep_burnt(pixels: Floats, exposed: Floats) -> None:
    """A burnt channel may have been any brighter and stays as it is; with two of them the third does too.

    Were it to follow the others, a blue sky that is burnt in blue alone would turn green, and white would turn grey.
    """
    share = (np.maximum(pixels - BURNT, 0) / (WHITE - BURNT)) ** 2
    one, two, three = cv2.split(share)
    second = cv2.max(cv2.min(one, two), cv2.min(cv2.max(one, two), three))
    np.maximum(share, cv2.merge([second] * 3), out=share)
    share *= np.maximum(pixels - exposed, 0)
    exposed += share


def _keep_hue(exposed: Floats) -> None:
    one, two, three = cv2.split(exposed)
    brightest = np.maximum(cv2.max(cv2.max(one, two), three), WHITE)
    exposed *= cv2.merge([WHITE / brightest] * 3)
