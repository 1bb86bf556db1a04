"""Levenberg-Marquardt, whatever is adjusted. Levenberg 1944; Marquardt 1963.

The precision of a residual depends on the parameters: a pixel of one photo may be three pixels of the other. It is
taken from the parameters before a step and held while the step is judged; were it part of what is minimised, residuals
could be made small by making photos small.
"""

from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from panostitch.alignment.normal_equations import Equations

Floats = NDArray[np.float64]
Parameters = TypeVar("Parameters")
View = TypeVar("View")
Tangent = TypeVar("Tangent")

START_DAMPING = 1e-3
MIN_DAMPING = 1e-12
MAX_DAMPING = 1e8
ROUNDING = 1e-15  # px^2, sum over all matches: nothing is left but rounding, and nothing to be learnt from it


class Problem(Protocol[Parameters, View, Tangent]):
    """What is to be minimised.

    A View is what was computed on the way to the residuals of some parameters; a Tangent is what both the precision of
    the residuals and their derivatives are made of.
    """

    def view(self, parameters: Parameters) -> View:
        """The residuals under the parameters."""
        ...

    def tangent(self, view: View) -> Tangent:
        """The first derivatives."""
        ...

    def cost(self, view: View, tangent: Tangent) -> float:
        """The robust cost, px^2, with the precision that residuals have at the tangent."""
        ...

    def equations(self, view: View, tangent: Tangent) -> Equations:
        """The normal equations of the cost, all at the same parameters."""
        ...

    def moved(self, parameters: Parameters, step: Floats) -> Parameters | None:
        """The parameters after a step; None if they would leave what is possible."""
        ...


def minimise(
    start: Parameters, problem: Problem[Parameters, View, Tangent], *, max_steps: int, tolerance: float
) -> tuple[Parameters, float]:
    """The parameters of least cost near `start`, and their cost.

    It ends after `max_steps`, or when one lowers the cost by a smaller share than `tolerance`.
    """
    parameters, view, damping = start, problem.view(start), START_DAMPING
    tangent = problem.tangent(view)
    cost = problem.cost(view, tangent)
    for _ in range(max_steps):
        if cost <= ROUNDING:
            break
        equations = problem.equations(view, tangent)
        accepted = None
        while accepted is None and damping < MAX_DAMPING:
            accepted = _tried(problem, parameters, equations.step(damping), tangent, cost)
            damping = damping * 10 if accepted is None else max(damping / 10, MIN_DAMPING)
        if accepted is None:
            break
        parameters, view, lowered = accepted
        gain, least = cost - lowered, lowered
        tangent = problem.tangent(view)
        cost = problem.cost(view, tangent)
        if gain <= tolerance * least:
            break
    return parameters, cost


def _tried(
    problem: Problem[Parameters, View, Tangent], parameters: Parameters, step: Floats, tangent: Tangent, cost: float
) -> tuple[Parameters, View, float] | None:
    """Parameters, residuals and cost after the step, if it lowers the cost."""
    candidate = problem.moved(parameters, step)
    if candidate is None:
        return None
    view = problem.view(candidate)
    lowered = problem.cost(view, tangent)
    return (candidate, view, lowered) if lowered <= cost else None
