"""A minimum cut between two sides of a picture, coarse to fine in bands, by SciPy's maximum flow."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

Floats = NDArray[np.float32]
Booleans = NDArray[np.bool_]

BASE_COST = 2.0  # grey levels: a short seam through small differences beats a long one through none
SCALE = 16  # capacities are whole numbers of 1 / SCALE grey levels
SOLVE_BELOW = 6000  # px that are cut in one go
BAND = 3  # px on each side of a coarse cut that are cut again
FOREVER = 1 << 24  # capacity of a link that is never cut


@dataclass(frozen=True)
class Problem:
    """Which pixels a new photo takes from what lies there already; all arrays (h, w).

    difference: grey levels between the two where both show something, else 0
    wish:       grey levels by which a pixel would rather belong to the new photo; negative for the old
    right, down: grey levels that a seam costs which lies between a pixel and its right or lower neighbour already, and
                which goes where the new photo takes both
    free:       pixels to be decided
    old, new:   pixels that are decided; what is neither is nobody's
    closed:     the last column lies next to the first
    """

    difference: Floats
    wish: Floats
    right: Floats
    down: Floats
    free: Booleans
    old: Booleans
    new: Booleans
    closed: bool


def link_costs(here: Floats, there: Floats) -> Floats:
    """Grey levels (n,) that a seam costs between pixels that differ by `here` and neighbours that differ by `there`.

    Where only one photo shows something there is no difference to be seen: the neighbour's counts twice, or every seam
    would run along an edge of a photo, at half the price.
    """
    both = here + there
    return np.asarray(np.where((here == 0) | (there == 0), 2 * both, both) + BASE_COST, np.float32)


def neighbours(links: Booleans, axis: int, *, closed: bool) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Flat indices of the pixels (h, w) where there is a link, and of their neighbours below (0) or to the right (1).

    There is no link below the last row, nor right of the last column unless it lies next to the first.
    """
    height, width = links.shape
    rows, columns = np.nonzero(links if closed and axis == 1 else links[: height - (axis == 0), : width - (axis == 1)])
    beside = (rows + 1) * width + columns if axis == 0 else rows * width + (columns + 1) % width
    return rows * width + columns, beside


def cut(problem: Problem) -> Booleans:
    """Pixels (h, w) that the new photo takes: its own and its side of the cut."""
    free, old, new = problem.free, problem.old, problem.new
    if free.sum() > SOLVE_BELOW and min(free.shape) >= 8:
        coarse = cut(_halved(problem))
        guess = np.repeat(np.repeat(coarse, 2, 0), 2, 1)[: free.shape[0], : free.shape[1]]
        kernel = np.ones((2 * BAND + 1, 2 * BAND + 1), np.uint8)
        claimed = _around(np.where(free, guess, new), problem.closed)
        band = (cv2.dilate(claimed, kernel) != cv2.erode(claimed, kernel))[:, BAND : BAND + free.shape[1]]
        settled = free & ~band
        new, old, free = new | (settled & guess), old | (settled & ~guess), free & band
    return new | _solve(problem, free, old, new) if free.any() else new


def _around(side: Booleans, closed: bool) -> NDArray[np.uint8]:
    """Columns (h, w + 2 BAND) that go on on both sides."""
    return np.pad(side.astype(np.uint8), ((0, 0), (BAND, BAND)), mode="wrap" if closed else "edge")


def _halved(problem: Problem) -> Problem:
    """The same problem at half the size; a coarse pixel is decided if any of its four is, and none the other way.

    A link is twice as long then, and a pixel's wish is that of four: in units of a link, twice as strong.
    """
    difference, wish = (_means(a) for a in (problem.difference, problem.wish))
    right, down = (_means(a) * np.float32(2) for a in (problem.right, problem.down))
    free, old, new = (_means(a.astype(np.float32)) > 0 for a in (problem.free, problem.old, problem.new))
    free = (free & ~old & ~new) | (old & new)
    return Problem(difference, wish * np.float32(2), right, down, free, old & ~free, new & ~free, problem.closed)


def _means(array: Floats) -> Floats:
    """Means of 2 x 2 px; a last odd row or column counts twice."""
    even = np.pad(array, [(0, n % 2) for n in array.shape], mode="edge")
    return np.asarray((even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]) / 4, np.float32)


def _solve(problem: Problem, free: Booleans, old: Booleans, new: Booleans) -> Booleans:
    """Minimum cut of the free pixels between the old and the new ones, by maximum flow.

    A seam S that is there already makes a link cost S where both its pixels stay, the cost C of the new seam where one
    of them is taken, 0 where both are: S / 2 less for each pixel taken, and C - S / 2 where the two differ.
    """
    count = int(free.sum())
    source, sink = count, count + 1
    number = np.full(free.shape, -1, np.int64)
    number[free] = np.arange(count)
    number[old], number[new] = source, sink
    wish, difference, flat = problem.wish.ravel().copy(), problem.difference.ravel(), number.ravel()
    starts, ends, capacities = [], [], []
    for axis, seam in ((1, problem.right), (0, problem.down)):
        here, there = neighbours((number >= 0) & (free | np.roll(free, -1, axis)), axis, closed=problem.closed)
        inside = flat[there] >= 0
        here, there = here[inside], there[inside]
        cost = link_costs(difference[here], difference[there])
        half = np.minimum(seam.ravel()[here] / 2, cost)
        wish[here] += half
        wish[there] += half
        starts += [flat[here], flat[there]]
        ends += [flat[there], flat[here]]
        capacities += [cost - half, cost - half]
    wishes, own = wish[free.ravel()], np.arange(count)
    starts += [np.full(count, source), own]
    ends += [own, np.full(count, sink)]
    capacities += [np.maximum(-wishes, 0), np.maximum(wishes, 0)]
    tail, head = np.concatenate(starts), np.concatenate(ends)
    capacity = np.minimum(np.rint(np.concatenate(capacities) * SCALE), FOREVER).astype(np.int32)
    # links into the source and out of the sink carry nothing
    useful = (head != source) & (tail != sink) & (capacity > 0)
    graph = coo_array((capacity[useful], (tail[useful], head[useful])), shape=(sink + 1, sink + 1)).tocsr()
    kept = _reached(graph, source, sink)
    taken = np.zeros(free.shape, bool)
    taken[free] = ~kept[:count]
    return taken


def _reached(graph: coo_array, source: int, sink: int) -> Booleans:
    """The nodes that a maximum flow leaves within reach of the source."""
    residual = (graph - maximum_flow(graph, source, sink, method="dinic").flow).tocsr()
    residual.data = np.where(residual.data > 0, residual.data, 0)
    residual.eliminate_zeros()
    reached = np.zeros(sink + 1, bool)
    reached[breadth_first_order(residual, source, return_predecessors=False)] = True
    return reached
