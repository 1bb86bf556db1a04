"""Seams by dynamic programming: the cheapest path from one end of an overlap to the other (Efros & Freeman 2001).

Quick, and right for photos in a row or a grid. A path goes one way only, so it cannot go all around an object.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.seams.cut import BASE_COST
from panostitch.compositing.seams.difference import difference_between
from panostitch.compositing.seams.whole import Booleans, Floats, Whole, whole_photos
from panostitch.model.canvas import Canvas, Layer
from panostitch.model.panorama import NOBODY

EDGE_WEIGHT = 0.01  # grey levels for each px that a pixel lies deeper in one photo than in the other: half-way is best
OUTSIDE = 255.0  # grey levels: the path keeps to the overlap wherever there is one


def dp(canvas: Canvas, pieces: Sequence[tuple[int, Layer]]) -> NDArray[np.int16]:
    """Labels (h, w) of the canvas by cheapest paths, photos laid down one by one."""
    shape = canvas.size[::-1]
    labels, depth = np.full(shape, NOBODY, np.int16), np.zeros(shape, np.float32)
    picture = np.zeros((*shape, 3), np.float32)
    for photo in whole_photos(canvas, pieces):
        at = photo.place
        others = labels[at] != NOBODY
        taken = photo.mask & (~others | _side(photo, others, picture[at], depth[at]))
        labels[at] = np.where(taken, np.int16(photo.number), labels[at])
        depth[at] = np.where(taken, photo.depth, depth[at])
        picture[at] = np.where(taken[..., None], photo.pixels, picture[at])
    return labels


def _side(photo: Whole, others: Booleans, picture: Floats, depth: Floats) -> Booleans:
    """The side (h, w) of the path through the overlap that is the photo's."""
    overlap = photo.mask & others
    if not overlap.any():
        return photo.mask
    off_half_way = EDGE_WEIGHT * np.abs(photo.depth - depth)
    cost = np.where(overlap, difference_between(picture, photo.pixels, overlap) + BASE_COST + off_half_way, OUTSIDE)
    cost[~overlap.any(1)] = 0
    right, down = _middle(photo.mask & ~others, photo.mask) - _middle(others & ~photo.mask, others)
    if abs(down) > abs(right):
        cost[:, ~overlap.any(0)] = 0
        return _behind(cost.T, after=down > 0).T
    return _behind(cost, after=right > 0)


def _middle(pixels: Booleans, otherwise: Booleans) -> NDArray[np.float64]:
    """Mean (x, y) of pixels (h, w), of others where there are none."""
    rows, columns = np.nonzero(pixels if pixels.any() else otherwise)
    return np.array([columns.mean(), rows.mean()])


def _behind(cost: Floats, *, after: bool) -> Booleans:
    """Pixels (h, w) after the cheapest path from the top to the bottom, or before it."""
    column, columns = _path(cost)[:, None], np.arange(cost.shape[1])
    return np.asarray(columns > column if after else columns < column)


def _path(cost: Floats) -> NDArray[np.intp]:
    """The column of the cheapest path in each row (h,), which moves by one column at most."""
    steps = np.zeros(cost.shape, np.int8)
    total = cost[0].astype(np.float64)
    for row in range(1, len(cost)):
        walled = np.pad(total, 1, constant_values=np.inf)
        before = np.stack([walled[1:-1], walled[:-2], walled[2:]])  # straight on where it makes no difference
        step = before.argmin(0)
        steps[row] = np.array([0, -1, 1], np.int8)[step]
        total = cost[row] + before.min(0)
    path = np.zeros(len(cost), np.intp)
    path[-1] = total.argmin()
    for row in range(len(cost) - 1, 0, -1):
        path[row - 1] = path[row] + steps[row, path[row]]
    return path
