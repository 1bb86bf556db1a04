"""Equal brightness where photos overlap: one gain for each photo, in linear light.

Brown & Lowe 2007, section 6, with logarithms of robust ratios in place of differences of means. A camera's tone curve
is taken for a power law, under which a gain in linear light is a gain on the encoded values as well.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from panostitch.model.canvas import Layer

Floats = NDArray[np.float64]

WHITE = np.float32(255)
DARK, BRIGHT = 8.0, 247.0  # grey levels outside of which a pixel says nothing of the exposure
MIN_SAMPLES = 30  # px of the reduced canvas
RATIO_SPREAD = 0.05  # of the log ratio of two photos in their overlap: how far it is trusted
GAIN_SPREAD = 0.15  # of the log gains: wide enough for real steps; a slow drift of the light over many photos stays

Pieces = Sequence[tuple[int, Layer]]


def gains(count: int, pieces: Pieces) -> Floats:
    """Factors (n,) on the encoded pixels of `count` photos, of geometric mean 1; pieces are (photo, layer)."""
    normal, right = np.eye(count) / GAIN_SPREAD**2, np.zeros(count)
    for a, (i, first) in enumerate(pieces):
        for j, second in pieces[a + 1 :]:
            found = None if i == j else _log_ratio(first, second)
            if found is None:
                continue
            ratio, share = found
            weight = share / RATIO_SPREAD**2
            normal[[i, j], [i, j]] += weight
            normal[[i, j], [j, i]] -= weight
            right[[i, j]] += np.array([-ratio, ratio]) * weight
    logs = np.linalg.solve(normal, right)
    return np.asarray(np.exp(logs - logs.mean()), np.float64)


def expose(pixels: NDArray[np.float32], gain: float) -> NDArray[np.float32]:
    """Pixels (h, w, 3) in 0..255 times a gain; what would be brighter than white keeps its hue."""
    exposed = pixels * np.float32(gain)
    if gain > 1:
        # three maxima of planes: NumPy is slow along an axis of three
        brightest = np.maximum(np.maximum(exposed[..., 0], exposed[..., 1]), exposed[..., 2])
        if brightest.max(initial=0) > WHITE:
            exposed *= (WHITE / np.maximum(brightest, WHITE))[..., None]
    return exposed


def unit_gains(count: int, pieces: Pieces) -> Floats:
    """No compensation."""
    del pieces
    return np.ones(count)


EXPOSURE: dict[str, Callable[[int, Pieces], Floats]] = {"gain": gains, "none": unit_gains}


def _log_ratio(first: Layer, second: Layer) -> tuple[float, float] | None:
    """Median of log(first / second) over the overlap, and the overlap's share of the smaller layer."""
    common = first.region & second.region
    if not common:
        return None
    a, b = (layer.pixels[common.within(layer.region)].mean(2) for layer in (first, second))
    both = first.mask[common.within(first.region)] & second.mask[common.within(second.region)]
    both &= (np.minimum(a, b) > DARK) & (np.maximum(a, b) < BRIGHT)
    samples = int(both.sum())
    if samples < MIN_SAMPLES:
        return None
    share = samples / min(int(first.mask.sum()), int(second.mask.sum()))
    return float(np.median(np.log(a[both] / b[both]))), share
