"""Photos of a plane as a problem for Levenberg-Marquardt.

Each photo has a transform (3, 3) from its pixels to the plane. It changes by (1 + D) applied in the photo's own
coordinates, shifted and scaled to about one, where D has as many free entries as the kind of transform. Residuals are
distances in the photos, not on the plane: on the plane all would become small by making all photos small.
Hartley & Zisserman 2004, chapter 4; Triggs et al. 1999.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from panostitch.alignment import loss
from panostitch.alignment.normal_equations import FIXED, Equations, Pattern, assembled, pair_products, pattern
from panostitch.alignment.precision import squares, whitened, whitening
from panostitch.alignment.residuals import BEHIND, Matches, in_a_row
from panostitch.model.match import ControlPoints

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]
Kind = Literal["similarity", "affine", "homography"]


def _entries(*chosen: Sequence[tuple[int, int, float]]) -> Floats:
    basis = np.zeros((len(chosen), 3, 3))
    for matrix, entries in zip(basis, chosen, strict=True):
        for row, column, value in entries:
            matrix[row, column] = value
    return basis


_SHIFTS = ([(0, 2, 1.0)], [(1, 2, 1.0)])
_STRETCHES = ([(0, 0, 1.0)], [(0, 1, 1.0)], [(1, 0, 1.0)], [(1, 1, 1.0)])
# What D is made of (d, 3, 3), for each kind.
BASIS: dict[Kind, Floats] = {
    "similarity": _entries([(0, 0, 1.0), (1, 1, 1.0)], [(0, 1, -1.0), (1, 0, 1.0)], *_SHIFTS),
    "affine": _entries(*_STRETCHES, *_SHIFTS),
    "homography": _entries(*_STRETCHES, *_SHIFTS, [(2, 0, 1.0)], [(2, 1, 1.0)]),
}

# Standard deviation of how much the depth changes from the middle of a photo to its corner, as a share: 0.3 is a
# camera that looks some 25 degrees askance. It keeps a long strip, whose photos each add a little, from bending away.
# To be off by so much costs as much as one match that is off by the noise: a hundred good matches outweigh it.
PERSPECTIVE_SPREAD = 0.3
STEP_LIMIT = 0.5  # of any entry of D: beyond, a photo would fold or vanish


@dataclass(frozen=True)
class PlanarView:
    """What transforms make of m matches.

    plane:    (n, 3, 3) transforms, from the photos' own coordinates to the plane
    value:    (2, m) px of photo j, the residual; large where a point comes from behind
    seen:     (m,) whether it does not
    j_from_i: (3, 3, m) between the photos' own coordinates
    arrived:  (2, m) own coordinates in photo j; depth: (m,) what they were divided by
    """

    plane: Floats
    value: Floats
    seen: NDArray[np.bool_]
    j_from_i: Floats
    arrived: Floats
    depth: Floats


@dataclass(frozen=True)
class Slopes:
    """First derivatives.

    by_point: (2, 3, m) of the residual, by the point of photo i before division
    factor:   (3, m) what whitens the residuals; noise: px, by which what is expected is weighed
    """

    by_point: Floats
    factor: Floats
    noise: float


@dataclass(frozen=True)
class PlanarProblem:
    """Matches in the photos' own coordinates, and where the blocks of the pairs stand among the normal equations.

    frames:  (n, 3, 3) from own coordinates to pixels
    columns: (n, d) unknowns of each photo; FIXED for the root
    """

    matches: Matches
    frames: Floats
    basis: Floats
    columns: Indices
    layout: Pattern
    loss_scale: float

    def view(self, parameters: Floats) -> PlanarView:
        """The residuals."""
        first = self.matches.bounds[:-1]
        i, j = self.matches.i[first], self.matches.j[first]
        pairs = np.matmul(np.linalg.inv(parameters[j]), parameters[i])
        relative = np.repeat(np.ascontiguousarray(pairs.transpose(1, 2, 0)), np.diff(self.matches.bounds), axis=2)
        x = self.matches.xy_i
        there = relative[:, 0] * x[0] + relative[:, 1] * x[1] + relative[:, 2]
        seen = there[2] > 1e-9
        depth = np.where(seen, there[2], 1.0)
        arrived = there[:2] / depth
        value = np.where(seen, (arrived - self.matches.xy_j) * self._px(self.matches.j), BEHIND)
        return PlanarView(parameters, value, seen, relative, arrived, depth)

    def tangent(self, view: PlanarView) -> Slopes:
        """The first derivatives."""
        moves = view.j_from_i[:2] - view.arrived[:, None] * view.j_from_i[2]
        by_point = moves * (np.where(view.seen, self._px(self.matches.j), 0.0) / view.depth)
        factor = whitening(by_point[:, :2] / self._px(self.matches.i))
        return Slopes(by_point, factor, loss.noise(squares(factor, view.value), self.loss_scale))

    def squares(self, view: PlanarView, slopes: Slopes) -> Floats:
        """Squared lengths (m,) px^2 of the whitened residuals."""
        return squares(slopes.factor, view.value)

    def cost(self, view: PlanarView, slopes: Slopes) -> float:
        """The loss of the matches and of the perspective."""
        strays = float((_perspective(view.plane) ** 2).sum()) / PERSPECTIVE_SPREAD**2
        return loss.cost(self.squares(view, slopes), self.loss_scale) + 0.5 * slopes.noise**2 * strays

    def equations(self, view: PlanarView, slopes: Slopes) -> Equations:
        """J^T W J and J^T W r, with what is known of the perspective."""
        weighted = slopes.factor * np.sqrt(loss.weight(self.squares(view, slopes), self.loss_scale))
        jacobian = np.concatenate([self.by_first(slopes), self.by_second(view)], axis=1)
        products = pair_products(whitened(weighted, jacobian), whitened(weighted, view.value), self.matches.bounds[:-1])
        blocks, gradients = self._prior(view.plane, slopes.noise)
        wide = self.basis.shape[0]
        blocks = np.concatenate([products[0], np.pad(blocks, ((0, 0), (0, wide), (0, wide)))])
        gradients = np.concatenate([products[1], np.pad(gradients, ((0, 0), (0, wide)))])
        return assembled(self.layout, blocks, gradients)

    def moved(self, parameters: Floats, step: Floats) -> Floats | None:
        """The transforms after a step; None if a photo would fold or vanish."""
        if np.abs(step).max(initial=0.0) > STEP_LIMIT:
            return None
        change = np.append(step, 0.0)[self.columns]  # FIXED is the last entry
        after = parameters @ (np.eye(3) + np.tensordot(change, self.basis, 1))
        depth = after[:, 2:, 2:]
        return np.asarray(after / depth) if (depth > 0).all() else None

    def _px(self, photos: Indices) -> Floats:
        """Pixels (m,) per unit of the own coordinates of these photos."""
        return np.asarray(self.frames[photos, 0, 0])

    def by_first(self, slopes: Slopes) -> Floats:
        """Derivative (2, d, m) by D of photo i."""
        return _through(self.basis, slopes.by_point, self.matches.xy_i)

    def by_second(self, view: PlanarView) -> Floats:
        """Derivative (2, d, m) by D of photo j, which moves points the other way."""
        scale = np.where(view.seen, self._px(self.matches.j), 0.0)
        x, zero = view.arrived, np.zeros(len(scale))
        by_point = np.stack([np.stack([scale, zero, -scale * x[0]]), np.stack([zero, scale, -scale * x[1]])])
        return -_through(self.basis, by_point, x)

    def _prior(self, plane: Floats, noise: float) -> tuple[Floats, Floats]:
        """Blocks (n, d, d) and gradients (n, d): the perspective of each photo is nought, more or less."""
        row = plane[:, 2] / plane[:, 2:, 2]
        change = np.einsum("nr,drc->ndc", row, self.basis)
        rows = (change[..., :2] - change[..., 2:] * row[:, None, :2]) * (noise / PERSPECTIVE_SPREAD)
        off = _perspective(plane) * (noise / PERSPECTIVE_SPREAD)
        return rows @ rows.transpose(0, 2, 1), np.einsum("ndc,nc->nd", rows, off)


def _perspective(plane: Floats) -> Floats:
    """Relative change of the depth (n, 2) from the middle of each photo outwards."""
    return np.asarray(plane[:, 2, :2] / plane[:, 2, 2:])


def _through(basis: Floats, by_point: Floats, xy: Floats) -> Floats:
    """Derivative (2, d, m) by the coefficients of the basis, of what has the derivative `by_point` (2, 3, m)."""
    jacobian = np.zeros((2, len(basis), xy.shape[1]))
    for d, row, column in np.argwhere(basis):
        source = xy[column] if column < 2 else 1.0
        jacobian[:, d] += basis[d, row, column] * by_point[:, row] * source
    return jacobian


def planar_problem(
    sizes: Sequence[tuple[int, int]],
    observations: Sequence[ControlPoints],
    *,
    root: int,
    kind: Kind,
    loss_scale: float,
) -> PlanarProblem:
    """The problem of photos of these sizes (width, height) px; the root's transform stays."""
    frames = own_frames(sizes)
    matches = in_a_row(observations)
    into = np.asarray(np.linalg.inv(frames), np.float64)
    own = Matches(
        matches.i,
        matches.j,
        _applied(into[matches.i], matches.xy_i),
        _applied(into[matches.j], matches.xy_j),
        matches.bounds,
    )
    free = len(BASIS[kind])
    columns = np.full((len(sizes), free), FIXED, np.intp)
    columns[np.arange(len(sizes)) != root] = np.arange(free * (len(sizes) - 1)).reshape(-1, free)
    first = matches.bounds[:-1]
    pairs = np.hstack([columns[matches.i[first]], columns[matches.j[first]]])
    alone = np.hstack([columns, np.full_like(columns, FIXED)])  # the priors
    layout = pattern(np.vstack([pairs, alone]), free * (len(sizes) - 1))
    return PlanarProblem(own, frames, BASIS[kind], columns, layout, loss_scale)


def own_frames(sizes: Sequence[tuple[int, int]]) -> Floats:
    """From own coordinates of each photo to its pixels (n, 3, 3): the middle is nought, the corners lie at one."""
    frames = np.zeros((len(sizes), 3, 3))
    for frame, size in zip(frames, sizes, strict=True):
        radius = np.hypot(*size) / 2
        frame[:] = [[radius, 0, (size[0] - 1) / 2], [0, radius, (size[1] - 1) / 2], [0, 0, 1]]
    return frames


def _applied(matrices: Floats, xy: Floats) -> Floats:
    """Affine transforms (m, 3, 3) of points (2, m)."""
    return np.asarray(np.einsum("mab,bm->am", matrices[:, :2, :2], xy) + matrices[:, :2, 2].T)
