"""The correction of a photo's light on its pixels."""

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.burnt import read_in
from panostitch.compositing.overlaps import WHITE
from panostitch.compositing.warp import Blocks
from panostitch.model.light import Light, radius_square

Floats = NDArray[np.float32]

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


def spared_in(light: Light, photo: int, grid: Blocks) -> Floats | None:
    """The share of their factor that bright pixels of a photo are spared in a region of the canvas (h, w, 3); or none.

    A coarse map at the coarse grid of coordinates, bilinear between: the same whatever region is asked for.
    """
    spared = light.spared[photo] if light.spared else None
    return None if spared is None else read_in(spared, grid)


def expose(pixels: Floats, factor: Floats, spared: Floats | None = None) -> Floats:
    """Pixels (h, w, 3) in 0..255 times a factor (3,) or (h, w, 3).

    What would be brighter than white keeps its hue. What is burnt is spared a share of it.
    spared: (h, w, 3), the share of a factor below 1 that white is spared; less bright pixels less
    """
    if factor.ndim == 1 and (factor == 1).all():
        return pixels
    exposed = _times(pixels, factor)
    if spared is not None and pixels.max(initial=0) > WHITE * factor.min():
        exposed += spared * given_back(pixels, factor)
    if factor.max() > 1 and exposed.max(initial=0) > WHITE:
        _keep_hue(exposed)
    return exposed


def _times(pixels: Floats, factor: Floats) -> Floats:
    if factor.ndim > 1:
        return np.asarray(cv2.multiply(pixels, factor), np.float32)
    if np.ptp(factor) == 0:
        return np.asarray(pixels * factor[0], np.float32)
    return np.asarray(cv2.transform(pixels, np.diag(factor)), np.float32)


def given_back(pixels: Floats, factor: Floats) -> Floats:
    """What pixels (h, w, 3) are given back of a factor that darkens them, at most: so much that they are multiplied by
    no less than their nearness to white.

    White stays white then, levels keep their order, and none are spread by more than 2, so that neither noise nor the
    blocks of a JPEG show.
    """
    return np.asarray(pixels * np.maximum(_nearness_to_white(pixels) - factor, 0), np.float32)


def _nearness_to_white(pixels: Floats) -> Floats:
    """How near each channel (h, w, 3) is to white, 0..1, or the second of the three if that is nearer.

    A burnt channel may have been any brighter; with two of them that is true of the third too.
    """
    one, two, three = cv2.split(pixels)
    second = cv2.max(cv2.min(one, two), cv2.min(cv2.max(one, two), three))
    return np.asarray(cv2.max(pixels, cv2.merge([second] * 3)) / WHITE, np.float32)


def _keep_hue(exposed: Floats) -> None:
    one, two, three = cv2.split(exposed)
    brightest = np.maximum(cv2.max(cv2.max(one, two), three), WHITE)
    exposed *= cv2.merge([WHITE / brightest] * 3)
