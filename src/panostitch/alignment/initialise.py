"""A start for the bundle adjustment: focal lengths to try, rotations along the best spanning tree."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

from panostitch.alignment.averaging import averaged
from panostitch.geometry import homography, rotation
from panostitch.model.camera import Camera
from panostitch.model.match import VerifiedMatch
from panostitch.model.photo import Photo

Floats = NDArray[np.float64]

# Horizontal fields of view to start from when nothing is known: from half to one and a half times the true focal
# length the adjustment converges, so these four cover every lens that is not a fisheye.
START_FIELDS = np.deg2rad([25.0, 40.0, 65.0, 100.0])


@dataclass(frozen=True)
class SpanningTree:
    """The strongest links that hold all photos together: (parent, child, link) from the root outwards."""

    root: int
    edges: tuple[tuple[int, int, VerifiedMatch], ...]


def focal_candidates(photos: Sequence[Photo], links: Sequence[VerifiedMatch]) -> list[list[float]]:
    """Sets of focal lengths (px, one for each photo) to start from, the likeliest first."""
    long_sides = [float(max(photo.size)) for photo in photos]
    known = [photo.focal / side for photo, side in zip(photos, long_sides, strict=True) if photo.focal]
    relative = [float(np.median(known))] if known else []
    relative += _from_homographies(photos, links)
    relative += [float(0.5 / np.tan(field / 2)) for field in START_FIELDS]
    candidates = [[r * side for side in long_sides] for r in relative]
    if known:
        candidates[0] = [photo.focal or start for photo, start in zip(photos, candidates[0], strict=True)]
    return candidates


def _from_homographies(photos: Sequence[Photo], links: Sequence[VerifiedMatch]) -> list[float]:
    """Median focal length, relative to the long side, that the homographies themselves allow; may be empty."""
    found = []
    for link in links:
        centres = [(np.array(photos[n].size) - 1) / 2 for n in (link.i, link.j)]
        side = float(np.sqrt(max(photos[link.i].size) * max(photos[link.j].size)))
        found += [focal / side for focal in homography.focal_lengths(link.j_from_i, *centres)]
    plausible = [f for f in found if 0.2 < f < 20]
    return [float(np.median(plausible))] if plausible else []


def holds_together(count: int, links: Sequence[VerifiedMatch]) -> bool:
    """Whether the links connect all of `count` photos."""
    if not links:
        return count <= 1
    return bool(connected_components(_graph(count, links), directed=False)[0] == 1)


def _graph(count: int, links: Sequence[VerifiedMatch]) -> csr_array:
    """Photos and links as a sparse matrix (count, count); short where there are many inliers."""
    i, j = np.array([(link.i, link.j) for link in links], np.intp).T
    inliers = np.array([link.inliers for link in links], np.float64)
    return coo_array((1 / inliers, (i, j)), shape=(count, count)).tocsr()


def spanning_tree(count: int, links: Sequence[VerifiedMatch]) -> SpanningTree:
    """The tree of most inliers over `count` connected photos; its root is the best connected photo."""
    tree = minimum_spanning_tree(_graph(count, links))
    both_ways = tree + tree.T
    strength = np.zeros(count)
    for link in links:
        strength[[link.i, link.j]] += link.inliers
    root = int(np.argmax(strength))
    order, parents = breadth_first_order(both_ways, root, directed=False)
    by_pair = {(link.i, link.j): link for link in links}
    edges = []
    for child in map(int, order[1:]):
        parent = int(parents[child])
        edges.append((parent, child, by_pair[min(parent, child), max(parent, child)]))
    return SpanningTree(root, tuple(edges))


def child_from_parent(parent: int, link: VerifiedMatch) -> Floats:
    """The link's homography in the direction from the parent to the child."""
    return link.j_from_i if link.i == parent else np.asarray(np.linalg.inv(link.j_from_i), np.float64)


def initial_cameras(
    photos: Sequence[Photo], focals: Sequence[float], tree: SpanningTree, links: Sequence[VerifiedMatch]
) -> list[Camera]:
    """Cameras that turn about one point, from the links' homographies and given focal lengths (px).

    Turns are multiplied along the tree and then averaged over all links.
    """
    inner = [_intrinsics(photo, focal) for photo, focal in zip(photos, focals, strict=True)]
    turns = [np.eye(3) for _ in photos]
    for parent, child, link in tree.edges:
        turns[child] = _turn(child_from_parent(parent, link), inner[parent], inner[child]) @ turns[parent]
    relative = [_turn(link.j_from_i, inner[link.i], inner[link.j]) for link in links]
    turns = averaged(turns, [(link.i, link.j) for link in links], relative, [link.inliers for link in links])
    return [
        Camera(photo.size, focal, _centre(photo), turn)
        for photo, focal, turn in zip(photos, focals, turns, strict=True)
    ]


def _turn(homography: Floats, inner_i: Floats, inner_j: Floats) -> Floats:
    """The rotation (3, 3) nearest to a homography from photo i to photo j with these intrinsics."""
    turn = np.linalg.inv(inner_j) @ homography @ inner_i
    return rotation.nearest(turn / np.cbrt(np.linalg.det(turn)))


def zoomed_focals(photos: Sequence[Photo], focal: float, tree: SpanningTree) -> list[float]:
    """Focal lengths (px) of all photos from that of the tree's root, where each photo may have its own.

    With the parent's focal length known, the homography is the child's intrinsics times a rotation: its first two rows
    are longer than the third by the child's focal length.
    """
    focals = [focal] * len(photos)
    for parent, child, link in tree.edges:
        centred = np.eye(3)
        centred[:2, 2] = -np.array(_centre(photos[child]))
        rows = np.linalg.norm(
            centred @ child_from_parent(parent, link) @ _intrinsics(photos[parent], focals[parent]), axis=1
        )
        focals[child] = float(np.sqrt(rows[0] * rows[1]) / max(rows[2], 1e-12))
    return focals


def _centre(photo: Photo) -> tuple[float, float]:
    return (photo.size[0] - 1) / 2, (photo.size[1] - 1) / 2


def _intrinsics(photo: Photo, focal: float) -> Floats:
    x, y = _centre(photo)
    return np.array([[focal, 0, x], [0, focal, y], [0, 0, 1]])
