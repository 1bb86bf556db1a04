"""The part of the canvas that is kept: the largest rectangle inside what the photos cover."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from panostitch.model.canvas import Region

COARSE = 320  # px: the search for the rectangle is quick up to here
KEEP_AT_LEAST = 0.6  # of the covered area: if the rectangle holds less, cutting would lose too much of the view


class Crop(NamedTuple):
    """The part of a canvas that is kept, and why, in a few words."""

    region: Region
    reason: str


def largest_rectangle(covered: NDArray[np.bool_]) -> Region:
    """The largest rectangle of True pixels, to within a few pixels; an empty region where there are none.

    Found on a copy of at most COARSE px a side whose pixels are True where all of theirs are, then grown to where
    something is not covered.
    """
    step = -(-max(covered.shape) // COARSE)
    height, width = (side // step * step for side in covered.shape)
    cells = covered[:height, :width].reshape(height // step, step, width // step, step)
    blocks = np.asarray(cells.all(axis=(1, 3)))
    best = _largest(blocks)
    return _grown_inside(best.times(step), covered) if best else best


def _grown_inside(region: Region, covered: NDArray[np.bool_]) -> Region:
    """Move each side outwards while all pixels inside are covered."""
    whole = Region.of(covered)
    growing = True
    while growing:
        growing = False
        for side in (Region(-1, 0, 1, 0), Region(0, -1, 0, 1), Region(0, 0, 1, 0), Region(0, 0, 0, 1)):
            wider = Region(region.x + side.x, region.y + side.y, region.width + side.width, region.height + side.height)
            if wider & whole == wider and covered[wider.within(whole)].all():
                region, growing = wider, True
    return region


def _largest(blocks: NDArray[np.bool_]) -> Region:
    """The largest rectangle of True pixels: row by row the tallest one over each column, as wide as that allows."""
    columns, width = np.arange(blocks.shape[1]), blocks.shape[1]
    best = Region(0, 0, 0, 0)
    height, left, right = np.zeros(width, np.int64), np.zeros(width, np.int64), np.full(width, width)
    for bottom, row in enumerate(blocks, start=1):
        first = np.maximum.accumulate(np.where(row, 0, columns + 1))
        behind = np.minimum.accumulate(np.where(row, width, columns)[::-1])[::-1]
        height = np.where(row, height + 1, 0)
        left, right = np.where(row, np.maximum(left, first), 0), np.where(row, np.minimum(right, behind), width)
        area = height * (right - left)
        n = int(area.argmax())
        if area[n] > best.area:
            best = Region(int(left[n]), bottom - int(height[n]), int(right[n] - left[n]), int(height[n]))
    return best


def bounding_box(covered: NDArray[np.bool_]) -> Region:
    """The smallest rectangle that holds all True pixels."""
    rows, columns = np.flatnonzero(covered.any(1)), np.flatnonzero(covered.any(0))
    if not len(rows):
        return Region(0, 0, 0, 0)
    x, y = int(columns[0]), int(rows[0])
    return Region(x, y, int(columns[-1]) + 1 - x, int(rows[-1]) + 1 - y)


def surely_covered(covered: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pixels of a reduced mask that are covered in full: those whose neighbours are covered as well."""
    inner = covered.copy()
    inner[1:] &= covered[:-1]
    inner[:-1] &= covered[1:]
    inner[:, 1:] &= covered[:, :-1]
    inner[:, :-1] &= covered[:, 1:]
    return inner


def choose_crop(covered: NDArray[np.bool_], rule: str, sure: NDArray[np.bool_] | None = None) -> Crop:
    """The part of a coverage mask to keep by the rule auto, full or none; a full rectangle holds only `sure` pixels.

    Without `sure`, those of a reduced mask whose neighbours are covered as well.
    """
    box = bounding_box(covered)
    if rule == "none" or not box:
        whole = Region.of(covered)
        return Crop(whole if box else box, "the whole canvas, not cropped")
    rectangle = largest_rectangle(surely_covered(covered) if sure is None else sure)
    kept = rectangle.area / max(int(covered.sum()), 1)
    if rule == "full" and rectangle:
        return Crop(rectangle, f"the largest full rectangle, {kept:.0%} of the view")
    if kept < KEEP_AT_LEAST:
        return Crop(box, f"not cropped: the largest full rectangle would keep only {kept:.0%} of the view")
    return Crop(rectangle, f"the largest full rectangle, {kept:.0%} of the view")
