"""Where photos are burnt: coarse maps of them, read where a canvas sees them.

A channel that the camera has cut off says no more than "at least white". What only looks as bright, far from anything
burnt, is light that was measured.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.overlaps import BRIGHT
from panostitch.compositing.warp import DEEP, Blocks

Floats = NDArray[np.float32]

CELLS = 64  # along the longer side of a photo
LEAST_CELL = 16  # px of the photo
ENOUGH = np.float32(0.25)  # of a cell, burnt: all of it counts as burnt then
SPREAD = 1.0  # cells, deviation of the blur about burnt cells: no edge shows


def burnt_map(pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> Floats | None:
    """How far a photo (h, w, 3) is burnt around a place, 0..1, a coarse map (rows, columns); None if nowhere."""
    white = BRIGHT / float(DEEP) if pixels.dtype == np.uint16 else BRIGHT
    if pixels.max(initial=0) <= white:
        return None
    height, width = pixels.shape[:2]
    one, two, three = cv2.split(pixels)
    cut_off = np.asarray(cv2.max(cv2.max(one, two), three) > white).view(np.uint8)
    cell = max(LEAST_CELL, max(height, width) / CELLS)
    size = max(1, round(width / cell)), max(1, round(height / cell))
    shares = cv2.resize(cut_off * np.float32(1 / ENOUGH), size, interpolation=cv2.INTER_AREA)
    around = cv2.dilate(np.minimum(shares, 1), np.ones((3, 3)))
    return np.asarray(cv2.GaussianBlur(around, (0, 0), SPREAD), np.float32)


def read_in(coarse: Floats, grid: Blocks) -> Floats | None:
    """A coarse map of a photo at the pixels of a grid's region (h, w, ...); None where it says 0 all over it.

    Exact at the nodes of the grid, bilinear between: the same whatever region is asked for.
    """
    seen = np.where(grid.known[..., None], grid.seen, 0).astype(np.float32)
    nodes = read_at(coarse, seen, grid.camera.size)
    return grid.enlarged(nodes) if nodes.any() else None


def read_at(coarse: Floats, xy: Floats, size: tuple[int, int]) -> Floats:
    """A coarse map of a photo of this size at px (h, w, 2) of it, bilinear: (h, w, ...)."""
    half = np.float32(0.5)
    x, y = ((xy[..., k] + half) * np.float32(coarse.shape[1 - k] / size[k]) - half for k in (0, 1))
    return np.asarray(cv2.remap(coarse, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)
