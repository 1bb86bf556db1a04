"""Where a photo departs from its camera: a smooth displacement of its pixels on a coarse mesh."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from panostitch.geometry import spline

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

CELLS = 24  # along the longer side of a photo, at most
STEEPEST = 0.5  # px by which the displacement may change from one px to the next: far from any fold
ARRIVED = 1e-9  # px
MOST_ROUNDS = 60  # each at least halves the error: STEEPEST


@dataclass(frozen=True)
class Mesh:
    """A cubic B-spline over the photo's pixels: what the camera sees at q, the photo shows at q + displacement(q).

    size:  (width, height) px of the photo
    nodes: (rows + 3, columns + 3, 2) px, of rows x columns equal cells; see geometry.spline
    """

    size: tuple[int, int]
    nodes: Floats

    @property
    def cells(self) -> tuple[int, int]:
        """Columns and rows of cells."""
        return self.nodes.shape[1] - 3, self.nodes.shape[0] - 3

    @property
    def steepness(self) -> float:
        """Px by which the displacement changes from one px to the next, at most; below 1 nothing folds."""
        step = np.array(self.size) / self.cells
        across = np.linalg.norm(np.diff(self.nodes, axis=1), axis=2).max() / step[0]
        down = np.linalg.norm(np.diff(self.nodes, axis=0), axis=2).max() / step[1]
        return float(np.hypot(across, down))

    @property
    def largest(self) -> float:
        """Length px of the largest displacement: at most that of a node."""
        return float(np.linalg.norm(self.nodes, axis=2).max())

    def terms(self, xy: Floats) -> tuple[Indices, Floats]:
        """The 16 nodes (16, n), numbered row by row, that the displacement of pixels (n, 2) sees, and their weights."""
        first, across, down = self._among_nodes(xy)
        reach = np.arange(spline.ORDER)
        numbers = first + reach[:, None, None] * self.nodes.shape[1] + reach[:, None]
        return numbers.reshape(16, -1), (down[:, None] * across[None]).reshape(16, -1)

    def displacement(self, xy: Floats) -> Floats:
        """Displacement (n, 2) px of pixels (n, 2); beyond the photo's edge as at the edge."""
        first, across, down = self._among_nodes(xy)
        nodes = self.nodes[..., 0].ravel() + 1j * self.nodes[..., 1].ravel()  # a number each is faster than two
        found = np.zeros(len(xy), np.complex128)
        for r in range(spline.ORDER):  # one by one: a large region need not hold all of them
            line = sum(across[c] * nodes[first + (r * self.nodes.shape[1] + c)] for c in range(spline.ORDER))
            found += down[r] * line
        return np.column_stack([found.real, found.imag])

    def _among_nodes(self, xy: Floats) -> tuple[Indices, Floats, Floats]:
        """The number (n,) of the first node that each pixel (n, 2) sees, and weights (4, n) of columns and of rows."""
        columns, rows = self.cells
        place = (xy + 0.5) / self.size * self.cells
        left, across = spline.weights(place[:, 0], columns)
        top, down = spline.weights(place[:, 1], rows)
        return top * self.nodes.shape[1] + left, across, down

    def bent(self, xy: Floats) -> Floats:
        """Where the photo shows what its camera sees at pixels (n, 2); NaN stays NaN."""
        return np.asarray(xy + self.displacement(xy))

    def straightened(self, xy: Floats) -> Floats:
        """Where the camera sees what the photo shows at pixels (n, 2): the inverse of `bent`, by fixed point."""
        found = np.array(xy, np.float64)
        for _ in range(MOST_ROUNDS):
            before, found = found, xy - self.displacement(found)
            if np.abs(found - before).max(initial=0.0) < ARRIVED:
                break
        return found

    def scaled(self, size: tuple[int, int]) -> "Mesh":
        """The mesh of the same photo at another size (width, height) px."""
        return Mesh(size, self.nodes * (np.array(size) / self.size))


def flat_mesh(size: tuple[int, int], cells: int = CELLS) -> Mesh:
    """The mesh of a photo of this size that displaces nothing; so many cells along its longer side, about square."""
    step = max(size) / cells
    columns, rows = (max(1, round(n / step)) for n in size)
    return Mesh(size, np.zeros((rows + 3, columns + 3, 2)))


def mesh_from_json(nodes: Any, size: tuple[int, int]) -> Mesh:
    """The mesh whose nodes an entry of a project file holds. Nonsense raises TypeError or ValueError."""
    found = np.array(nodes, np.float64)
    if found.ndim != 3 or min(found.shape[:2]) < spline.ORDER or found.shape[2] != 2 or not np.isfinite(found).all():
        raise ValueError("mesh is not made of finite numbers, 4 x 4 or more")
    mesh = Mesh(size, found)
    if mesh.steepness >= 1:
        raise ValueError("mesh folds")
    return mesh
