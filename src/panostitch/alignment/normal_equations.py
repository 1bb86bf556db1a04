"""Normal equations in blocks: each pair of photos adds a small dense block, most of the matrix stays empty.

The places of the blocks are the same in every step and are worked out once. Sums run in the order of the matches and
nothing is left to a threaded library before the factorisation, so that results do not depend on the number of threads.
Triggs et al., "Bundle Adjustment - A Modern Synthesis", 1999, section 6; ordering: Liu 1985; LU: SuperLU, Li 2005.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import SuperLU, splu

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

FIXED = -1  # stands for the column of a parameter that does not change
# Smallest diagonal entry that counts, as a share of the largest: an unknown that no match sees stays where it is.
SMALLEST = 1e-12


@dataclass(frozen=True)
class Pattern:
    """Where the entries of all blocks stand in the sparse matrix.

    size:     number of unknowns
    slot:     for each entry of the blocks, flattened, its place among the stored entries; `stored` if it is dropped
    row:      for each entry of the gradients, flattened, its unknown; `size` if it is dropped
    diagonal: (size,) places of the diagonal among the stored entries
    indices, indptr: rows and column starts of the stored entries, as scipy.sparse has them
    """

    size: int
    slot: Indices
    row: Indices
    diagonal: Indices
    indices: Indices
    indptr: Indices

    @property
    def stored(self) -> int:
        """Number of entries that are not known to be zero."""
        return len(self.indices)


@dataclass(frozen=True)
class Equations:
    """A symmetric matrix (size, size), half the second derivative of the cost, and its `gradient` (size,), half too."""

    pattern: Pattern
    values: Floats
    gradient: Floats

    def plus(self, diagonal: Floats, gradient: Floats) -> "Equations":
        """The same with (size,) added to the diagonal and to the gradient: a prior for each unknown."""
        return Equations(self.pattern, self._with_diagonal(diagonal), self.gradient + gradient)

    def step(self, damping: float) -> Floats:
        """The step (size,) of Levenberg and Marquardt: each diagonal entry is larger by the share `damping`."""
        diagonal = self.values[self.pattern.diagonal]
        floor = 1e-9 * diagonal.max(initial=1e-9)
        damped = _factorised(self.pattern, self._with_diagonal(damping * np.maximum(diagonal, floor)))
        return np.asarray(-damped.solve(self.gradient))

    def factorised(self) -> SuperLU:
        """What solves the equations, for many right-hand sides."""
        return _factorised(self.pattern, self.values)

    def _with_diagonal(self, added: Floats) -> Floats:
        values = self.values.copy()
        values[self.pattern.diagonal] += added
        return values


def pattern(columns: Indices, size: int) -> Pattern:
    """The places of blocks whose rows and columns (pairs, c) are these unknowns, or FIXED."""
    wide = columns.shape[1]
    rows, cols = np.repeat(columns, wide, axis=1).ravel(), np.tile(columns, wide).ravel()
    kept = (rows != FIXED) & (cols != FIXED)
    on_diagonal = np.arange(size) * (size + 1)  # always stored, so that it can be damped
    keys = np.concatenate([on_diagonal, cols[kept] * size + rows[kept]])
    unique, inverse = np.unique(keys, return_inverse=True)
    slot = np.full(rows.shape, len(unique), np.intp)
    slot[kept] = inverse[size:]
    starts = np.concatenate([[0], np.cumsum(np.bincount(unique // max(size, 1), minlength=size))])
    row = np.where(columns == FIXED, size, columns).ravel()
    return Pattern(size, slot, row, inverse[:size], (unique % max(size, 1)).astype(np.intc), starts.astype(np.intc))


def assembled(places: Pattern, blocks: Floats, gradients: Floats) -> Equations:
    """All blocks (pairs, c, c) and gradients (pairs, c) added up."""
    values = np.bincount(places.slot, blocks.ravel(), places.stored + 1)[:-1]
    gradient = np.bincount(places.row, gradients.ravel(), places.size + 1)[:-1]
    return Equations(places, np.asarray(values, np.float64), np.asarray(gradient, np.float64))


def pair_products(jacobian: Floats, value: Floats, bounds: Indices) -> tuple[Floats, Floats]:
    """J^T J (pairs, c, c) and J^T r (pairs, c) of the matches of each pair.

    jacobian: (2, c, m); value: (2, m); bounds: (pairs,) where each pair begins, none of them empty
    """
    both = np.concatenate([jacobian, value[:, None]], axis=1)
    wide = jacobian.shape[1]
    blocks, gradients = np.empty((len(bounds), wide, wide)), np.empty((len(bounds), wide))
    for c in range(wide):
        products = both[0, c] * both[0, c:] + both[1, c] * both[1, c:]
        sums = np.add.reduceat(products, bounds, axis=1).T
        blocks[:, c, c:] = blocks[:, c:, c] = sums[:, :-1]
        gradients[:, c] = sums[:, -1]
    return blocks, gradients


def _factorised(places: Pattern, values: Floats) -> SuperLU:
    diagonal = values[places.diagonal]
    values = values.copy()
    values[places.diagonal] = np.maximum(diagonal, SMALLEST * diagonal.max(initial=SMALLEST))
    matrix = csc_array((values, places.indices, places.indptr), shape=(places.size, places.size))
    # symmetric and positive definite: pivots may stay on the diagonal, which keeps the factors sparse
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
