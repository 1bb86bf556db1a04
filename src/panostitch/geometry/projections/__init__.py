"""How directions become pixels: each projection is a file with `forward` and `inverse`.

`forward` sends rays (n, 3) to the plane (n, 2), `inverse` sends them back to rays (n, 3) of any length; the plane is
in units of the focal length, u right and v down, with (0, 0) straight ahead. Where a projection has no answer it
gives NaN. `period` is the width of a full turn in the plane, or 0 where a full turn does not close. A projection may
have parameters: both functions then take them, each with a default, behind their argument.

Longitude is atan2(x, z), latitude atan2(y, hypot(x, z)): positive downwards, as y is.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from panostitch.geometry.projections import (
    compressed_rectilinear,
    cube,
    cylindrical,
    equirectangular,
    equisolid,
    fisheye,
    mercator,
    miller,
    panini,
    rectilinear,
    stereographic,
    transverse_mercator,
)

Floats = NDArray[np.float64]

TURN = 2 * np.pi


@dataclass(frozen=True)
class Projection:
    """A map between rays (n, 3) and the plane (n, 2)."""

    forward: Callable[..., Floats]
    inverse: Callable[..., Floats]
    period: float = 0.0


PROJECTIONS = {
    "rectilinear": Projection(rectilinear.forward, rectilinear.inverse),
    "panini": Projection(panini.forward, panini.inverse),
    "compressed-rectilinear": Projection(compressed_rectilinear.forward, compressed_rectilinear.inverse),
    "cylindrical": Projection(cylindrical.forward, cylindrical.inverse, TURN),
    "mercator": Projection(mercator.forward, mercator.inverse, TURN),
    "miller": Projection(miller.forward, miller.inverse, TURN),
    "equirectangular": Projection(equirectangular.forward, equirectangular.inverse, TURN),
    "stereographic": Projection(stereographic.forward, stereographic.inverse),
    "fisheye": Projection(fisheye.forward, fisheye.inverse),
    "equisolid": Projection(equisolid.forward, equisolid.inverse),
    "transverse-mercator": Projection(transverse_mercator.forward, transverse_mercator.inverse),
    "cube": Projection(cube.forward, cube.inverse),
}
