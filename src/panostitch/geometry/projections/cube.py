"""Cube: six rectilinear views of 90 degrees in a row, the faces of a cube around the camera; the whole sphere.

Left, front, right, back, up, down, seen from inside, in the order of krpano's and Photo Sphere Viewer's strips. A face
is 2 wide; the first four stand side by side as in the world; up stands above front, and down below it.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FACES = ("left", "front", "right", "back", "up", "down")
FRONT = FACES.index("front")
# of each face: what is right, down and forward in it
AXES = np.array(
    [
        [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
        [[-1, 0, 0], [0, 1, 0], [0, 0, -1]],
        [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    ],
    np.float64,
)


def forward(rays: Floats, face: float | None = None) -> Floats:
    """Rays (n, 3) to the plane (n, 2); all on one face, extended, if that is given: NaN for what lies behind it."""
    depths = rays @ AXES[:, 2].T
    faces = depths.argmax(1) if face is None else np.full(len(rays), int(face))
    right, down, depth = np.einsum("nij,nj->in", AXES[faces], rays)
    depth = np.where(depth > 0, depth, np.nan)
    return np.column_stack([right / depth + 2 * (faces - FRONT), down / depth])


def inverse(uv: Floats, face: float | None = None) -> Floats:
    """The plane (n, 2) to rays (n, 3), NaN beside the faces; if one is given, the plane is that face, extended."""
    if face is None:
        faces = np.floor((uv[:, 0] + 1) / 2) + FRONT
        shown = (faces >= 0) & (faces < len(FACES)) & (np.abs(uv[:, 1]) <= 1)
        faces = np.where(shown, faces, FRONT).astype(int)
    else:
        faces, shown = np.full(len(uv), int(face)), np.ones(len(uv), bool)
    ahead = np.where(shown, 1.0, np.nan)
    on_face = np.column_stack([uv[:, 0] - 2 * (faces - FRONT), uv[:, 1], ahead])
    return np.asarray(np.einsum("nij,ni->nj", AXES[faces], on_face))
