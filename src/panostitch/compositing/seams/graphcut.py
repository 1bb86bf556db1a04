"""Seams along which the photos agree: minimum cuts (Kwatra et al. 2003), improved by expansion (Boykov et al. 2001).

Photos are laid down one by one; each overlap with what lies there already is cut where the two differ least in colour
and gradient. Where more than two overlap, each may grow once more over what lies around it, seams between the others
included, if that makes all seams together cheaper. A small cost for straying from the half-way line settles what
pixels leave open.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.seams.cut import Problem, cut, link_costs, neighbours
from panostitch.compositing.seams.difference import difference_between
from panostitch.compositing.seams.whole import Booleans, Floats, Whole, whole_photos
from panostitch.model.canvas import Canvas, Layer
from panostitch.model.panorama import NOBODY

EDGE_WEIGHT = 0.005  # grey levels a pixel pays for each px that it lies nearer to its photo's edge than to the other's


@dataclass(frozen=True)
class Composite:
    """What lies on the canvas; arrays (h, w) that are filled in place.

    right, down: grey levels that the seam to the right of a pixel or below it costs; 0 where there is none
    """

    labels: NDArray[np.int16]
    picture: Floats
    depth: Floats
    right: Floats
    down: Floats


def graphcut(canvas: Canvas, pieces: Sequence[tuple[int, Layer]]) -> NDArray[np.int16]:
    """Labels (h, w) of the canvas by minimum cuts."""
    shape = canvas.size[::-1]
    flat = (np.zeros(shape, np.float32) for _ in range(3))
    lying = Composite(np.full(shape, NOBODY, np.int16), np.zeros((*shape, 3), np.float32), *flat)
    photos = whole_photos(canvas, pieces)
    for photo in photos:
        _grow(lying, photo)
    many = _count(canvas, photos) > 2  # where two photos overlap, their seam is the best already
    for photo in photos:
        if (photo.mask & many[photo.place]).any():
            _grow(lying, photo)
    return lying.labels


def _count(canvas: Canvas, photos: Sequence[Whole]) -> NDArray[np.int16]:
    """Number (h, w) of photos that show a pixel of the canvas."""
    count = np.zeros(canvas.size[::-1], np.int16)
    for photo in photos:
        count[photo.place] += photo.mask
    return count


def _grow(lying: Composite, photo: Whole) -> None:
    """Let a photo take what makes the seams cheapest, and what nobody has; it gives nothing back."""
    at = photo.place
    labels = lying.labels[at]
    others = (labels != NOBODY) & (labels != photo.number)
    free, taken = photo.mask & others, photo.mask & ~others
    difference = difference_between(lying.picture[at], photo.pixels, free)
    if free.any():
        wish = EDGE_WEIGHT * (photo.depth - lying.depth[at])
        right, down = (
            np.where(others & np.roll(others, -1, axis), seams[at], np.float32(0))
            for axis, seams in ((1, lying.right), (0, lying.down))
        )
        taken = cut(Problem(difference, wish, right, down, free, others & ~free, taken, photo.closed))
    _take(lying, photo, taken, difference)


def _take(lying: Composite, photo: Whole, taken: Booleans, difference: Floats) -> None:
    """Lay down what a photo takes; seams now run along its edge, and none within it."""
    at, flat = photo.place, difference.ravel()
    laid = taken & (lying.labels[at] != photo.number)
    for axis, seams in ((1, lying.right), (0, lying.down)):
        ends = taken != np.roll(taken, -1, axis)
        here, there = neighbours(ends, axis, closed=photo.closed)
        kept = np.where(taken, np.float32(0), seams[at])
        kept.ravel()[here] = link_costs(flat[here], flat[there])
        seams[at] = kept
    number = np.full(taken.shape, photo.number, np.int16)
    for array, own in ((lying.labels, number), (lying.picture, photo.pixels), (lying.depth, photo.depth)):
        array[at] = cv2.copyTo(own, laid.view(np.uint8), np.ascontiguousarray(array[at]))
