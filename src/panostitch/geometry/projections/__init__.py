"""How directions become pixels: each projection is a file with `forward` and `inverse`.

`forward` sends rays (n, 3) to the plane (n, 2), `inverse` sends them back to rays (n, 3) of any length; the plane is
in units of the focal length, u right and v down, with (0, 0) straight ahead. Where a projection has no answer it
gives NaN. `period` is the width of a full turn in the plane, or 0 where a full turn does not close.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from panostitch.geometry.projections import cylindrical, equirectangular, rectilinear

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Projection:
    """A map between rays (n, 3) and the plane (n, 2)."""

    forward: Callable[[Floats], Floats]
    inverse: Callable[[Floats], Floats]
    period: float


PROJECTIONS = {
    "rectilinear": Projection(rectilinear.forward, rectilinear.inverse, period=0.0),
    "cylindrical": Projection(cylindrical.forward, cylindrical.inverse, period=2 * np.pi),
    "equirectangular": Projection(equirectangular.forward, equirectangular.inverse, period=2 * np.pi),
}
