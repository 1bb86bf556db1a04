"""Where a small patch of one picture lies in another, near where it should be, whatever the light.

Normalised correlation at every shift of whole px (Lewis 1995), then a step of least squares. Between two peaks that are
as good as equal the nearer one is believed: of a fence nobody knows which post is which.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
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
        _peaks(picture, other, usable, x, y, reach) if needed else LOST
        for (x, y), needed in zip(centres.tolist(), sought, strict=True)
    ]
    peak, other_peak, other_alike = (np.array(column, np.float64) for column in zip(*found, strict=True))
    seen = np.isfinite(peak[:, 0])
    peak = np.where(seen[:, None], peak, 0.0)
    step, alike, deviation = _refined(picture, other, centres, peak.astype(int))
    sound = (np.abs(step).max(1) <= 1) & (np.abs(peak).max(1) < reach)
    return Found(
        peak + np.where(sound[:, None], step, 0.0),
        np.where(seen, alike, NOWHERE),
        np.where(sound & seen, deviation, np.inf),
        other_peak,
        other_alike,
    )


def _refined(picture: Grey, other: Grey, centres: NDArray[np.intp], peak: NDArray[np.intp]) -> tuple[Floats, ...]:
    """From whole px to parts of one: a step of Gauss-Newton over gain, offset and shift (Lucas & Kanade 1981).

    Returns the step (n, 2) px, the correlation (n,) there, and the standard error (n,) px of the shift.
    """
    across, down = (np.asarray(cv2.Scharr(other, cv2.CV_32F, *which) / 32, np.float32) for which in ((1, 0), (0, 1)))
    own = _patches(picture, centres)
    theirs, right, below = (_patches(grey, centres + peak) for grey in (other, across, down))
    design = np.stack([theirs, right, below], axis=1).astype(np.float64)
    normal = design @ design.transpose(0, 2, 1)
    # noise has gradients too; without others there is nothing to go by, and the shift stays what it is
    grain = SIDE**2 * NOISE**2 / 2 / SOFT**2
    # none of these is weaker: an even patch of a drawing has no contrast at all
    ridge = np.diag([1e-6, grain, grain])
    product = (design @ own[..., None])[..., 0]
    weights = np.linalg.solve(normal + ridge, product[..., None])[..., 0]
    rest = own - (weights[:, None] @ design)[:, 0]
    gain = weights[:, 0]
    with np.errstate(all="ignore"):
        explained = np.where(gain > 0, 1 - (rest**2).mean(1) / np.maximum((own**2).mean(1), 1e-9), 0.0)
        step = np.where(gain[:, None] > 0, weights[:, 1:] / gain[:, None], 0.0)
    known = normal[:, 1:, 1:]
    middle, half = np.trace(known, axis1=1, axis2=2) / 2, (known[:, 0, 0] - known[:, 1, 1]) / 2
    least = middle - np.hypot(half, known[:, 0, 1]) - grain
    noise = np.maximum((rest**2).mean(1), NOISE**2) * INDEPENDENT
    deviation = np.sqrt(noise / np.maximum(least, 1e-9)) / np.maximum(gain, 1e-3)
    return step, np.sqrt(np.clip(explained, 0, 1)), deviation


def _patches(grey: Grey, centres: NDArray[np.intp]) -> Floats:
    """Patches (n, SIDE^2) around these centres (n, 2) px, each without its mean."""
    x, y = (centres - HALF).T
    cut = sliding_window_view(grey, (SIDE, SIDE))[y, x].reshape(len(centres), -1).astype(np.float64)
    return np.asarray(cut - cut.mean(1, keepdims=True))


def variance(grey: Grey) -> Floats:
    """Variance (h, w) of the patch around each pixel."""
    wide = grey.astype(np.float64)
    mean = cv2.boxFilter(wide, -1, (SIDE, SIDE))
    return np.asarray(np.maximum(cv2.boxFilter(wide * wide, -1, (SIDE, SIDE)) - mean * mean, 0))


Peaks = tuple[tuple[float, float], tuple[float, float], float]
LOST: Peaks = ((np.nan, np.nan), (0.0, 0.0), NOWHERE)


def _peaks(picture: Grey, other: Grey, usable: NDArray[np.bool_], x: int, y: int, reach: int) -> Peaks:
    """Shift px of the best place; shift and correlation of the second best one."""
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
    if not len(rows):
        return (0.0, 0.0), (0.0, 0.0), NOWHERE
    heights = alike[rows, columns]
    good = np.flatnonzero(heights >= heights.max() - AS_GOOD)
    first = good[np.argmin(np.hypot(rows[good] - reach, columns[good] - reach))]
    heights[first] = NOWHERE
    second = int(heights.argmax())
    one, two = ((float(columns[n] - reach), float(rows[n] - reach)) for n in (first, second))
    return one, two, float(heights[second])
