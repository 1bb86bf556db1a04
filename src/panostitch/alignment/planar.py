"""A flat subject: each photo is a similarity, an affine transform or a homography of one common plane.

The plane's coordinates are the pixels of the root of the spanning tree. Transforms are fitted to the links along the
tree, and then all of them together to all matches.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from panostitch.alignment.bundle import Solution
from panostitch.alignment.initialise import SpanningTree, child_from_parent
from panostitch.alignment.levenberg import minimise
from panostitch.alignment.planar_problem import Kind, own_frames, planar_problem
from panostitch.geometry import homography
from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints, VerifiedMatch
from panostitch.model.photo import Photo

__all__ = ["Kind", "planar_cameras"]

Floats = NDArray[np.float64]

MAX_STEPS = 50
TOLERANCE = 1e-6  # share of the cost that a step must gain for another one to follow
WIDE = 8  # times the final loss scale: a rough start is not to be taken for a heap of outliers
ROUGHLY = 1e-3  # tolerance of the rough start


def planar_cameras(
    photos: Sequence[Photo],
    observations: Sequence[ControlPoints],
    tree: SpanningTree,
    *,
    kind: Kind,
    loss_scale: float,
    start: Sequence[Camera] | None = None,
) -> Solution:
    """Cameras whose `cam_from_world` sends plane coordinates (x, y, 1) to pixels, and the robust cost they reach.

    loss_scale: px beyond which a residual counts less and less (Cauchy)
    start:      cameras to start from; else from the links along the tree
    """
    if start is not None:
        return _adjusted(photos, observations, tree.root, [c.cam_from_world for c in start], kind, loss_scale)
    simpler: Kind = "affine" if kind == "homography" else kind
    rough = _roughly(photos, observations, tree.root, _chained(photos, tree, simpler), simpler, loss_scale)
    if kind == "homography":
        # a plane seen askance is far from any affine transform: the links' own homographies may be the better start
        starts = [[camera.cam_from_world for camera in rough.cameras], _chained(photos, tree, kind)]
        both = [_roughly(photos, observations, tree.root, matrices, kind, loss_scale) for matrices in starts]
        rough = min(both, key=lambda solution: solution.cost)
    found = [camera.cam_from_world for camera in rough.cameras]
    return _adjusted(photos, observations, tree.root, found, kind, loss_scale)


def _roughly(
    photos: Sequence[Photo],
    observations: Sequence[ControlPoints],
    root: int,
    start: Sequence[Floats],
    kind: Kind,
    loss_scale: float,
) -> Solution:
    """A start, photo from plane, made better with a wide loss."""
    return _adjusted(photos, observations, root, start, kind, WIDE * loss_scale, tolerance=ROUGHLY)


def _adjusted(
    photos: Sequence[Photo],
    observations: Sequence[ControlPoints],
    root: int,
    photo_from_plane: Sequence[Floats],
    kind: Kind,
    loss_scale: float,
    *,
    tolerance: float = TOLERANCE,
) -> Solution:
    sizes = [photo.size for photo in photos]
    problem = planar_problem(sizes, observations, root=root, kind=kind, loss_scale=loss_scale)
    frames = own_frames(sizes)
    plane_from_own = np.linalg.inv(np.array(photo_from_plane)) @ frames
    into_root = np.linalg.inv(plane_from_own[root])  # perspective is measured against a photo that is seen straight
    start = into_root @ plane_from_own
    found, cost = minimise(start / start[:, 2:, 2:], problem, max_steps=MAX_STEPS, tolerance=tolerance)
    plane = frames[root] @ found @ np.linalg.inv(frames)
    return Solution(tuple(_camera(photo, matrix) for photo, matrix in zip(photos, plane, strict=True)), cost)


def _camera(photo: Photo, plane_from_photo: Floats) -> Camera:
    """Depth is positive where the photo looks."""
    seen = homography.normalised(plane_from_photo, (np.array(photo.size) - 1) / 2)
    return Camera(photo.size, 1.0, (0.0, 0.0), np.asarray(np.linalg.inv(seen), np.float64))


def _chained(photos: Sequence[Photo], tree: SpanningTree, kind: Kind) -> list[Floats]:
    """Transforms (n, 3, 3), photo from plane, multiplied along the tree."""
    found = [np.eye(3) for _ in photos]
    for parent, child, link in tree.edges:
        found[child] = _fitted(parent, link, kind) @ found[parent]
    return found


def _fitted(parent: int, link: VerifiedMatch, kind: Kind) -> Floats:
    """The child from the parent (3, 3) by the link's matches; its homography would lend its noise to the corners."""
    if kind == "homography":
        return child_from_parent(parent, link)
    src, dst = (link.xy_i, link.xy_j) if link.i == parent else (link.xy_j, link.xy_i)
    a, b = src - src.mean(0), dst - dst.mean(0)
    if kind == "affine":
        linear = np.linalg.lstsq(a, b, rcond=None)[0].T
    else:
        square = max(float((a**2).sum()), 1e-12)
        c, s = float((a * b).sum()) / square, float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()) / square
        linear = np.array([[c, -s], [s, c]])
    matrix = np.eye(3)
    matrix[:2, :2] = linear
    matrix[:2, 2] = dst.mean(0) - linear @ src.mean(0)
    return matrix
