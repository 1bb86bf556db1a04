"""Turning cameras as a problem for Levenberg-Marquardt: reprojection of matches, and what is known of lenses."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from panostitch.alignment import loss, residuals
from panostitch.alignment.normal_equations import Equations, Pattern, assembled, pair_products, pattern
from panostitch.alignment.precision import squares, whitened, whitening
from panostitch.alignment.residuals import CameraArrays, Matches, Tangent, View, by_lens, by_turn, in_a_row
from panostitch.alignment.unknowns import Freedom, Unknowns, moved, unknowns
from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

# Standard deviation of the principal point from the middle of the photo, as a share of the long side: on a narrow
# panorama it is hardly to be told from a turn, and is then better left where makers put it.
CENTRE_SPREAD = 0.02
MAX_SHIFT = 0.15  # of the principal point from the middle, as a share of the long side


@dataclass(frozen=True)
class Middles:
    """Where principal points are expected: `expected` (2, n) px of each camera, `spread` (n,) px around it.

    columns: (groups, 2) unknowns of the principal points that are free, each once
    photos:  (groups,) a photo of each
    """

    expected: Floats
    spread: Floats
    columns: Indices
    photos: Indices

    def strays(self, cameras: CameraArrays) -> Floats:
        """How far (groups, 2) principal points are off, in units of the spread."""
        off = (cameras.lenses.centre - self.expected) / self.spread
        return np.asarray(off[:, self.photos].T)

    def possible(self, cameras: CameraArrays) -> bool:
        """Whether all are where they could be."""
        off = np.abs(self.strays(cameras)).max(initial=0.0)
        return bool(off * CENTRE_SPREAD <= MAX_SHIFT)


@dataclass(frozen=True)
class Slopes:
    """Derivatives, what whitens the residuals (3, m), and their noise (px), by which what is expected is weighed."""

    tangent: Tangent
    factor: Floats
    noise: float


@dataclass(frozen=True)
class TurningProblem:
    """Matches, unknowns, and where the blocks of the pairs stand among the normal equations."""

    matches: Matches
    places: Unknowns
    layout: Pattern
    middles: Middles
    loss_scale: float

    def view(self, parameters: CameraArrays) -> View:
        """The residuals."""
        return residuals.view(parameters, self.matches)

    def tangent(self, view: View) -> Slopes:
        """The first derivatives."""
        tangent = residuals.tangent(view)
        factor = whitening(tangent.by_point)
        return Slopes(tangent, factor, loss.noise(squares(factor, view.value), self.loss_scale))

    def squares(self, view: View, slopes: Slopes) -> Floats:
        """Squared lengths (m,) px^2 of the whitened residuals."""
        return squares(slopes.factor, view.value)

    def cost(self, view: View, slopes: Slopes) -> float:
        """The loss of the matches and of the principal points."""
        strays = float((self.middles.strays(view.cameras) ** 2).sum())
        return loss.cost(self.squares(view, slopes), self.loss_scale) + 0.5 * slopes.noise**2 * strays

    def equations(self, view: View, slopes: Slopes) -> Equations:
        """J^T W J and J^T W r, with what is known of the principal points."""
        free = self.places.freedom
        lens_i, lens_j = by_lens(view, slopes.tangent, terms=free.terms, centres=free.centres)
        jacobian = np.concatenate([by_turn(view, slopes.tangent), lens_i, lens_j], axis=1)
        weighted = slopes.factor * np.sqrt(loss.weight(self.squares(view, slopes), self.loss_scale))
        blocks, gradients = pair_products(
            whitened(weighted, jacobian), whitened(weighted, view.value), self.matches.bounds[:-1]
        )
        blocks, gradients = self._for_both_turns(blocks, gradients, view.cameras)
        equations = assembled(self.layout, blocks, gradients)
        return self._with_middles(equations, view.cameras, slopes.noise) if free.centres else equations

    def moved(self, parameters: CameraArrays, step: Floats) -> CameraArrays | None:
        """The cameras after a step; None if a lens would leave what is possible."""
        after = moved(parameters, self.places, step)
        return after if after is not None and self.middles.possible(after) else None

    def _for_both_turns(self, blocks: Floats, gradients: Floats, cameras: CameraArrays) -> tuple[Floats, Floats]:
        """The sums of each pair, by rotations in the world's axes: of camera i, then of camera j."""
        count, wide = gradients.shape
        expand = np.zeros((count, wide, wide + 3))
        turns = cameras.turns.transpose(2, 0, 1)[self.matches.j[self.matches.bounds[:-1]]]
        expand[:, :3, :3], expand[:, :3, 3:6] = -turns, turns
        expand[:, range(3, wide), range(6, wide + 3)] = 1.0
        across = expand.transpose(0, 2, 1)
        return np.matmul(np.matmul(across, blocks), expand), np.matmul(across, gradients[:, :, None])[:, :, 0]

    def _with_middles(self, equations: Equations, cameras: CameraArrays, noise: float) -> Equations:
        diagonal, gradient = np.zeros(self.places.size), np.zeros(self.places.size)
        stiffness = noise / self.middles.spread[self.middles.photos, None]
        diagonal[self.middles.columns] = stiffness**2
        gradient[self.middles.columns] = stiffness * noise * self.middles.strays(cameras)
        return equations.plus(diagonal, gradient)


def turning_problem(
    cameras: Sequence[Camera], observations: Sequence[ControlPoints], freedom: Freedom, loss_scale: float
) -> TurningProblem:
    """The problem of these cameras; `loss_scale` in px."""
    matches, places = in_a_row(observations), unknowns(cameras, freedom)
    first = matches.bounds[:-1]
    i, j = matches.i[first], matches.j[first]
    # in the order of the blocks' rows: rotation i, rotation j, lens i, lens j
    columns = np.hstack([places.turns[i], places.turns[j], places.lens[i], places.lens[j]])
    return TurningProblem(matches, places, pattern(columns, places.size), _middles(cameras, places), loss_scale)


def _middles(cameras: Sequence[Camera], places: Unknowns) -> Middles:
    sizes = np.array([camera.size for camera in cameras], np.float64)
    columns, photos = places.centres
    return Middles((sizes.T - 1) / 2, CENTRE_SPREAD * sizes.max(1), columns, photos)
