"""Control points measured again on the full photos: key points place them to a third of a working pixel, patches to a
hundredth of a pixel of the photo (alignment.registration).
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from panostitch.alignment.pictures import Pictures
from panostitch.alignment.registration import measured_again
from panostitch.geometry.sampling import rescale
from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints
from panostitch.runtime.executor import Executor

REACH = 8.0  # px in a working pixel up to which key points are near enough for a search on the full photos
LONGEST_WAY = 3.0  # working px; further off lies something else
FEWEST = 8  # points of a pair; with fewer, the key points stay


def refined(
    pictures: Pictures,
    cameras: Sequence[Camera],
    points: Sequence[ControlPoints],
    *,
    pixel_size: float,
    run: Executor,
) -> list[ControlPoints]:
    """The points measured again; those of a pair stay as they are where too few can be.

    `pixel_size` is the size of a working pixel in px of the photos. Raises InputError where a photo cannot be read.
    """
    work = partial(_pair, pictures, cameras, pixel_size=pixel_size)
    return list(run.map(work, points, label="Measuring control points"))


def _pair(pictures: Pictures, cameras: Sequence[Camera], points: ControlPoints, *, pixel_size: float) -> ControlPoints:
    begin = points
    if pixel_size > REACH:
        # what a reduced photo tells is only where to begin; points that it does not show begin where they were
        factor = 2 ** math.ceil(math.log2(pixel_size / REACH))
        index, coarse = measured(pictures, cameras, points, factor, LONGEST_WAY * pixel_size)
        xy_j = points.xy_j + 0.0
        there = cameras[points.j].project(cameras[points.i].rays(np.vstack([points.xy_i[index], coarse.xy_i])))
        xy_j[index] = coarse.xy_j + there[: len(index)] - there[len(index) :]
        begin = replace(points, xy_j=xy_j)
    _, found = measured(pictures, cameras, begin, 1, LONGEST_WAY * pixel_size)
    return found if len(found) >= FEWEST else points


def measured(
    pictures: Pictures, cameras: Sequence[Camera], points: ControlPoints, factor: int, reach: float
) -> tuple[NDArray[np.intp], ControlPoints]:
    """Which points can be measured on the photos at 1 / factor of their size, within `reach` px, and their places."""
    grey_i, grey_j = pictures.read(points.i, factor), pictures.read(points.j, factor)
    size_i, size_j = ((grey.shape[1], grey.shape[0]) for grey in (grey_i, grey_j))
    camera_i, camera_j = cameras[points.i], cameras[points.j]
    down_i, down_j = np.array(size_i) / camera_i.size, np.array(size_j) / camera_j.size
    reduced = ControlPoints(points.i, points.j, rescale(points.xy_i, down_i), rescale(points.xy_j, down_j))
    found = measured_again(reduced, camera_i.scaled(size_i), camera_j.scaled(size_j), grey_i, grey_j)
    near = found.way * factor <= reach
    places = ControlPoints(
        points.i, points.j, rescale(found.xy_i[near], 1 / down_i), rescale(found.xy_j[near], 1 / down_j)
    )
    return found.index[near], places
