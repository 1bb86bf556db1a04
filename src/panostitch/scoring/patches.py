"""Where a small patch of one picture lies in another, near where it should be, whatever the light.

Normalised correlation at every shift (Lewis 1995), a parabola through its peak. Between two peaks that are as good as
equal the nearer one is believed: of a fence nobody knows which post is which.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Grey = NDArray[np.float32]

SIDE = 25  # px of a patch; odd, so that it has a middle
HALF = SIDE // 2
SOFT = 1.0  # px, sigma of the filter before: noise goes, and what is left has a smooth peak
NOISE = 1.0  # grey levels, rms, of what is left of the noise of photos and of JPEG
INDEPENDENT = 4 * np.pi * SOFT**2  # px that share their noise after the filter
AS_GOOD = 0.03  # of correlation, in which two peaks are equal
APART = 2  # px between two peaks at least
ALIKE = 0.8  # correlation from which on a patch shows the same
SURE = 0.9  # correlation from which on its shift is believed
CLEAR = 0.1  # of correlation, by which the second best place is worse then
MOST_DEVIATION = 0.15  # px, standard error of a shift that is known
AROUND = np.ones((2 * APART + 1, 2 * APART + 1), np.uint8)
NOWHERE = -1.0  # correlation where the other picture shows nothing


@dataclass(frozen=True)
class Found:
    """Where n patches were found.

    shift:       (n, 2) px from where they should be
    alike:       (n,) correlation there; -1 where the other picture does not show the place
    deviation:   (n,) px, standard error of the shift; infinite where the patch has no texture, or slides along an edge
    other_shift: (n, 2) px of the second best place
    other_alike: (n,) correlation there; -1 where there is none
    """

    shift: Floats
    alike: Floats
    deviation: Floats
    other_shift: Floats
    other_alike: Floats

    @property
    def known(self) -> NDArray[np.bool_]:
        """Of which patches (n,) the shift is known."""
        clear = (self.alike >= SURE) & (self.other_alike <= self.alike - CLEAR)
        return np.asarray(clear & (self.deviation <= MOST_DEVIATION))


def softened(pixels: NDArray[np.float32]) -> Grey:
    """Grey (h, w) of pixels (h, w, 3) RGB without their noise."""
    return np.asarray(cv2.GaussianBlur(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY), (0, 0), SOFT), np.float32)


def find(
    picture: Grey,
    other: Grey,
    covered: NDArray[np.bool_],
    centres: NDArray[np.intp],
    reach: int,
    sought: NDArray[np.bool_] | None = None,
) -> Found:
    """Find patches of a picture around these centres (n, 2) px in another one, at most `reach` px away.

    picture, other: softened, of one size; patches lie at least HALF + reach px from their edges
    covered:        where the other one shows something
    sought:         (n,) which of the patches are needed; the others are said to be nowhere
    """
    sought = np.ones(len(centres), bool) if sought is None else sought
    usable = cv2.erode(covered.view(np.uint8), np.ones((SIDE, SIDE), np.uint8)) > 0
    found = [
        _find_one(picture, other, usable, x, y, reach) if needed else LOST
        for (x, y), needed in zip(centres.tolist(), sought, strict=True)
    ]
    shift, alike, other_shift, other_alike = (np.array(column, np.float64) for column in zip(*found, strict=True))
    strength, contrast = weakest_gradient(picture)[tuple(centres.T[::-1])], variance(picture)[tuple(centres.T[::-1])]
    unlike = np.maximum((1 - alike**2) * contrast, NOISE**2)
    with np.errstate(divide="ignore"):
        deviation = np.sqrt(unlike * INDEPENDENT / SIDE**2 / strength)
    inside = np.abs(shift).max(1) < reach
    return Found(shift, alike, np.where(inside, deviation, np.inf), other_shift, other_alike)


def variance(grey: Grey) -> Floats:
    """Variance (h, w) of the patch around each pixel."""
    wide = grey.astype(np.float64)
    mean = cv2.boxFilter(wide, -1, (SIDE, SIDE))
    return np.asarray(np.maximum(cv2.boxFilter(wide * wide, -1, (SIDE, SIDE)) - mean * mean, 0))


def weakest_gradient(grey: Grey) -> Floats:
    """Mean square (h, w) of the gradient in each patch along the direction in which it changes least, beyond noise."""
    across, down = (cv2.Scharr(grey, cv2.CV_64F, *which) / 32 for which in ((1, 0), (0, 1)))
    aa, bb, ab = (cv2.boxFilter(product, -1, (SIDE, SIDE)) for product in (across**2, down**2, across * down))
    least = (aa + bb) / 2 - np.hypot((aa - bb) / 2, ab)
    return np.asarray(np.maximum(least - NOISE**2 / 2 / SOFT**2, 0))


Peak = tuple[tuple[float, float], float, tuple[float, float], float]
LOST: Peak = ((0.0, 0.0), NOWHERE, (0.0, 0.0), NOWHERE)


def _find_one(picture: Grey, other: Grey, usable: NDArray[np.bool_], x: int, y: int, reach: int) -> Peak:
    """Shift and correlation of the best and of the second best place."""
    can = usable[y - reach : y + reach + 1, x - reach : x + reach + 1]
    if not can[reach, reach]:
        return LOST
    far = HALF + reach
    alike = cv2.matchTemplate(
        other[y - far : y + far + 1, x - far : x + far + 1],
        picture[y - HALF : y + HALF + 1, x - HALF : x + HALF + 1],
        cv2.TM_CCOEFF_NORMED,
    )
    alike = np.where(can & np.isfinite(alike), alike, NOWHERE)
    rows, columns = np.nonzero((alike == cv2.dilate(alike, AROUND)) & (alike > NOWHERE))
    heights = alike[rows, columns]
    good = np.flatnonzero(heights >= heights.max() - AS_GOOD)
    first = good[np.argmin(np.hypot(rows[good] - reach, columns[good] - reach))]
    heights[first], top = NOWHERE, heights[first]
    second = int(heights.argmax())
    (shift, height), (other_shift, _) = (_peak(alike, rows[n], columns[n], reach) for n in (first, second))
    return shift, max(height, float(top)), other_shift, float(heights[second])


def _peak(alike: NDArray[Any], row: int, column: int, reach: int) -> tuple[tuple[float, float], float]:
    """The top of the parabolas across and down through a peak, and its height."""
    height = float(alike[row, column])
    if not (0 < row < 2 * reach and 0 < column < 2 * reach):
        return (float(column - reach), float(row - reach)), height
    at, rise = [], 0.0
    for before, behind in (
        (alike[row, column - 1], alike[row, column + 1]),
        (alike[row - 1, column], alike[row + 1, column]),
    ):
        bend = float(before + behind) - 2 * height
        step = 0.0 if bend > -1e-9 or min(before, behind) <= NOWHERE else float(before - behind) / 2 / bend
        at.append(min(max(step, -0.5), 0.5))
        rise += -bend * step**2 / 2 if abs(step) <= 0.5 else 0.0
    return (column - reach + at[0], row - reach + at[1]), min(1.0, height + rise)
