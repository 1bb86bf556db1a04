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

from panostitch.alignment.residuals import Matches, Observation, in_a_row, linearise, reprojection
from panostitch.geometry import rotation
from panostitch.model.camera import Camera

Floats = NDArray[np.float64]

START_DAMPING = 1e-3
MAX_DAMPING = 1e8
LENS_STEP_LIMIT = 0.3  # relative change of the focal length in one step


@dataclass(frozen=True)
class Solution:
    """Adjusted cameras, the robust cost they reach, and how many parameters and steps it took."""

    cameras: tuple[Camera, ...]
    cost: float
    parameters: int
    steps: int


def adjust(
    cameras: Sequence[Camera],
    observations: Sequence[Observation],
    lenses: Sequence[int],
    *,
    free_lens: int,
    loss_scale: float,
    max_steps: int = 50,
    tolerance: float = 1e-6,
) -> Solution:
    """Minimise the robust reprojection error over rotations and lenses.

    lenses:     number of the lens of each camera
    free_lens:  0 to 3 of (focal, k1, k2) are adjusted, in this order
    loss_scale: px beyond which a residual counts less and less (Cauchy)
    max_steps, tolerance: it ends after so many steps, or when one lowers the cost by a smaller share than this
    """
    matches = in_a_row([direction for o in observations for direction in (o, o.swapped())])
    current = tuple(cameras)
    cost = _cost(current, matches, loss_scale)
    damping, step = START_DAMPING, 0
    while step < max_steps and damping < MAX_DAMPING:
        step += 1
        normal, gradient = _normal_equations(current, matches, lenses, free_lens, loss_scale)
        accepted = False
        while not accepted and damping < MAX_DAMPING:
            candidate = _moved(current, _solve(normal, gradient, damping), lenses, free_lens)
            candidate_cost = _cost(candidate, matches, loss_scale) if candidate else np.inf
            accepted = candidate_cost <= cost
            damping = max(damping / 10, 1e-12) if accepted else damping * 10
        if not accepted or candidate is None:
            break
        gain, current, cost = cost - candidate_cost, candidate, candidate_cost
        if gain <= tolerance * max(cost, 1e-300):
            break
    return Solution(current, cost, 3 * (len(cameras) - 1) + free_lens * (max(lenses) + 1), step)


def distances(cameras: Sequence[Camera], observation: Observation) -> Floats:
    """Distance (n,) px of each match in photo j."""
    return np.asarray(np.linalg.norm(reprojection(cameras, in_a_row([observation])), axis=1))


def _cost(cameras: Sequence[Camera], matches: Matches, scale: float) -> float:
    """Cauchy loss, in px^2: half the sum of squares where residuals are small."""
    square = (reprojection(cameras, matches) ** 2).sum(1)
    return float(0.5 * scale**2 * np.log1p(square / scale**2).sum())


def _normal_equations(
    cameras: Sequence[Camera], matches: Matches, lenses: Sequence[int], free_lens: int, scale: float
) -> tuple[Floats, Floats]:
    """Weighted J^T J and J^T r, over all rotations and then all lenses."""
    count = 3 * len(cameras)
    total = count + free_lens * (max(lenses) + 1)
    normal, gradient = np.zeros((total, total)), np.zeros(total)
    residuals = linearise(cameras, matches)
    kept = [*range(6), *range(6, 6 + free_lens), *range(9, 9 + free_lens)]
    weight = np.sqrt(1 / (1 + (residuals.value**2).sum(1) / scale**2))
    rows = residuals.jacobian[:, :, kept] * weight[:, None, None]
    values = residuals.value * weight[:, None]
    for begin, end in pairwise(matches.bounds):
        i, j = int(matches.i[begin]), int(matches.j[begin])
        columns = [
            *range(3 * i, 3 * i + 3),
            *range(3 * j, 3 * j + 3),
            *(count + free_lens * lenses[n] + k for n in (i, j) for k in range(free_lens)),
        ]
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


def _moved(cameras: Sequence[Camera], step: Floats, lenses: Sequence[int], free_lens: int) -> tuple[Camera, ...] | None:
    """The cameras after a step; None if a lens would leave what is possible."""
    moved = []
    for n, camera in enumerate(cameras):
        lens = np.zeros(3)
        start = 3 * len(cameras) + free_lens * lenses[n]
        lens[:free_lens] = step[start : start + free_lens]
        if abs(lens[0]) > LENS_STEP_LIMIT or abs(camera.k1 + lens[1]) > 2 or abs(camera.k2 + lens[2]) > 4:
            return None
        turn = rotation.nearest(rotation.exp(step[3 * n : 3 * n + 3]) @ camera.cam_from_world)
        moved.append(
            replace(
                camera,
                focal=camera.focal * (1 + lens[0]),
                cam_from_world=turn,
                k1=camera.k1 + lens[1],
                k2=camera.k2 + lens[2],
            )
        )
    return tuple(moved)
