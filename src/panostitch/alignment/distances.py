"""How far control points are from where cameras of any model see them; all pairs at once."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from panostitch.alignment.residuals import BEHIND, arrays_of, in_a_row
from panostitch.geometry import lens
from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints

Floats = NDArray[np.float64]


def rms(errors: Floats) -> float:
    """Root mean square of errors (n,)."""
    return float(np.sqrt((errors**2).mean()))


def distances(cameras: Sequence[Camera], points: Sequence[ControlPoints]) -> list[Floats]:
    """Distance (n,) px in photo j of the control points of each pair; BEHIND where photo j does not see them."""
    counts = [len(pair) for pair in points]
    if not sum(counts):
        return [np.zeros(0) for _ in points]
    # as Camera.rays and Camera.project, which take one camera at a time
    matches, arrays = in_a_row(points), arrays_of(cameras)
    lens_i, lens_j = arrays.lenses.of(matches.i), arrays.lenses.of(matches.j)
    world = arrays.turns.transpose(2, 0, 1)
    first = matches.bounds[:-1]
    pairs = world[matches.j[first]] @ np.linalg.inv(world)[matches.i[first]]
    here = ((matches.xy_i - lens_i.centre) / lens_i.focal).T
    ray = np.column_stack([lens.undistort(here, lens_i.k1, lens_i.k2), np.ones(len(here))])
    local = (np.repeat(pairs, np.diff(matches.bounds), axis=0) @ ray[:, :, None])[:, :, 0]
    with np.errstate(invalid="ignore"):
        ideal = local[:, :2] / np.where(local[:, 2:] > 1e-9, local[:, 2:], np.nan)
        there = lens.distort(ideal, lens_j.k1, lens_j.k2).T * lens_j.focal + lens_j.centre
    off = np.linalg.norm(there - matches.xy_j, axis=0)
    return np.split(np.nan_to_num(off, nan=BEHIND), np.cumsum(counts)[:-1])
