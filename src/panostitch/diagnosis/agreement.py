"""Do matches agree more than chance lets them? Finer than the test of a link, which asks for enough to align by.

A contrario (Desolneux, Moisan & Morel 2000; Moisan & Stival 2004): an agreement counts if so many random matches would
hardly ever agree as well. The model is a similarity: it takes two matches, and in a narrow overlap it is exact enough.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.geometry import homography

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

TOLERANCES = (0.005, 0.01, 0.02, 0.04)  # of the photo's longer side: perspective is no similarity
MOST_MATCHES = 120  # whose pairs are tried, evenly spread over the list
MAX_ZOOM = 3.0
MOST_MOTIONS = 8
FEWEST_EPIPOLAR = 16  # matches; seven of them fit any camera
SAME_PLACE = 0.005  # of the longer side: matches nearer to each other count once
NO_CHANCE = -4.0  # log10 of how many agreements as good random matches would show: below, it is none of them


@dataclass(frozen=True)
class Agreement:
    """What some matches agree on.

    j_from_i: (3, 3) similarity in px
    agree:    (n,) which of the matches do
    chance:   log10 of the number of agreements as good that as many random matches would be expected to show
    """

    j_from_i: Floats
    agree: Booleans
    chance: float

    @property
    def count(self) -> int:
        """How many matches agree."""
        return int(self.agree.sum())

    def __bool__(self) -> bool:
        return self.chance < NO_CHANCE


def find_agreement(xy_i: Floats, xy_j: Floats, size_j: tuple[int, int], *, within: float = 1.0) -> Agreement:
    """The agreement of matches (n, 2) px that chance explains least; falsy where chance may explain it.

    within: share of photo j among whose key points the matches were sought
    """
    from scipy.stats import binom  # long to load, and only failures need it

    best = Agreement(np.eye(3), np.zeros(len(xy_i), np.bool_), 0.0)
    distinct = _distinct(xy_i, xy_j, SAME_PLACE * max(size_j))
    n = len(distinct)
    a, b = (xy[:, 0] + 1j * xy[:, 1] for xy in (xy_i, xy_j))
    zoom, shift = _similarities(a[distinct], b[distinct])
    if not len(zoom):
        return best
    off = np.abs(zoom[:, None] * a[distinct] + shift[:, None] - b[distinct])
    tests = np.log(len(zoom) * len(TOLERANCES))
    for tolerance in (share * max(size_j) for share in TOLERANCES):
        count = (off <= tolerance).sum(1)
        k = int(count.argmax())
        by_chance = min(np.pi * tolerance**2 / (within * size_j[0] * size_j[1]), 1.0)
        # two of them agree by construction
        chance = float((tests + binom.logsf(count[k] - 3, n - 2, by_chance)) / np.log(10))
        if chance < best.chance:
            best = Agreement(_matrix(zoom[k], shift[k]), np.abs(zoom[k] * a + shift[k] - b) <= tolerance, chance)
    return best


def motions(xy_i: Floats, xy_j: Floats, size_j: tuple[int, int]) -> list[int]:
    """Sizes of the agreements among matches (n, 2) px, one after the other, each among those that are left."""
    sizes: list[int] = []
    while len(sizes) < MOST_MOTIONS:
        found = find_agreement(xy_i, xy_j, size_j)
        if not found:
            break
        sizes.append(found.count)
        xy_i, xy_j = xy_i[~found.agree], xy_j[~found.agree]
    return sizes


def epipolar(xy_i: Floats, xy_j: Floats, *, tolerance: float, seed: int) -> int:
    """How many matches (n, 2) px one moving camera explains, whatever their depth; 0 where nobody can tell."""
    if len(xy_i) < FEWEST_EPIPOLAR:
        return 0
    _, inliers = cv2.findFundamentalMat(xy_i, xy_j, homography.usac(tolerance, seed))
    return 0 if inliers is None else int(np.count_nonzero(inliers))


def _distinct(xy_i: Floats, xy_j: Floats, apart: float) -> NDArray[np.intp]:
    """Indices of matches of which no two lie at the same place in both photos."""
    cells = np.floor(np.hstack([xy_i, xy_j]) / max(apart, 1e-9))
    _, first = np.unique(cells, axis=0, return_index=True)
    return np.sort(first)


def _similarities(
    a: NDArray[np.complex128], b: NDArray[np.complex128]
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Factors and shifts (m,) of the similarities b = factor a + shift through two matches each."""
    chosen = np.unique(np.linspace(0, len(a) - 1, min(MOST_MATCHES, len(a))).astype(int))
    first, second = (chosen[k] for k in np.triu_indices(len(chosen), 1))
    base, image = a[second] - a[first], b[second] - b[first]
    with np.errstate(divide="ignore", invalid="ignore"):
        zoom = image / base
    sane = np.isfinite(zoom) & (np.abs(zoom) < MAX_ZOOM) & (np.abs(zoom) > 1 / MAX_ZOOM)
    zoom, first = zoom[sane], first[sane]
    return zoom, b[first] - zoom * a[first]


def _matrix(zoom: complex, shift: complex) -> Floats:
    return np.array([[zoom.real, -zoom.imag, shift.real], [zoom.imag, zoom.real, shift.imag], [0, 0, 1]])
