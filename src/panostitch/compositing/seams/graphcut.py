"""Seams along which the photos agree: minimum cuts, coarse to fine (Kwatra et al. 2003).

Photos are laid down one by one; each overlap with what lies there already is cut where the two differ least in colour
and gradient. A cut is found on a small copy first and then again, twice as fine, in a narrow band around itself. The
solver is SciPy's maximum flow. A small cost for straying from the half-way line settles what the pixels leave open.
"""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from panostitch.compositing.seams.voronoi import edge_distance
from panostitch.model.canvas import Canvas, Layer
from panostitch.model.panorama import NOBODY

Floats = NDArray[np.float32]
Booleans = NDArray[np.bool_]

BASE_COST = 2.0  # grey levels: a short seam through small differences beats a long one through none
GRADIENT_WEIGHT = 1.0
EDGE_WEIGHT = 0.15  # grey levels a pixel pays for each step it lies nearer to its photo's edge than the other's does
EDGE_STEPS = 40.0  # px: straying farther than this costs no more
SCALE = 16  # capacities are whole numbers of 1 / SCALE grey levels
SOLVE_BELOW = 6000  # px that are cut in one go
BAND = 3  # px on each side of a coarse cut that are cut again
FOREVER = 1 << 24  # capacity of a link that is never cut


def graphcut(canvas: Canvas, pieces: Sequence[tuple[int, Layer]]) -> NDArray[np.int16]:
    """Labels (h, w) of the canvas by minimum cuts."""
    width, height = canvas.size
    labels = np.full((height, width), NOBODY, np.int16)
    picture = np.zeros((height, width, 3), np.float32)
    depth = np.zeros((height, width), np.float32)
    for photo, layer in pieces:
        place = layer.region.within(canvas.region)
        there = labels[place] != NOBODY
        own_depth = edge_distance(layer)
        taken = layer.mask & ~there
        overlap = layer.mask & there
        if overlap.any():
            difference = _difference(picture[place], layer.pixels, overlap)
            preference = _preference(depth[place], own_depth)
            taken = _cut(difference, preference, overlap, there & ~layer.mask, taken)
        labels[place][taken] = photo
        picture[place][taken] = layer.pixels[taken]
        depth[place][taken] = own_depth[taken]
    return labels


def _difference(a: Floats, b: Floats, overlap: Booleans) -> Floats:
    """Grey levels (h, w) by which two pictures differ, in colour and in gradient; zero outside the overlap only."""
    change = np.abs(a - b).mean(2)
    grey = np.where(overlap, (a - b).mean(2), 0).astype(np.float32)
    gradient = np.abs(cv2.Sobel(grey, cv2.CV_32F, 1, 0, scale=0.25)) + np.abs(
        cv2.Sobel(grey, cv2.CV_32F, 0, 1, scale=0.25)
    )
    return np.where(overlap, change + GRADIENT_WEIGHT * gradient + 1e-3, 0).astype(np.float32)


def _preference(old_depth: Floats, new_depth: Floats) -> Floats:
    """Grey levels (h, w) by which a pixel would rather belong to the new photo; negative for the old."""
    return np.asarray(EDGE_WEIGHT * np.clip(new_depth - old_depth, -EDGE_STEPS, EDGE_STEPS), np.float32)


def _cut(difference: Floats, preference: Floats, free: Booleans, old: Booleans, new: Booleans) -> Booleans:
    """Pixels (h, w) that the new photo takes: its own (`new`) and its side of the cut through the `free` ones."""
    if free.sum() > SOLVE_BELOW and min(free.shape) >= 8:
        coarse = _cut(*_halved(difference, preference, free, old, new))
        guess = cv2.resize(coarse.astype(np.uint8), free.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
        kernel = np.ones((2 * BAND + 1, 2 * BAND + 1), np.uint8)
        claimed = (np.where(free, guess, new)).astype(np.uint8)
        band = cv2.dilate(claimed, kernel) != cv2.erode(claimed, kernel)
        settled = free & ~band
        new, old, free = new | (settled & guess), old | (settled & ~guess), free & band
    if not free.any():
        return new
    return new | _solve(difference, preference, free, old, new)


def _halved(
    difference: Floats, preference: Floats, free: Booleans, old: Booleans, new: Booleans
) -> tuple[Floats, Floats, Booleans, Booleans, Booleans]:
    """The same problem at half the size; a coarse pixel is free if any of its four is."""
    size = ((free.shape[1] + 1) // 2, (free.shape[0] + 1) // 2)
    small = [
        np.asarray(cv2.resize(a.astype(np.float32), size, interpolation=cv2.INTER_AREA), np.float32)
        for a in (difference, preference, free, old, new)
    ]
    loose = small[2] > 0
    return small[0], small[1] / np.float32(2), loose, (small[3] > 0) & ~loose, (small[4] > 0) & ~loose


def _solve(difference: Floats, preference: Floats, free: Booleans, old: Booleans, new: Booleans) -> Booleans:
    """Minimum cut of the free pixels between the old and the new ones, by maximum flow."""
    number = np.full(free.shape, -1, np.int64)
    number[free] = np.arange(free.sum())
    source, sink = int(free.sum()), int(free.sum()) + 1
    number[old], number[new] = source, sink
    shared = difference > 0
    starts, ends, capacities = [], [], []
    for a, b in (((slice(None), slice(1, None)), (slice(None), slice(-1))), ((slice(1, None),), (slice(-1),))):
        linked = (number[a] >= 0) & (number[b] >= 0) & (free[a] | free[b])
        # where only one photo shows something there is no difference to be seen: the neighbour's counts twice,
        # or every seam would run along an edge of a photo, at half the price
        there_a, there_b = difference[a] + difference[b] * ~shared[a], difference[b] + difference[a] * ~shared[b]
        cost = (there_a + there_b + BASE_COST)[linked] * SCALE
        starts += [number[a][linked], number[b][linked]]
        ends += [number[b][linked], number[a][linked]]
        capacities += [cost, cost]
    wish = preference[free] * SCALE
    own = np.arange(source)
    starts += [np.full(source, source), own]
    ends += [own, np.full(source, sink)]
    capacities += [np.maximum(-wish, 0), np.maximum(wish, 0)]
    tail, head = np.concatenate(starts), np.concatenate(ends)
    capacity = np.minimum(np.rint(np.concatenate(capacities)), FOREVER).astype(np.int32)
    # links into the source and out of the sink carry nothing
    useful = (head != source) & (tail != sink) & (capacity > 0)
    graph = coo_array((capacity[useful], (tail[useful], head[useful])), shape=(sink + 1, sink + 1)).tocsr()
    flow = maximum_flow(graph, source, sink, method="dinic").flow
    residual = (graph - flow).tocsr()
    residual.data = np.where(residual.data > 0, residual.data, 0)
    residual.eliminate_zeros()
    reached = np.zeros(sink + 1, bool)
    reached[breadth_first_order(residual, source, return_predecessors=False)] = True
    taken = np.zeros(free.shape, bool)
    taken[free] = ~reached[:source]
    return taken
