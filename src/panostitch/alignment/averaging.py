"""Rotation averaging: turns of all photos from relative turns of pairs, which never quite agree.

Turns that were multiplied along a tree carry all errors to its leaves, and a ring stays open at one place. Here they
are moved until the disagreement is shared: reweighted least squares over the graph of links (Chatterjee & Govindu,
"Efficient and robust large-scale rotation averaging", ICCV 2013).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from panostitch.alignment import loss
from panostitch.geometry import rotation

Floats = NDArray[np.float64]

STEPS = 12
ARRIVED = 1e-7  # radians
TOLERATED = np.deg2rad(5.0)  # a pair that disagrees by more counts less and less: it may be a wrong link


def averaged(
    turns: Sequence[Floats], pairs: Sequence[tuple[int, int]], relative: Sequence[Floats], weights: Sequence[float]
) -> list[Floats]:
    """Turns (3, 3) `cam_from_world` of n photos that agree best with the relative ones; the first photo stays.

    relative: (3, 3) from the camera of i to that of j for each pair (i, j)
    weights:  of the pairs, for instance their inliers
    """
    if len(turns) < 2 or not pairs:
        return list(turns)
    found = np.array(turns)
    i, j = np.array(pairs, np.intp).T
    measured, given = np.array(relative), np.asarray(weights, np.float64)
    for _ in range(STEPS):
        # from the world by way of camera i to camera j, and straight back
        error = _vectors(found[j].transpose(0, 2, 1) @ measured @ found[i])
        weight = given * loss.weight((error**2).sum(1), TOLERATED)
        step = _shared(len(turns), i, j, error, weight)
        found = found @ rotation.exp(step)
        if np.abs(step).max() < ARRIVED:
            break
    return list(rotation.nearest(found))


def _shared(count: int, i: NDArray[np.intp], j: NDArray[np.intp], error: Floats, weight: Floats) -> Floats:
    """Turns (count, 3) of all photos, none of the first, whose differences come nearest to the errors of the pairs."""
    rows = np.arange(len(i))
    difference = coo_array(
        (np.repeat([1.0, -1.0], len(i)), (np.concatenate([rows, rows]), np.concatenate([j, i]))), (len(i), count)
    ).tocsc()[:, 1:]
    weighted = difference.multiply(weight[:, None])
    step = np.zeros((count, 3))
    normal = (difference.T @ weighted).tocsc()
    step[1:] = splu(normal).solve(weighted.T @ error)
    return step


def _vectors(turns: Floats) -> Floats:
    """Rotation vectors (n, 3) of turns (n, 3, 3) that are well below half a turn."""
    axis = np.stack(
        [turns[:, 2, 1] - turns[:, 1, 2], turns[:, 0, 2] - turns[:, 2, 0], turns[:, 1, 0] - turns[:, 0, 1]], axis=1
    )
    sine = np.linalg.norm(axis, axis=1) / 2
    cosine = (np.trace(turns, axis1=1, axis2=2) - 1) / 2
    angle = np.arctan2(sine, cosine)
    return np.asarray(axis * (np.where(sine > 1e-12, angle / np.maximum(2 * sine, 1e-12), 0.5))[:, None])
