"""The detector of SURF: maxima of the determinant of a box-filter Hessian over place and scale (Bay et al. 2008)."""

import cv2
import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
Index = NDArray[np.intp]

_OCTAVES = ((9, 15, 21, 27), (15, 27, 39, 51), (27, 51, 75, 99), (51, 99, 147, 195))  # px; paper, fig. 4
_SIGMA_PER_FILTER_PX = 1.2 / 9.0  # the 9 px filter stands for a Gaussian of 1.2 px
_DXY_WEIGHT = 0.9  # paper, eq. 3: makes the box filters' Dxy as strong as the Gaussians'
RESPONSE = 3  # column of a peak's response
_MAX_STEP = 1.0  # samples; a fit that moves further has its peak elsewhere
_FLATTEST = 1e-9  # least Gaussian curvature of a peak over its height squared; ridges have none
_BAND_PIXELS = 32768  # pixels per band of the Hessian: its few temporaries stay in the second-level cache


def detect(grey: NDArray[np.uint8], threshold: float) -> F32:
    """All maxima of the Hessian above the threshold: rows of x, y, scale, response, sign of the trace."""
    found = [np.empty((0, RESPONSE + 2), np.float32)]
    if not grey.size:
        return found[0]
    # Sums beyond 2^31 wrap round, and so do the differences taken of them, which therefore stay right.
    integral = np.asarray(cv2.integral(np.ascontiguousarray(grey), sdepth=cv2.CV_32S), np.int32)
    finer: dict[int, F32] = {}
    for octave, sizes in enumerate(_OCTAVES):
        step = 2**octave
        layers = {n: finer[n][::2, ::2] if n in finer else _hessian(integral, n, step) for n in sizes}
        for below, size, above in (sizes[:3], sizes[1:]):
            triple = (layers[below], layers[size], layers[above])
            found.append(_layer_peaks(integral, triple, (size, above), step, threshold))
        finer = layers
    return np.concatenate(found)


def _hessian(integral: I32, size: int, step: int) -> F32:
    """Determinant at pixels 0, step, 2 step...; zero where the filter reaches beyond the picture."""
    height, width = integral.shape[0] - 1, integral.shape[1] - 1
    determinant = np.zeros((-(-height // step), -(-width // step)), np.float32)
    first = -(-(size // 2) // step)
    last_row, last_column = (height - 1 - size // 2) // step, (width - 1 - size // 2) // step
    columns = last_column - first + 1
    if columns < 1:
        return determinant
    band = max(1, _BAND_PIXELS // width)
    for top in range(first, last_row + 1, band):
        rows = min(band, last_row + 1 - top)
        part = _hessian_band(integral, size, step, (top, first), (rows, columns))
        determinant[top : top + rows, first : first + columns] = part
    return determinant


def _hessian_band(integral: I32, size: int, step: int, first: tuple[int, int], count: tuple[int, int]) -> F32:
    """Determinant of the filters on `count` rows and columns of samples, beginning with sample `first`.

    Sums over rows come first: they run over whole rows of the integral image, which is what is fast.
    """
    lobe = size // 3
    half, inner = size // 2, lobe // 2  # reach of the three lobes together and of the middle one

    def row(offset: int) -> I32:
        start = first[0] * step + offset
        return integral[start : start + (count[0] - 1) * step + 1 : step]

    def column(rows: I32, offset: int) -> I32:
        start = first[1] * step + offset
        return rows[:, start : start + (count[1] - 1) * step + 1 : step]

    strip = row(half + 1) - row(-half) - 3 * (row(inner + 1) - row(-inner))
    dyy = column(strip, lobe) - column(strip, 1 - lobe)
    strip = row(lobe) - row(1 - lobe)
    core = column(strip, inner + 1) - column(strip, -inner)
    dxx = column(strip, half + 1) - column(strip, -half) - 3 * core
    strip = row(lobe + 1) - row(1) - row(0) + row(-lobe)
    dxy = column(strip, lobe + 1) - column(strip, 1) - column(strip, 0) + column(strip, -lobe)

    # Divided by the area of a lobe the responses are scale-normalised derivatives.
    per_area = np.float32(1.0 / (lobe * (2 * lobe - 1)))
    determinant: F32 = (dxx.astype(np.float32) * per_area) * (dyy.astype(np.float32) * per_area)
    determinant -= np.square(dxy.astype(np.float32) * (np.float32(_DXY_WEIGHT) * per_area))
    return determinant


def _layer_peaks(
    integral: I32, triple: tuple[F32, F32, F32], sizes: tuple[int, int], step: int, threshold: float
) -> F32:
    """Maxima of the middle one of three layers among their 26 neighbours; rows as in `_detect`.

    `sizes` are the filter sizes of the middle and the upper layer; the lower one is as far below.
    """
    size, above = sizes
    margin = -(-(above // 2) // step) + 1  # all 27 samples must be whole
    inside = triple[1][margin:-margin, margin:-margin]
    if not inside.size:
        return np.empty((0, RESPONSE + 2), np.float32)
    highest = cv2.dilate(np.maximum(np.maximum(triple[0], triple[2]), triple[1]), np.ones((3, 3), np.uint8))
    is_peak = (inside >= highest[margin:-margin, margin:-margin]) & (inside > threshold)
    row, column = np.divmod(np.flatnonzero(is_peak), inside.shape[1])
    y, x = row + margin, column + margin
    around = [layer[y + dy, x + dx] for layer in triple for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
    cube = np.stack(around, axis=1)
    # Of equal neighbours only the first in scan order is a maximum.
    single = cube[:, 13] > cube[:, :13].max(axis=1, initial=-np.inf)
    y, x, cube = y[single], x[single], cube[single]
    shift, near = _fit_peak(cube.reshape(-1, 3, 3, 3).astype(np.float64))
    y, x, shift, response = y[near], x[near], shift[near], cube[near, 13]
    scale = (size + shift[:, 2] * (above - size)) * _SIGMA_PER_FILTER_PX
    trace = _laplacian_sign(integral, y * step, x * step, size // 3)
    columns = [(x + shift[:, 0]) * step, (y + shift[:, 1]) * step, scale, response, trace]
    return np.stack(columns, axis=1).astype(np.float32)


def _fit_peak(cube: F64) -> tuple[F64, NDArray[np.bool_]]:
    """Offsets (x, y, layer) in samples of the peaks in cubes (n, layer, y, x), and whether each is near.

    First the scale, then the place in the layer interpolated there. One quadric through all 27 samples would
    move blobs between two pixels by 0.1 px: the layers are far apart, and its mixed terms misread them.
    """
    below, middle, above = np.moveaxis(cube, 0, -1)[:, 1, 1]
    layer = (above - below) / (2 * (2 * middle - above - below))
    weights = np.stack([layer * (layer - 1) / 2, 1 - layer**2, layer * (layer + 1) / 2])
    plane = np.einsum("ln,nlyx->yxn", weights, cube)

    gx, gy = (plane[1, 2] - plane[1, 0]) / 2, (plane[2, 1] - plane[0, 1]) / 2
    xx = plane[1, 2] - 2 * plane[1, 1] + plane[1, 0]
    yy = plane[2, 1] - 2 * plane[1, 1] + plane[0, 1]
    xy = (plane[2, 2] - plane[2, 0] - plane[0, 2] + plane[0, 0]) / 4
    curvature = xx * yy - xy**2
    round_top = curvature > _FLATTEST * plane[1, 1] ** 2
    curvature[~round_top] = np.inf
    shift = np.stack([(xy * gy - yy * gx) / curvature, (xy * gx - xx * gy) / curvature, layer], axis=1)
    return shift, round_top & (np.abs(shift) <= _MAX_STEP).all(axis=1)


def _laplacian_sign(integral: I32, y: Index, x: Index, lobe: int) -> NDArray[np.int8]:
    """Sign of Dxx, which at a maximum of the determinant is that of Dyy and so of the trace."""

    def box(reach: int) -> I32:
        top, bottom, left, right = y - lobe + 1, y + lobe, x - reach, x + reach + 1
        return integral[bottom, right] - integral[bottom, left] - integral[top, right] + integral[top, left]

    dxx = box(lobe + lobe // 2) - 3 * box(lobe // 2)
    return np.where(dxx > 0, 1, -1).astype(np.int8)
