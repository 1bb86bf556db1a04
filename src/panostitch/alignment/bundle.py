"""Bundle adjustment of turning cameras by Levenberg-Marquardt with a robust loss.

Unknown are a rotation for each photo but the first, which fixes the world's axes, and for each lens group the focal
length, k1 and k2 as far as they are freed. There are no 3D points: a match is the agreement of two rays. Normal
equations are filled by blocks, pair by pair. Brown & Lowe 2007, section 4; Marquardt 1963.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from panostitch.alignment.residuals import BEHIND, Matches, in_a_row, linearise, reprojection
from panostitch.geometry import rotation
from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints

Floats = NDArray[np.float64]

START_DAMPING = 1e-3
MAX_DAMPING = 1e8
LENS_STEP_LIMIT = 0.3  # relative change of the focal length in one step
MAX_K1, MAX_K2 = 2.0, 4.0


@dataclass(frozen=True)
class Solution:
    """Adjusted cameras and the robust cost (px^2) they reach."""

    cameras: tuple[Camera, ...]
    cost: float


@dataclass(frozen=True)
class Freedom:
    """What the adjustment may change besides the rotations.

    focals: for each camera the number of its focal length; cameras of one number share it
    lenses: for each camera the number of its distortion
    terms:  how many of (k1, k2) are free
    """

    focals: tuple[int, ...]
    lenses: tuple[int, ...]
    terms: int = 0

    @property
    def parameters(self) -> int:
        """Number of unknowns, three for each rotation included."""
        return 3 * len(self.focals) + max(self.focals) + 1 + self.terms * (max(self.lenses) + 1)

    def columns(self, camera: int) -> list[int]:
        """Where the focal length and the distortion of a camera stand among the unknowns, after all rotations."""
        first = 3 * len(self.focals)
        distortion = first + max(self.focals) + 1 + self.terms * self.lenses[camera]
        return [first + self.focals[camera], *range(distortion, distortion + self.terms)]


def adjust(
    cameras: Sequence[Camera],
    observations: Sequence[ControlPoints],
    freedom: Freedom,
    *,
    loss_scale: float,
    max_steps: int = 50,
    tolerance: float = 1e-6,
) -> Solution:
    """Minimise the robust reprojection error over rotations and lenses.

    loss_scale: px beyond which a residual counts less and less (Cauchy)
    max_steps, tolerance: it ends after so many steps, or when one lowers the cost by a smaller share than this
    """
    matches = in_a_row([direction for o in observations for direction in (o, o.swapped())])
    current = tuple(cameras)
    cost = _cost(current, matches, loss_scale)
    damping, step = START_DAMPING, 0
    while step < max_steps and damping < MAX_DAMPING:
        step += 1
        normal, gradient = _normal_equations(current, matches, freedom, loss_scale)
        accepted = False
        while not accepted and damping < MAX_DAMPING:
            candidate = _moved(current, _solve(normal, gradient, damping), freedom)
            candidate_cost = _cost(candidate, matches, loss_scale) if candidate else np.inf
            accepted = candidate_cost <= cost
            damping = max(damping / 10, 1e-12) if accepted else damping * 10
        if not accepted or candidate is None:
            break
        gain, current, cost = cost - candidate_cost, candidate, candidate_cost
        if gain <= tolerance * max(cost, 1e-300):
            break
    return Solution(current, cost)


def distances(cameras: Sequence[Camera], observation: ControlPoints) -> Floats:
    """Distance (n,) px of each match in photo j; for cameras of any model."""
    there = cameras[observation.j].project(cameras[observation.i].rays(observation.xy_i))
    return np.asarray(np.nan_to_num(np.linalg.norm(there - observation.xy_j, axis=1), nan=BEHIND))


def _cost(cameras: Sequence[Camera], matches: Matches, scale: float) -> float:
    """Cauchy loss, in px^2: half the sum of squares where residuals are small."""
    square = (reprojection(cameras, matches) ** 2).sum(1)
    return float(0.5 * scale**2 * np.log1p(square / scale**2).sum())


def _normal_equations(
    cameras: Sequence[Camera], matches: Matches, freedom: Freedom, scale: float
) -> tuple[Floats, Floats]:
    """Weighted J^T J and J^T r, over all rotations and then all lenses."""
    normal, gradient = np.zeros((freedom.parameters, freedom.parameters)), np.zeros(freedom.parameters)
    residuals = linearise(cameras, matches)
    free = 1 + freedom.terms
    kept = [*range(6), *range(6, 6 + free), *range(9, 9 + free)]
    weight = np.sqrt(1 / (1 + (residuals.value**2).sum(1) / scale**2))
    rows = residuals.jacobian[:, :, kept] * weight[:, None, None]
    values = residuals.value * weight[:, None]
    for begin, end in pairwise(matches.bounds):
        i, j = int(matches.i[begin]), int(matches.j[begin])
        turns = [*range(3 * i, 3 * i + 3), *range(3 * j, 3 * j + 3)]
        columns = [*turns, *freedom.columns(i), *freedom.columns(j)]
        block = rows[begin:end].reshape(-1, len(kept))
        # a lens shared by both photos stands twice among the columns: add, do not assign
        np.add.at(normal, np.ix_(columns, columns), block.T @ block)
        np.add.at(gradient, columns, block.T @ values[begin:end].reshape(-1))
    return normal, gradient


def _solve(normal: Floats, gradient: Floats, damping: float) -> Floats:
    """The damped step; the first rotation stays where it is, since only relative rotations are seen."""
    step = np.zeros(len(gradient))
    diagonal = np.diag(normal)[3:]
    damped = normal[3:, 3:] + np.diag(damping * np.maximum(diagonal, 1e-9 * diagonal.max(initial=1e-9)))
    step[3:] = -np.linalg.lstsq(damped, gradient[3:], rcond=1e-14)[0]
    return step


def _moved(cameras: Sequence[Camera], step: Floats, freedom: Freedom) -> tuple[Camera, ...] | None:
    """The cameras after a step; None if a lens would leave what is possible."""
    moved = []
    for n, camera in enumerate(cameras):
        change = np.zeros(3)
        change[: 1 + freedom.terms] = step[freedom.columns(n)]
        k1, k2 = camera.k1 + change[1], camera.k2 + change[2]
        if abs(change[0]) > LENS_STEP_LIMIT or abs(k1) > MAX_K1 or abs(k2) > MAX_K2:
            return None
        turn = rotation.nearest(rotation.exp(step[3 * n : 3 * n + 3]) @ camera.cam_from_world)
        focal = camera.focal * (1 + change[0])
        moved.append(replace(camera, focal=focal, cam_from_world=turn, k1=float(k1), k2=float(k2)))
    return tuple(moved)
