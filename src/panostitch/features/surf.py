"""SURF, a fast detector and descriptor of blobs, written from the paper.

H. Bay, A. Ess, T. Tuytelaars, L. Van Gool: "Speeded-Up Robust Features (SURF)", Computer Vision and
Image Understanding 110 (2008) 346-359. Detection is the paper's: a box-filter Hessian on an integral
image. Orientation and descriptor use the paper's geometry, but take their Haar responses from scale-matched
blurred copies of the picture: unlike box sums at rounded points these can be turned and are not quantised.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.features import hessian
from panostitch.features.described import Described

F32 = NDArray[np.float32]
Index = NDArray[np.intp]

HESSIAN_THRESHOLD = 100.0  # smallest determinant kept, (grey levels)^2 of 0..255; OpenCV's SURF default
_LONGEST_SIDE = 32766  # px; cv2.remap's limit
_SURPLUS = 2  # key points handed over for each one that will be kept
DESCRIPTOR_SIZE = 64  # 4 x 4 cells, four sums each

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
    peaks = hessian.detect(grey, threshold)
    peaks = peaks[np.argsort(-peaks[:, hessian.RESPONSE], kind="stable")[:max_features]]
    xy, scale, response, trace = np.ascontiguousarray(peaks[:, :2]), *np.ascontiguousarray(peaks[:, 2:].T)
    angle, descriptors = _orient_and_describe(grey, xy, scale)
    return SurfFeatures(xy, scale, angle, response, trace.astype(np.int8), descriptors)


def surf(grey: NDArray[np.uint8], count: int) -> Described:
    """SURF key points, up to twice `count` for spreading, with the sign of the Laplacian as a 65th number.

    It is weighted so that blobs of unlike sign are always further apart than any two of like sign.
    """
    found = detect_and_describe(grey, max_features=_SURPLUS * count)
    signed = np.column_stack([found.descriptors, found.laplacian.astype(np.float32)]) * np.float32(np.sqrt(0.5))
    return Described(found.xy, found.scale, found.angle, found.response, signed)


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
