"""Our canvas as Hugin's: straight ahead is the middle of its panorama, and what we show is the crop of it."""

from dataclasses import dataclass

import numpy as np

from panostitch.errors import UsageError
from panostitch.geometry.projections import PROJECTIONS
from panostitch.model.canvas import Canvas, Region

NUMBERS = {
    "rectilinear": 0,
    "cylindrical": 1,
    "equirectangular": 2,
    "fisheye": 3,
    "stereographic": 4,
    "mercator": 5,
    "transverse-mercator": 6,
    "miller": 11,
    "equisolid": 15,
    "panini": 19,
}


@dataclass(frozen=True)
class HuginCanvas:
    """The p-line.

    projection: Hugin's number
    size:       (width, height) px
    hfov:       degrees
    crop:       the part of it that is our panorama
    yaw:        radians by which the world is turned, so that the middle of it is straight ahead
    parameters: of the projection, as Hugin has them
    """

    projection: int
    size: tuple[int, int]
    hfov: float
    crop: Region
    yaw: float = 0.0
    parameters: tuple[float, ...] = ()


def check_projection(name: str) -> None:
    """Raise UsageError for a projection that Hugin does not have."""
    if name not in ("auto", "little-planet", *NUMBERS):
        raise UsageError(f"Hugin has no projection {name}", hint="write the .pto with --projection rectilinear")


def place(canvas: Canvas, crop: Region) -> HuginCanvas:
    """Hugin's canvas of a panorama of views from one point. Raises UsageError where Hugin has no such projection."""
    check_projection(canvas.projection)
    if canvas.projection == "rectilinear":
        return place_flat(canvas, crop, ahead=(-canvas.origin[0], -canvas.origin[1]), distance=canvas.scale)
    if not PROJECTIONS[canvas.projection].period:
        return _place_ahead(canvas, crop)
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


def _place_ahead(canvas: Canvas, crop: Region) -> HuginCanvas:
    """The canvas of a projection that does not close: straight ahead is its middle; its width is told as an angle."""
    width, left = _symmetric(-canvas.origin[0], canvas.size[0])
    height, above = _symmetric(-canvas.origin[1], canvas.size[1])
    edge = PROJECTIONS[canvas.projection].inverse(np.array([[width / 2 / canvas.scale, 0.0]]), *canvas.parameters)[0]
    # the canvas of a whole sphere ends half a pixel beyond it
    hfov = float(np.rad2deg(2 * np.arctan2(edge[0], edge[2]))) if np.isfinite(edge).all() else 360.0
    return HuginCanvas(
        NUMBERS[canvas.projection],
        (width, height),
        hfov,
        Region(crop.x + left, crop.y + above, crop.width, crop.height),
        parameters=tuple(_squeeze(d) for d in canvas.parameters) + (0.0, 0.0) * bool(canvas.parameters),
    )


def _squeeze(distance: float) -> float:
    """Hugin's number for the distance d of a panini: d = 1.5 / (t + 0.0001) - 1.5 / 3.0001, t = (150 - number) / 50."""
    return 150 - 50 * (1.5 / (distance + 1.5 / 3.0001) - 0.0001)


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
