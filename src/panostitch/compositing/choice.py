"""Which projection shows the view: by its field of view, or as asked where that is possible."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.field import View
from panostitch.errors import UsageError
from panostitch.geometry.projections import PROJECTIONS
from panostitch.options import LayoutOptions

Floats = NDArray[np.float64]

RECTILINEAR_UNTIL = np.deg2rad(47.0)  # from straight ahead: beyond, the edges are stretched twice as wide
CYLINDRICAL_UNTIL = np.deg2rad(50.0)  # above or below the horizon
FARTHEST = np.tan(np.deg2rad(80.0))  # from straight ahead, in the plane: a rectilinear view is stretched 33 times there
PLANET_EDGE = 2 * np.tan(np.deg2rad(60.0))  # the middle of each side of a little planet is 30 degrees above the horizon


@dataclass(frozen=True)
class Choice:
    """Name of the projection, its parameters, and why it is this one."""

    name: str
    parameters: tuple[float, ...]
    reason: str


def choose_projection(view: View, options: LayoutOptions) -> Choice:
    """The projection for a view. Raises UsageError where a forced one cannot show it."""
    if options.projection == "auto":
        return _by_field(view)
    if options.projection == "little-planet":
        return Choice("stereographic", (), "a little planet, as asked")
    parameters = (options.panini_distance,) if options.projection == "panini" else ()
    if not _shown(options.projection, parameters, view.rays):
        others = "little-planet" if options.projection == "stereographic" else "auto"
        raise UsageError(
            f"--projection {options.projection} cannot show this: {_in_words(view)}",
            hint=f"use --projection equirectangular, which shows every view, or {others}",
        )
    return Choice(options.projection, parameters, "as asked")


def _by_field(view: View) -> Choice:
    wide = max(np.nanmax(np.abs(_longitudes(view.rays))), view.across / 2)
    high = _highest(view.rays)
    field = _in_words(view)
    if wide < RECTILINEAR_UNTIL and high < RECTILINEAR_UNTIL:
        return Choice("rectilinear", (), f"{field}: narrow enough to keep all lines straight")
    if high < CYLINDRICAL_UNTIL:
        return Choice("cylindrical", (), f"{field}: too wide for rectilinear, low enough to keep verticals straight")
    return Choice("equirectangular", (), f"{field}: too high for straight verticals")


def _shown(name: str, parameters: tuple[float, ...], rays: Floats) -> bool:
    """Whether a projection shows all these rays, none of them absurdly far out."""
    uv = PROJECTIONS[name].forward(rays[np.isfinite(rays).all(1)], *parameters)
    ends = uv[:, 1:] if PROJECTIONS[name].period else uv
    return bool((np.abs(ends) <= FARTHEST).all())


def _in_words(view: View) -> str:
    width, height = np.rad2deg(view.width), np.rad2deg(_highest(view.rays))
    return f"the view is {width:.0f} degrees wide and reaches {height:.0f} degrees from the horizon"


def _longitudes(rays: Floats) -> Floats:
    return np.asarray(np.arctan2(rays[:, 0], rays[:, 2]))


def _highest(rays: Floats) -> float:
    """Largest distance (radians) from the horizon."""
    return float(np.nanmax(np.abs(np.arctan2(rays[:, 1], np.hypot(rays[:, 0], rays[:, 2])))))
