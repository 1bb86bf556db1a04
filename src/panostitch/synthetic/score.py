"""How far estimated cameras are from the true ones, in pixels and free of the global rotation.

A grid of points of photo i is sent to photo j by the true cameras and by the estimated ones; the distance in j is the
error. A turn (or, for a flat subject, any homography) of the whole world changes nothing about it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

GRID = (24, 18)


class View(Protocol):
    """What is asked of a camera to be judged; other programs have other lenses than ours."""

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) px."""

    def project(self, rays: Floats) -> Floats:
        """Rays of the world (n, 3) to pixels (n, 2); NaN where they are not in the picture."""

    def rays(self, xy: Floats) -> Floats:
        """Pixels (n, 2) to rays of the world (n, 3)."""


@dataclass(frozen=True)
class Score:
    """Errors over all pairs of photos that truly overlap.

    rms, p95, worst: px, over all points of all pairs, both ways; infinite where no pair could be judged, or where an
                     estimated camera does not see a point at all
    pairs:           number of pairs (i < j) that were judged
    missing:         indices of the photos without an estimated camera; their pairs are not in the numbers
    """

    rms: float
    p95: float
    worst: float
    pairs: int
    missing: tuple[int, ...]


def pair_errors(true: tuple[View, View], estimated: tuple[View, View], *, grid: tuple[int, int] = GRID) -> Floats:
    """Distances (n,) px in the second photo, for the grid points of the first that truly lie inside the second."""
    for known, guess in zip(true, estimated, strict=True):
        if known.size != guess.size:
            raise ValueError(f"cameras of different photos: {known.size} and {guess.size} px")
    sides = [_cell_centres(length, cells) for length, cells in zip(true[0].size, grid, strict=True)]
    points = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)
    truth = true[1].project(true[0].rays(points))
    # NaN compares as outside
    inside = ((truth >= -0.5) & (truth <= np.array(true[1].size) - 0.5)).all(1)
    found = estimated[1].project(estimated[0].rays(points[inside]))
    errors = np.hypot(*(found - truth[inside]).T)
    return np.where(np.isfinite(errors), errors, np.inf)


def score(true: Sequence[View], estimated: Sequence[View | None], *, grid: tuple[int, int] = GRID) -> Score:
    """Compare the estimated cameras (None for a photo that was left out) with the true ones, in the same order."""
    if len(true) != len(estimated):
        raise ValueError(f"{len(true)} true cameras but {len(estimated)} estimated ones")
    judged: set[tuple[int, int]] = set()
    errors = []
    for i, j, distances in _overlaps(true, estimated, grid):
        judged.add((min(i, j), max(i, j)))
        errors.append(distances)
    missing = tuple(i for i, camera in enumerate(estimated) if camera is None)
    if not errors:
        return Score(np.inf, np.inf, np.inf, 0, missing)
    every = np.concatenate(errors)
    p95 = float(np.quantile(every, 0.95, method="higher"))
    return Score(float(np.sqrt((every**2).mean())), p95, float(every.max()), len(judged), missing)


def _overlaps(
    true: Sequence[View], estimated: Sequence[View | None], grid: tuple[int, int]
) -> Iterator[tuple[int, int, Floats]]:
    """Ordered pairs with an error for each of their common points."""
    for i, j in permutations(range(len(true)), 2):
        a, b = estimated[i], estimated[j]
        if a is None or b is None:
            continue
        distances = pair_errors((true[i], true[j]), (a, b), grid=grid)
        if len(distances):
            yield i, j, distances


def _cell_centres(length: int, cells: int) -> Floats:
    """Centres (cells,) px of equal cells over a side of a photo."""
    return np.asarray((np.arange(cells) + 0.5) * length / cells - 0.5)
