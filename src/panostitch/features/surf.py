"""SURF, a fast detector and descriptor of blobs, written from the paper.

H. Bay, A. Ess, T. Tuytelaars, L. Van Gool: "Speeded-Up Robust Features (SURF)", Computer Vision and
Image Understanding 110 (2008) 346-359. Detection is the paper's: a box-filter Hessian on an integral
image. Orientation and descriptor use the paper's geometry, but take their Haar responses from scale-matched
blurred copies of the picture: unlike box sums at rounded points these can be turned and are not quantised.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.features.described import Described

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
Index = NDArray[np.intp]

HESSIAN_THRESHOLD = 100.0  # smallest determinant kept, (grey levels)^2 of 0..255; OpenCV's SURF default
_LONGEST_SIDE = 32766  # px; cv2.remap's limit
_SURPLUS = 2  # key points handed over for each one that will be kept
DESCRIPTOR_SIZE = 64  # 4 x 4 cells, four sums each

_OCTAVES = ((9, 15, 21, 27), (15, 27, 39, 51), (27, 51, 75, 99), (51, 99, 147, 195))  # px; paper, fig. 4
_SIGMA_PER_FILTER_PX = 1.2 / 9.0  # the 9 px filter stands for a Gaussian of 1.2 px
_DXY_WEIGHT = 0.9  # paper, eq. 3: makes the box filters' Dxy as strong as the Gaussians'
_RESPONSE = 3  # column of a peak's response
_MAX_STEP = 1.0  # samples; a fit that moves further has its peak elsewhere
_FLATTEST = 1e-9  # least Gaussian curvature of a peak over its height squared; ridges have none
_BAND_PIXELS = 32768  # pixels per band of the Hessian: its few temporaries stay in the second-level cache

_ORIENTATION_RADIUS = 6  # all radii and distances from here on are in units of the keypoint's scale s
_ORIENTATION_SIGMA = 2.5  # paper: 2; finds 1 % more matches
_ANGLE_BINS = 72  # 5 degrees each
_WINDOW_BINS = 12  # the sliding window of 60 degrees
_CELLS = 4
_SAMPLES_PER_CELL = 5
_DESCRIPTOR_SIGMA = 3.3
_BLUR_PER_SCALE = 1.0  # blur of the sampled copies over s; measured: 0.45 finds 5 % fewer matches, 1.6 2 %
_FINEST_SCALE = 1.6  # px; no smaller keypoint can be found (filter size 12 at the least)
_CHUNK = 512  # keypoints sampled at once


@dataclass(frozen=True)
class SurfFeatures:
    """n keypoints of one picture with their descriptors, strongest first.

    Attributes:
        xy: (n, 2) px; the centre of the top-left pixel is (0, 0), x to the right, y down.
        scale: (n,) px; standard deviation of the Gaussian that the filter stands for, 1.2 * filter size / 9.
        angle: (n,) radians in (-pi, pi]; direction of the dominant gradient, from x towards y.
        response: (n,) determinant of the Hessian, (grey levels)^2.
        laplacian: (n,) sign of the Hessian's trace: +1 dark blob on light ground, -1 light on dark.
        descriptors: (n, 64) signed square roots of the L1-normalised sums; Euclidean norm 1.
    """

    xy: F32
    scale: F32
    angle: F32
    response: F32
    laplacian: NDArray[np.int8]
    descriptors: F32


def detect_and_describe(
    grey: NDArray[np.uint8], *, max_features: int, threshold: float = HESSIAN_THRESHOLD
) -> SurfFeatures:
    """Find the strongest blobs of a grey picture (h, w) and describe them.

    At most `max_features` come back, strongest first; a flat or tiny picture gives none, which is no error.
    The result depends neither on the run nor on the number of threads.

    Raises:
        ValueError: the picture is not 2-D uint8 or has a side above 32766 px (which cv2.remap cannot read),
            `max_features` is negative or `threshold` is not positive.
    """
    if grey.ndim != 2 or grey.dtype != np.uint8:
        raise ValueError(f"SURF needs a 2-D uint8 picture, not {grey.ndim}-D {grey.dtype}")
    if max(grey.shape) > _LONGEST_SIDE:
        raise ValueError(f"SURF reads sides of {_LONGEST_SIDE} px at most, not {max(grey.shape)}")
    if max_features < 0 or not threshold > 0:
        raise ValueError(f"max_features {max_features} must be >= 0 and threshold {threshold} > 0")
    peaks = _detect(grey, threshold)
    peaks = peaks[np.argsort(-peaks[:, _RESPONSE], kind="stable")[:max_features]]
    xy, scale, response, trace = np.ascontiguousarray(peaks[:, :2]), *np.ascontiguousarray(peaks[:, 2:].T)
    angle, descriptors = _orient_and_describe(grey, xy, scale)
    return SurfFeatures(xy, scale, angle, response, trace.astype(np.int8), descriptors)


def surf(grey: NDArray[np.uint8], count: int) -> Described:
    """SURF key points, up to twice `count` for spreading, with descriptors (n, 64) of unit length."""
    found = detect_and_describe(grey, max_features=_SURPLUS * count)
    return Described(found.xy, found.scale, found.angle, found.response, found.descriptors)


# --- Detection -------------------------------------------------------------------------------------------


def _detect(grey: NDArray[np.uint8], threshold: float) -> F32:
    """All maxima of the Hessian above the threshold: rows of x, y, scale, response, sign of the trace."""
    found = [np.empty((0, _RESPONSE + 2), np.float32)]
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
        return np.empty((0, _RESPONSE + 2), np.float32)
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


# --- Orientation and descriptor --------------------------------------------------------------------------


def _orient_and_describe(grey: NDArray[np.uint8], xy: F32, scale: F32) -> tuple[F32, F32]:
    """Angle and descriptor of every peak."""
    angle = np.zeros(len(xy), np.float32)
    descriptors = np.zeros((len(xy), DESCRIPTOR_SIZE), np.float32)
    for picture, factor, members in _blurred_copies(grey, scale):
        # Pixel centres: pixel 0 of the reduced picture covers pixels 0 to factor - 1 of the given one.
        here = (xy[members] + np.float32(0.5)) / np.float32(factor) - np.float32(0.5)
        size = scale[members] / np.float32(factor)
        angle[members] = _orientation(picture, here, size)
        descriptors[members] = _descriptor(picture, here, size, angle[members])
    return angle, descriptors


def _blurred_copies(grey: NDArray[np.uint8], scale: F32) -> Iterator[tuple[F32, int, Index]]:
    """Copies of the picture, two per octave of scale, each with its reduction and the rows to read there."""
    level = np.floor(2 * np.log2(scale / np.float32(_FINEST_SCALE))).astype(np.intp).clip(0)
    reduced: F32 = grey.astype(np.float32)
    factor = 1
    for number in range(int(level.max(initial=-1)) + 1):
        if number and number % 2 == 0:
            reduced, factor = _halve(reduced), 2 * factor
        members = np.flatnonzero(level == number)
        if members.size == 0:
            continue
        middle = _FINEST_SCALE * 2 ** (number / 2 + 0.25) / factor  # in pixels of the copy
        sigma = _BLUR_PER_SCALE * middle
        copy = cv2.GaussianBlur(reduced, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)
        for start in range(0, members.size, _CHUNK):
            yield np.asarray(copy, np.float32), factor, members[start : start + _CHUNK]


def _halve(picture: F32) -> F32:
    """Means of 2 x 2 pixels; an odd last row or column is dropped, so that pixel pairs keep their place."""
    height, width = picture.shape[0] // 2, picture.shape[1] // 2
    even = picture[: 2 * height, : 2 * width]
    return np.asarray(cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA), np.float32)


def _sample(picture: F32, xy: F32, scale: F32, side: int, angle: F32 | None = None) -> F32:
    """Brightness (side, side, n) on a square grid of spacing s about each keypoint, rows along its own y."""
    offset = np.arange(side, dtype=np.float32) - np.float32((side - 1) / 2)
    cosine = scale if angle is None else scale * np.cos(angle)
    sine = np.zeros_like(scale) if angle is None else scale * np.sin(angle)
    along, down = offset[None, :, None], offset[:, None, None]
    x = ((along * cosine + xy[:, 0]) - down * sine).reshape(side * side, -1)
    y = ((along * sine + xy[:, 1]) + down * cosine).reshape(side * side, -1)
    values = cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(values, np.float32).reshape(side, side, -1)


def _orientation(picture: F32, xy: F32, scale: F32) -> F32:
    """Direction of the largest sum of Haar responses within 60 degrees, radians."""
    reach = _ORIENTATION_RADIUS
    patch = _sample(picture, xy, scale, 2 * reach + 4)
    pair_x, pair_y = patch[:, :-1] + patch[:, 1:], patch[:-1] + patch[1:]
    half_x, half_y = pair_x[:, 2:] - pair_x[:, :-2], pair_y[2:] - pair_y[:-2]
    dx = half_x[:-3] + half_x[1:-2] + half_x[2:-1] + half_x[3:]  # wavelets of side 4 s
    dy = half_y[:, :-3] + half_y[:, 1:-2] + half_y[:, 2:-1] + half_y[:, 3:]
    offset = np.arange(-reach, reach + 1)
    square = offset[:, None] ** 2 + offset**2
    disc = square < reach**2
    weight = np.exp(-square[disc] / (2 * _ORIENTATION_SIGMA**2)).astype(np.float32)[:, None]
    return _dominant_direction(dx[disc] * weight, dy[disc] * weight)


def _dominant_direction(dx: F32, dy: F32) -> F32:
    """Direction, per column, of the longest vector sum in a sliding window."""
    n = dx.shape[1]
    bins = (np.asarray(cv2.phase(dx, dy), np.float32) * np.float32(_ANGLE_BINS / (2 * np.pi))).astype(np.intp)
    slot = (np.minimum(bins, _ANGLE_BINS - 1) * n + np.arange(n)).ravel()
    sums = []
    for part in (dx, dy):
        histogram = np.bincount(slot, part.ravel(), _ANGLE_BINS * n).reshape(_ANGLE_BINS, n)
        wrapped = np.concatenate([np.zeros((1, n)), histogram, histogram[: _WINDOW_BINS - 1]])
        total = np.cumsum(wrapped, axis=0)
        sums.append(total[_WINDOW_BINS:] - total[:-_WINDOW_BINS])
    best = np.argmax(sums[0] ** 2 + sums[1] ** 2, axis=0)
    column = np.arange(n)
    direction: F32 = np.arctan2(sums[1][best, column], sums[0][best, column]).astype(np.float32)
    return direction


def _descriptor(picture: F32, xy: F32, scale: F32, angle: F32) -> F32:
    """Sums of dx, |dx|, dy, |dy| in 4 x 4 cells along the keypoint's direction, normalised."""
    side = _CELLS * _SAMPLES_PER_CELL
    patch = _sample(picture, xy, scale, side + 1, angle)
    falling, rising = patch[1:, 1:] - patch[:-1, :-1], patch[:-1, 1:] - patch[1:, :-1]
    offset = np.arange(side) - (side - 1) / 2
    weight = np.exp(-(offset**2) / (2 * _DESCRIPTOR_SIGMA**2)).astype(np.float32)
    window = (weight[:, None] * weight)[:, :, None]
    dx, dy = (falling + rising) * window, (falling - rising) * window  # wavelets of side 2 s
    split = (_CELLS, _SAMPLES_PER_CELL, _CELLS, _SAMPLES_PER_CELL, -1)
    sums = [part.reshape(split).sum(axis=(1, 3)) for part in (dx, np.abs(dx), dy, np.abs(dy))]
    rows = np.stack(sums, axis=2).reshape(DESCRIPTOR_SIZE, -1).T
    return _root_normalised(np.ascontiguousarray(rows))


def _root_normalised(sums: F32) -> F32:
    """Signed square root of the L1-normalised rows; their Euclidean norm becomes 1."""
    total = np.abs(sums).sum(axis=1, keepdims=True)
    part = sums / np.maximum(total, np.finfo(np.float32).tiny)
    rooted: F32 = np.copysign(np.sqrt(np.abs(part)), part)
    return rooted
