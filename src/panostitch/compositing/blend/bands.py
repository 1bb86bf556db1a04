"""Weighted sums of Laplacian pyramids (Burt & Adelson 1983)."""

import cv2
import numpy as np

from panostitch.compositing.blend.pieces import EVERYWHERE, Floats

Frame = tuple[tuple[int, int], tuple[int, int]]  # margins above, below, left and right

HALO = 3  # times 2^levels: what lies farther away changes a pixel by less than 0.0001 of a grey level


class Bands:
    """The sum over photos of weight times Laplacian band, fine to coarse and last the low-pass."""

    def __init__(self, shape: tuple[int, ...], levels: int, *, wraps: bool) -> None:
        height, width = shape
        step = 1 << levels
        margin = min(HALO * step, width) if wraps else 0
        self._shape, self._wraps = shape[:2], wraps
        self._inner = (slice(0, height), slice(margin, margin + width))
        self._frame = ((0, -height % step), (margin, -(width + 2 * margin) % step + margin))
        wide, high = (n + sum(frame) for n, frame in zip((width, height), reversed(self._frame), strict=True))
        self._sum = [np.zeros((high >> level, wide >> level, 3), np.float32) for level in range(levels + 1)]
        self._levels = levels

    def add(
        self, photo: Floats, weight: Floats, change: Floats | None = None, place: tuple[slice, slice] = EVERYWHERE
    ) -> None:
        """Add a photo (h, w, 3) with its weights (h, w); the weights of all photos sum to one.

        `change` is added to the photo's lowest level, whose size it has. A photo may lie in a place of the picture, at
        multiples of the step of the lowest level unless it ends with the picture; all across where that wraps.
        """
        frame, place = self._framing(place)
        framed = _framed(photo, frame, wraps=self._wraps)
        weights = _framed(weight, frame, wraps=self._wraps)
        for level, band in enumerate(_weighted_bands(framed, weights, self._levels, change)):
            part = tuple(slice(s.start and s.start >> level, s.stop and s.stop >> level) for s in place)
            self._sum[level][part] += band

    def _framing(self, place: tuple[slice, slice]) -> tuple[Frame, tuple[slice, slice]]:
        """The margins of a place of the picture, and where it lies with them in the framed one."""
        (_, below), (left, right) = self._frame
        (rows, columns), (height, width) = place, self._shape
        down = rows.stop is None or rows.stop == height
        across = columns.stop is None or columns.stop == width
        inner = (slice(rows.start, None if down else rows.stop), slice(columns.start, None if across else columns.stop))
        return ((0, below if down else 0), (left, right if across else 0)), inner

    def collapse(self) -> Floats:
        """The blended picture (h, w, 3)."""
        whole = self._sum[-1]
        for band in reversed(self._sum[:-1]):
            whole = np.asarray(cv2.add(cv2.pyrUp(whole, dstsize=band.shape[1::-1]), band), np.float32)
        return np.asarray(whole[self._inner], np.float32)


def _framed(array: Floats, frame: Frame, *, wraps: bool) -> Floats:
    """The array with a margin: the other side's columns where it wraps, its own edge elsewhere."""
    if not any(map(any, frame)):
        return array
    rest = ((0, 0),) * (array.ndim - 2)
    framed = np.pad(array, ((0, 0), frame[1], *rest), mode="wrap" if wraps else "edge")
    return np.asarray(np.pad(framed, (frame[0], (0, 0), *rest), mode="edge"), np.float32)


def _weighted_bands(photo: Floats, weight: Floats, levels: int, change: Floats | None) -> list[Floats]:
    """Laplacian bands of a photo, fine to coarse and last the low-pass, each times the weight of its level."""
    bands = []
    for _ in range(levels):
        smaller = cv2.pyrDown(photo)
        bands.append(_times(photo - cv2.pyrUp(smaller, dstsize=photo.shape[1::-1]), weight))
        photo, weight = np.asarray(smaller, np.float32), np.asarray(cv2.pyrDown(weight), np.float32)
    bands.append(_times(photo if change is None else photo + change, weight))
    return bands


def _times(pixels: Floats, weight: Floats) -> Floats:
    return np.asarray(cv2.multiply(pixels, cv2.merge([weight] * 3)), np.float32)
