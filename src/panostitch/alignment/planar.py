"""A flat subject: each photo is a homography of one common plane.

The plane's coordinates are the pixels of the best connected photo. Homographies are multiplied along the spanning tree
and each is then refined against all its links.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from panostitch.alignment.initialise import SpanningTree, child_from_parent
from panostitch.geometry import homography
from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints
from panostitch.model.photo import Photo

Floats = NDArray[np.float64]

SWEEPS = 10


def planar_cameras(
    photos: Sequence[Photo], observations: Sequence[ControlPoints], tree: SpanningTree, *, loss_scale: float
) -> tuple[Camera, ...]:
    """Cameras whose `cam_from_world` sends plane coordinates (x, y, 1) to pixels."""
    plane_from_photo = [np.eye(3) for _ in photos]
    for parent, child, link in tree.edges:
        parent_from_child = np.linalg.inv(child_from_parent(parent, link))
        plane_from_photo[child] = plane_from_photo[parent] @ parent_from_child
    if len(photos) > 2:
        _relax(plane_from_photo, observations, tree.root, loss_scale)
    return tuple(
        Camera(photo.size, 1.0, (0.0, 0.0), np.asarray(np.linalg.inv(_seen_from_middle(matrix, photo)), np.float64))
        for photo, matrix in zip(photos, plane_from_photo, strict=True)
    )


def _relax(plane_from_photo: list[Floats], observations: Sequence[ControlPoints], root: int, loss_scale: float) -> None:
    """Refine one homography after the other against its neighbours, a few times round; the root stays."""
    both = [direction for o in observations for direction in (o, o.swapped())]
    for _ in range(SWEEPS):
        for n in range(len(plane_from_photo)):
            own = [o for o in both if o.i == n]
            if n == root or not own:
                continue
            src = np.vstack([o.xy_i for o in own])
            dst = np.vstack([homography.apply(plane_from_photo[o.j], o.xy_j) for o in own])
            usable = np.isfinite(dst).all(1)
            start = plane_from_photo[n]
            plane_from_photo[n] = homography.refine(start, src[usable], dst[usable], scale=loss_scale)


def _seen_from_middle(matrix: Floats, photo: Photo) -> Floats:
    """The homography from a photo with positive depth where the photo looks."""
    return homography.normalised(matrix, (np.array(photo.size) - 1) / 2)
