"""Who owns each pixel: each method sends pieces of photos on the reduced canvas to a map of labels."""

from collections.abc import Callable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.seams.dp import dp
from panostitch.compositing.seams.graphcut import graphcut
from panostitch.compositing.seams.voronoi import voronoi
from panostitch.model.canvas import Canvas, Layer
from panostitch.model.panorama import NOBODY

Labels = NDArray[np.int16]

# From (photo, layer) pieces on a canvas to labels (h, w): the photo that owns the pixel, NOBODY outside all photos.
SEAMS: dict[str, Callable[[Canvas, Sequence[tuple[int, Layer]]], Labels]] = {
    "graphcut": graphcut,
    "dp": dp,
    "voronoi": voronoi,
}


def extend(labels: Labels) -> Labels:
    """Give pixels that nobody owns to the owner of the nearest pixel, about; blending then needs no edges."""
    owned = labels != NOBODY
    if owned.all() or not owned.any():
        return labels
    _, nearest = cv2.distanceTransformWithLabels(
        (~owned).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    owner = np.empty(int(nearest.max()) + 1, np.int16)
    owner[nearest[owned]] = labels[owned]
    return np.asarray(owner[nearest], np.int16)
