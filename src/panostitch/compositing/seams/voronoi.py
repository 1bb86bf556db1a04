"""Half-way seams: a pixel belongs to the photo in which it lies farthest from the edge."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.seams.whole import whole_photos
from panostitch.model.canvas import Canvas, Layer
from panostitch.model.panorama import NOBODY


def voronoi(canvas: Canvas, pieces: Sequence[tuple[int, Layer]]) -> NDArray[np.int16]:
    """Labels (h, w) of the canvas by the distance from the photos' edges."""
    width, height = canvas.size
    labels = np.full((height, width), NOBODY, np.int16)
    deepest = np.zeros((height, width), np.float32)
    for photo in whole_photos(canvas, pieces):
        deeper = photo.depth > deepest[photo.place]
        labels[photo.place] = np.where(deeper, np.int16(photo.number), labels[photo.place])
        deepest[photo.place] = np.maximum(photo.depth, deepest[photo.place])
    return labels
