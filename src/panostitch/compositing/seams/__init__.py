"""Who owns each pixel: each method sends pieces of photos on the reduced canvas to a map of labels."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

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
    """Give pixels that nobody owns to the owner of the nearest pixel; blending then needs no edges."""
    if not (labels == NOBODY).any():
        return labels
    nearest = distance_transform_edt(labels == NOBODY, return_distances=False, return_indices=True)
    return np.asarray(labels[tuple(nearest)])
