"""The correction of a photo's light on its pixels."""

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.warp import Blocks
from panostitch.model.light import Light, radius_square

Floats = NDArray[np.float32]

WHITE = np.float32(255)
BRIGHT = np.float32(200)  # grey levels from which on a camera may have cut off some of the light
DARKER = np.float32(0.98)  # a photo that is darkened by less does not show where its white is
# Of the stops by which what is burnt would be darkened, white and a colour keep
WHITE_KEEPS, COLOUR_KEEPS = np.float32(0.3), np.float32(0.7)
COLOURED = np.float32(0.4)  # of the brightest channel, between it and the darkest: no white from here on
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

    What would be brighter than white keeps its hue. What is burnt may have been brighter, and is darkened by less.
    """
    if factor.ndim == 1 and (factor == 1).all():
        return pixels
    exposed = _times(pixels, factor)
    if factor.min() < DARKER and pixels.max(initial=0) > BRIGHT:
        exposed += _held_up(pixels, factor)
    if factor.max() > 1 and exposed.max(initial=0) > WHITE:
        _keep_hue(exposed)
    return exposed


def _times(pixels: Floats, factor: Floats) -> Floats:
    if factor.ndim > 1:
        return np.asarray(cv2.multiply(pixels, factor), np.float32)
    if np.ptp(factor) == 0:
        return np.asarray(pixels * factor[0], np.float32)
    return np.asarray(cv2.transform(pixels, np.diag(factor)), np.float32)


def _held_up(pixels: Floats, factor: Floats) -> Floats:
    """What bright pixels (h, w, 3) are given back of a factor that darkens them: much to a colour, some to white.

    A burnt channel may have been any brighter; with two of them that is true of the third too. A blue sky that is burnt
    in blue alone would turn green if blue followed the factor. White that is not darkened at all, though, would spread
    the levels below it so far that noise and the blocks of a JPEG show.
    """
    one, two, three = cv2.split(pixels)
    highest, lowest = cv2.max(cv2.max(one, two), three), cv2.min(cv2.min(one, two), three)
    second = cv2.max(cv2.min(one, two), cv2.min(cv2.max(one, two), three))
    burnt = np.maximum(np.maximum(pixels, cv2.merge([second] * 3)) - BRIGHT, 0) / (WHITE - BRIGHT)
    colour = np.minimum((highest - lowest) / (COLOURED * np.maximum(highest, 1)), 1)
    to_white, to_colour = (np.maximum(factor ** (1 - share) - factor, 0) for share in (WHITE_KEEPS, COLOUR_KEEPS))
    given_back = _times(pixels, to_white) + cv2.merge([colour] * 3) * _times(pixels, to_colour - to_white)
    return np.asarray(burnt * given_back, np.float32)


def _keep_hue(exposed: Floats) -> None:
    one, two, three = cv2.split(exposed)
    brightest = np.maximum(cv2.max(cv2.max(one, two), three), WHITE)
    exposed *= cv2.merge([WHITE / brightest] * 3)
