"""The correction of a photo's light on its pixels."""

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.warp import blocks
from panostitch.model.camera import Camera
from panostitch.model.canvas import Canvas, Region
from panostitch.model.light import Light, radius_square

Floats = NDArray[np.float32]

WHITE = np.float32(255)
BURNT = np.float32(235)  # grey levels of the darkest channel from which on a pixel is on its way to white
FARTHEST = 2.0  # square of a radius: coordinates go on beyond the photo, where the fall-off means nothing


def brightening(light: Light, photo: int, camera: Camera, canvas: Canvas, region: Region) -> Floats | None:
    """Factor (h, w) that undoes the fall-off in a region of the canvas, None where there is none.

    Exact on the coarse grid of `warp.coordinates`, bilinear between: the same whatever region is asked for.
    """
    if not light.has_fall_off(photo):
        return None
    grid = blocks(camera, canvas, region)
    square = np.minimum(radius_square(grid.seen, camera.size), FARTHEST)
    factors = light.brightening(photo, np.where(grid.known, square, FARTHEST))
    return grid.enlarged(np.asarray(factors, np.float32))


def expose(pixels: Floats, gains: NDArray[np.float64], brighter: Floats | None = None) -> Floats:
    """Pixels (h, w, 3) in 0..255 times the gains (3,) of their channels, and a factor (h, w) of them all.

    What would be brighter than white keeps its hue. What is white may have been any brighter, and stays white.
    """
    if brighter is None and (gains == 1).all():
        return pixels
    exposed = _times(pixels, gains)
    if brighter is not None:
        exposed *= cv2.merge([brighter] * 3)
    if gains.min() < 1 or np.ptp(gains) > 0:
        _keep_white(pixels, exposed)
    if gains.max() > 1 or brighter is not None:
        _keep_hue(exposed)
    return exposed


def _times(pixels: Floats, gains: NDArray[np.float64]) -> Floats:
    if np.ptp(gains) == 0:
        return pixels * np.float32(gains[0])
    return np.asarray(cv2.transform(pixels, np.diag(gains).astype(np.float32)), np.float32)


def _keep_white(pixels: Floats, exposed: Floats) -> None:
    # planes: NumPy is slow along an axis of three
    darkest = np.minimum(np.minimum(pixels[..., 0], pixels[..., 1]), pixels[..., 2])
    white = darkest > BURNT
    if white.any():
        own, share = exposed[white], ((darkest[white] - BURNT) / (WHITE - BURNT)) ** 2
        level = np.maximum(own.max(1), pixels[white].max(1))
        exposed[white] = own + (level[:, None] - own) * share[:, None]


def _keep_hue(exposed: Floats) -> None:
    brightest = np.maximum(np.maximum(exposed[..., 0], exposed[..., 1]), exposed[..., 2])
    if brightest.max(initial=0) > WHITE:
        exposed *= cv2.merge([WHITE / np.maximum(brightest, WHITE)] * 3)
