"""Half-way seams: a pixel belongs to the photo in which it lies farthest from the edge."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.model.canvas import Canvas, Layer
from panostitch.model.panorama import NOBODY


def edge_distance(layer: Layer) -> NDArray[np.float32]:
    """Distance (h, w) px of each pixel from the edge of the layer's picture; 0 outside it."""
    framed = np.pad(layer.mask.astype(np.uint8), 1)
    return np.asarray(cv2.distanceTransform(framed, cv2.DIST_L2, cv2.DIST_MASK_5)[1:-1, 1:-1], np.float32)


def voronoi(canvas: Canvas, pieces: Sequence[tuple[int, Layer]]) -> NDArray[np.int16]:
    """Labels (h, w) of the canvas by the distance from the photos' edges."""
    width, height = canvas.size
    labels = np.full((height, width), NOBODY, np.int16)
    deepest = np.zeros((height, width), np.float32)
    for photo, layer in pieces:
        place = layer.region.within(canvas.region)
        depth = edge_distance(layer)
        deeper = depth > deepest[place]
        deepest[place][deeper] = depth[deeper]
        labels[place][deeper] = photo
    return labels
