"""How far control points are from where cameras of any model see them; all pairs at once."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from panostitch.alignment.residuals import BEHIND
from panostitch.geometry import lens
from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints

Floats = NDArray[np.float64]


def distances(cameras: Sequence[Camera], points: Sequence[ControlPoints]) -> list[Floats]:
    """Distance (n,) px in photo j of the control points of each pair; BEHIND where photo j does not see them."""
    if not points:
        return []
    counts = [len(pair) for pair in points]
    i, j = (np.array(numbers, np.intp) for numbers in zip(*((pair.i, pair.j) for pair in points), strict=True))
    # as Camera.rays and Camera.project, which take one camera at a time
    focal, x, y, k1, k2 = np.array([(c.focal, *c.centre, c.k1, c.k2) for c in cameras]).T
    centre = np.column_stack([x, y])
    world = np.array([camera.cam_from_world for camera in cameras])
    there_from_here = np.repeat(world[j] @ np.linalg.inv(world)[i], counts, axis=0)
    i, j = np.repeat(i, counts), np.repeat(j, counts)
    here = (np.vstack([pair.xy_i for pair in points]) - centre[i]) / focal[i, None]
    ray = np.column_stack([lens.undistort(here, k1[i], k2[i]), np.ones(len(i))])
    local = (there_from_here @ ray[:, :, None])[:, :, 0]
    with np.errstate(invalid="ignore"):
        ideal = local[:, :2] / np.where(local[:, 2:] > 1e-9, local[:, 2:], np.nan)
        there = lens.distort(ideal, k1[j], k2[j]) * focal[j, None] + centre[j]
    off = np.linalg.norm(there - np.vstack([pair.xy_j for pair in points]), axis=1)
    return np.split(np.nan_to_num(off, nan=BEHIND), np.cumsum(counts)[:-1])
