"""Our canvas as Hugin's: straight ahead is the middle of its panorama, and what we show is the crop of it."""

from dataclasses import dataclass

import numpy as np

from panostitch.model.canvas import Canvas, Region

NUMBERS = {"rectilinear": 0, "cylindrical": 1, "equirectangular": 2}


@dataclass(frozen=True)
class HuginCanvas:
    """The p-line.

    projection: Hugin's number
    size:       (width, height) px
    hfov:       degrees
    crop:       the part of it that is our panorama
    yaw:        radians by which the world is turned, so that the middle of it is straight ahead
    """

    projection: int
    size: tuple[int, int]
    hfov: float
    crop: Region
    yaw: float = 0.0


def place(canvas: Canvas, crop: Region) -> HuginCanvas:
    """Hugin's canvas of a panorama of views from one point."""
    if canvas.projection == "rectilinear":
        return place_flat(canvas, crop, ahead=(-canvas.origin[0], -canvas.origin[1]), distance=canvas.scale)
    # Hugin takes equirectangular panoramas of even width only
    width = canvas.size[0] + canvas.size[0] % 2
    height, above = _symmetric(-canvas.origin[1], canvas.size[1])
    return HuginCanvas(
        NUMBERS[canvas.projection],
        (width, height),
        min(float(np.rad2deg(width / canvas.scale)), 360.0),
        Region(crop.x, crop.y + above, crop.width, crop.height),
        ((width - 1) / 2 + canvas.origin[0]) / canvas.scale,
    )


def place_flat(canvas: Canvas, crop: Region, *, ahead: tuple[float, float], distance: float) -> HuginCanvas:
    """Hugin's rectilinear canvas; the canvas pixel that is straight ahead must be a multiple of 1/2.

    distance: canvas px per tangent
    """
    width, left = _symmetric(ahead[0], canvas.size[0])
    height, above = _symmetric(ahead[1], canvas.size[1])
    hfov = float(np.rad2deg(2 * np.arctan(width / 2 / distance)))
    return HuginCanvas(0, (width, height), hfov, Region(crop.x + left, crop.y + above, crop.width, crop.height))


def _symmetric(middle: float, count: int) -> tuple[int, int]:
    """Size of the smallest row of pixels around a middle that holds `count` pixels, and how many come before them."""
    half = max(middle, count - 1 - middle)
    return round(2 * half) + 1, round(half - middle)
