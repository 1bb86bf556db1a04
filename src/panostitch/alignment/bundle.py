"""Bundle adjustment of turning cameras: rotations, focal lengths, distortion and principal points together.

There are no 3D points: a match is the agreement of two rays, and only photos that share matches share a block of the
normal equations. Brown & Lowe 2007, section 4; Triggs et al. 1999.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import SuperLU

from panostitch.alignment import loss
from panostitch.alignment.levenberg import minimise
from panostitch.alignment.residuals import arrays_of, cameras_of
from panostitch.alignment.turning_problem import turning_problem
from panostitch.alignment.unknowns import Freedom, Unknowns
from panostitch.geometry import rotation
from panostitch.model.alignment import Uncertainty
from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints

__all__ = ["Freedom", "Solution", "adjust", "standard_errors"]

Floats = NDArray[np.float64]

COLUMNS_AT_ONCE = 4  # of the inverse, when standard errors are computed: with more, SuperLU leaves the cache


@dataclass(frozen=True)
class Solution:
    """Adjusted cameras and the robust cost (px^2) they reach."""

    cameras: tuple[Camera, ...]
    cost: float


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
    problem = turning_problem(cameras, observations, freedom, loss_scale)
    found, cost = minimise(arrays_of(cameras), problem, max_steps=max_steps, tolerance=tolerance)
    # many steps have taken the turns from being exactly orthonormal
    turns = rotation.nearest(found.turns.transpose(2, 0, 1)).transpose(1, 2, 0)
    return Solution(cameras_of(replace(found, turns=turns), cameras), cost)


def standard_errors(
    cameras: Sequence[Camera], observations: Sequence[ControlPoints], freedom: Freedom, *, loss_scale: float
) -> tuple[Uncertainty, ...]:
    """How uncertain adjusted cameras are, from the inverse of the normal equations and the spread of the residuals.

    `turn` is the root mean square of the angle by which a camera is off, in a world whose axes are the mean of all
    cameras'; no photo is exact because it happens to be the first. Both are infinite where there are no more residuals
    than unknowns. They know of the noise of the matches, not of a scene that is not what it is taken for.
    """
    problem = turning_problem(cameras, observations, freedom, loss_scale)
    view = problem.view(arrays_of(cameras))
    tangent = problem.tangent(view)
    variance = loss.variance(problem.squares(view, tangent), loss_scale, problem.places.size)
    solver = problem.equations(view, tangent).factorised()
    inverse = _diagonal_of_inverse(solver, problem.places.size)
    turns = np.sqrt(variance * _turn_variances(solver, inverse, problem.places))
    focals = np.sqrt(variance * inverse[problem.places.lens[:, 0]])
    return tuple(
        Uncertainty(float(turn), float(focal) * camera.focal)
        for camera, turn, focal in zip(cameras, turns, focals, strict=True)
    )


def _diagonal_of_inverse(solver: SuperLU, size: int) -> Floats:
    """Diagonal (size,) of the inverse; some columns of it at a time."""
    diagonal = np.empty(size)
    for begin in range(0, size, COLUMNS_AT_ONCE):
        index = np.arange(begin, min(begin + COLUMNS_AT_ONCE, size))
        columns = np.zeros((size, len(index)))
        columns[index, index - begin] = 1.0
        diagonal[index] = solver.solve(columns)[index, index - begin]
    return diagonal


def _turn_variances(solver: SuperLU, inverse: Floats, places: Unknowns) -> Floats:
    """Variances (n,) of the cameras' rotations about the mean of all, summed over the three axes.

    With C the inverse, in which the first camera does not turn, and m the mean of all: C_kk - 2 C_km + C_mm.
    """
    turns = places.turns[1:]  # the first camera is FIXED
    mean = np.zeros((places.size, 3))
    mean[turns, np.arange(3)] = 1 / len(places.turns)
    with_mean = np.zeros((len(places.turns), 3))
    with_mean[1:] = solver.solve(mean)[turns, np.arange(3)]
    own = np.zeros((len(places.turns), 3))
    own[1:] = inverse[turns]
    # rounding may leave nothing of a difference of equals
    return np.asarray(np.maximum(own - 2 * with_mean + with_mean.mean(0), 0.0).sum(1))
