"""Gains and fall-off together, by robust least squares on the logarithms of light in the overlaps.

Brown & Lowe 2007, section 6, in logarithms, where gains and fall-off are linear; Goldman & Chen 2005 solve for both.
Iteratively reweighted with Cauchy's weights, since things move. All logarithms here are of encoded values.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.linalg import SuperLU, splu

from panostitch.compositing.overlaps import Overlaps
from panostitch.model.light import TERMS

Floats = NDArray[np.float64]
Links = tuple[NDArray[np.intp], NDArray[np.intp], Floats]  # photos (p,) and (p,), and the weight (p,) of each pair

RATIO_SPREAD = 0.03  # of the log ratio of two photos in their overlap: how far it is trusted
GAIN_SPREAD = 0.3  # of the log gains: wide enough for real steps; a slow drift of the light over many photos stays
# Between the smallest and the largest log gain: four stops of linear light. A camera that set itself for the shade and
# for the sun is not brought to one exposure, under which one of them would be black or white.
MOST = 1.25
COLOUR_SPREAD = 0.1  # of the log gains of a channel beside the mean of the three
FALL_OFF_SPREAD = 0.5  # of the coefficients of the fall-off
DARKEST = 2 * np.log(2) / 2.2  # at most this much is taken for fall-off: two stops in the corners
STEPS = 12
CAUCHY = 2.385  # standard deviations: 95 % of the efficiency of least squares on normal errors
MAD = 1.4826  # from the median of absolute normal errors to their standard deviation
LEAST_SCALE = 1e-5  # of the errors: those of exact data are rounding


@dataclass(frozen=True)
class Fit:
    """logs: (n, 3) log gain of each channel; fall_off: (lenses, 3) coefficients, encoded; weights: (m,) robust."""

    logs: Floats
    fall_off: Floats
    weights: Floats

    @property
    def mean_logs(self) -> Floats:
        """Log gains (n,) without colour."""
        return np.asarray(self.logs.mean(1))


def fit(overlaps: Overlaps, lenses: Sequence[int], *, fall_off: bool) -> Fit:
    """Gains of photos whose lenses have these numbers, and the fall-off of the lenses where it is asked for."""
    falls = differences(overlaps, lenses) if fall_off else np.zeros((len(overlaps), 0))
    errors = without_offsets(overlaps, overlaps.logs)
    fitted = Fit(np.zeros((len(lenses), 3)), np.zeros((0, TERMS)), np.ones(len(overlaps)))
    for _ in range(STEPS):
        weights = _robust(errors)
        before, fitted = fitted, _solve(overlaps, len(lenses), falls, weights)
        # less the offsets: what the wish for gains near 1 leaves of a step is no reason to trust the pair less
        errors = without_offsets(overlaps, overlaps.logs + (falls @ fitted.fall_off.ravel())[:, None])
        if np.abs(fitted.logs - before.logs).max(initial=0.0) < LEAST_SCALE:
            break
    fitted = _tempered(fitted)
    return fitted if fall_off else Fit(fitted.logs, np.zeros((max(lenses) + 1, TERMS)), fitted.weights)


def residuals(overlaps: Overlaps, logs: Floats) -> Floats:
    """Log ratios (m, 3) that are left after log gains (n, 3), fall-off apart."""
    return np.asarray(overlaps.logs + logs[overlaps.i] - logs[overlaps.j])


def differences(overlaps: Overlaps, lenses: Sequence[int]) -> Floats:
    """What each coefficient of each lens (m, lenses * 3) adds to the log ratio once its fall-off is undone."""
    number, rows = np.asarray(lenses), np.arange(len(overlaps))
    found = np.zeros((len(overlaps), max(lenses) + 1, TERMS))
    for photo, square, sign in ((overlaps.i, overlaps.square_i, 1), (overlaps.j, overlaps.square_j, -1)):
        found[rows, number[photo]] += sign * square[:, None] ** np.arange(1, TERMS + 1)
    return found.reshape(len(overlaps), -1)


def without_offsets(overlaps: Overlaps, errors: Floats) -> Floats:
    """Errors (m, ...) less the median of each pair: what no gain explains."""
    centred = errors.copy()
    for cells in overlaps.pairs:
        centred[cells] -= np.median(centred[cells], axis=0)
    return centred


def _robust(errors: Floats) -> Floats:
    """Cauchy's weights (m,) of errors (m, 3)."""
    size = np.sqrt((errors**2).mean(1))
    scale = max(LEAST_SCALE, MAD * float(np.median(size))) if len(size) else 1.0
    return np.asarray(1 / (1 + (size / (CAUCHY * scale)) ** 2))


def _solve(overlaps: Overlaps, count: int, falls: Floats, weights: Floats) -> Fit:
    """Least squares with these weights: the gains eliminated, then the coefficients, none of them below 0."""
    weight = weights * overlaps.share / RATIO_SPREAD**2
    links = _links(overlaps, weight)
    coefficients = np.zeros(falls.shape[1])
    if falls.shape[1]:
        solver = _factored(links, count, GAIN_SPREAD)
        mean, weighted = overlaps.logs.mean(1), falls * weight[:, None]
        cross = _into_photos(overlaps, count, weighted)
        square = falls.T @ weighted - cross.T @ solver.solve(cross) + np.eye(falls.shape[1]) / FALL_OFF_SPREAD**2
        steps = _into_photos(overlaps, count, (mean * weight)[:, None])[:, 0]
        pull = cross.T @ solver.solve(steps) - weighted.T @ mean
        coefficients = _plausible(square, pull)
    right = _into_photos(overlaps, count, (overlaps.logs + (falls @ coefficients)[:, None]) * weight[:, None])
    logs = _gains(links, right)
    return Fit(logs, coefficients.reshape(-1, TERMS), weights)


def _gains(links: Links, right: Floats) -> Floats:
    """Log gains (n, 3) from the links of the photos and the weighted log ratios (n, 3) summed into them."""
    mean = right.mean(1)
    # the sign: a photo that is brighter than its neighbours gets a gain below one
    brightness = -_factored(links, len(right), GAIN_SPREAD).solve(mean)
    colour = -_factored(links, len(right), COLOUR_SPREAD).solve(right - mean[:, None])
    return np.asarray(brightness[:, None] + colour)


def _factored(links: Links, count: int, spread: float) -> SuperLU:
    """The factors of the normal matrix (n, n) of the differences of unknowns, with the wish that they be 0, to within a
    spread; it is sparse, since few photos touch."""
    i, j, weight = links
    each, wish = np.arange(count), np.full(count, 1 / spread**2)
    rows, columns = np.concatenate([i, j, i, j, each]), np.concatenate([j, i, i, j, each])
    values = np.concatenate([-weight, -weight, weight, weight, wish])
    return splu(coo_array((values, (rows, columns)), shape=(count, count)).tocsc())


def _tempered(fitted: Fit) -> Fit:
    """The fit with gains that leave the same share of every step, so much that none are farther apart than `MOST`."""
    mean = fitted.mean_logs[:, None]
    kept = min(1.0, MOST / max(float(np.ptp(mean)), 1e-12))
    return Fit(fitted.logs - mean * (1 - kept), fitted.fall_off, fitted.weights)


def _links(overlaps: Overlaps, weight: Floats) -> Links:
    """The pairs, and what the weights (m,) of their cells come to."""
    starts = overlaps.starts
    return overlaps.i[starts], overlaps.j[starts], np.add.reduceat(weight, starts)


def _into_photos(overlaps: Overlaps, count: int, values: Floats) -> Floats:
    """Sums (n, k) of values (m, k) over the cells of each photo: for it as i, against it as j."""
    sums = [np.bincount(overlaps.i, v, count) - np.bincount(overlaps.j, v, count) for v in values.T]
    return np.column_stack(sums)


def _plausible(square: Floats, pull: Floats) -> Floats:
    """The coefficients that minimise x' S x / 2 - x' p of light that only falls towards the corners.

    Of each lens they sum to `DARKEST` at most.
    """
    found = not_negative(square, pull).reshape(-1, TERMS)
    return np.asarray((found * np.minimum(1, DARKEST / np.maximum(found.sum(1, keepdims=True), 1e-9))).ravel())


def not_negative(square: Floats, pull: Floats) -> Floats:
    """The x >= 0 (n,) that minimises x' S x / 2 - x' p for a positive definite S (n, n), exactly (Murty 1974).

    Some unknowns are free, the others 0; the first one that is on the wrong side changes sides, until none is. SciPy's
    `nnls` finds the same, but `scipy.optimize` takes longer to load than the light of a panorama to find.
    """
    free, rounding = np.ones(len(pull), bool), 1e-12 * np.abs(pull).max(initial=0.0)
    while True:
        found = np.zeros(len(pull))
        found[free] = np.linalg.solve(square[np.ix_(free, free)], pull[free])
        wrong = np.flatnonzero(np.where(free, found < 0, pull - square @ found > rounding))
        if not len(wrong):
            return found
        free[wrong[0]] ^= True
