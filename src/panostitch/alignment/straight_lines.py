"""Straight lines of a photo, which a mesh must not bend (von Gioi et al., "LSD: a line segment detector", 2012)."""

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.alignment.pictures import Pictures
from panostitch.geometry.sampling import rescale
from panostitch.model.mesh import CELLS

Floats = NDArray[np.float64]

SEEN_AT = 480  # px of the photo's longer side, about: lines that show are found whole there, in a tenth of the time
SHORTEST = 3  # cells of a mesh: what is shorter no mesh bends


def straight_lines(pictures: Pictures, index: int) -> Floats:
    """Three points (n, 3, 2) px at a time, a cell of a mesh apart, along the lines of a photo."""
    size = np.array(pictures.photos[index].size)
    grey = pictures.read(index, max(1, round(size.max() / SEEN_AT)))
    found = cv2.createLineSegmentDetector().detect(grey.clip(0, 255).astype(np.uint8))[0]
    if found is None:
        return np.zeros((0, 3, 2))
    ends = rescale(found.reshape(-1, 2, 2).astype(float), size / grey.shape[::-1])
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    cell = size.max() / CELLS
    triples = [_along(*ends[n], steps=int(length[n] / cell)) for n in np.flatnonzero(length >= SHORTEST * cell)]
    return np.concatenate([*triples, np.zeros((0, 3, 2))])


def _along(start: Floats, end: Floats, *, steps: int) -> Floats:
    """All three neighbouring points (steps - 1, 3, 2) of a segment in equal steps."""
    points = start + np.linspace(0, 1, steps + 1)[:, None] * (end - start)
    return np.stack([points[:-2], points[1:-1], points[2:]], axis=1)
