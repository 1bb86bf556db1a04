"""Multi-band blending (Burt & Adelson 1983; Brown & Lowe 2007, section 7), in two scales.

All low bands are blended once, on the reduced canvas. What that changes in a photo is smooth, and zero where only one
photo matters. Fine bands, up to the factor of the reduction, reach only a few pixels: they are blended in each tile,
after the change has been added to the lowest level of each photo. Far from seams a pixel is its photo's pixel.
"""

from collections.abc import Sequence
from math import floor, log2

import cv2
import numpy as np

from panostitch.compositing.blend.pieces import Booleans, Floats, Labels, Piece, fill
from panostitch.model.canvas import Canvas

# Repeated `pyrDown` smooths by a cubic B-spline. Weights at the reduced size are what it leaves of seams between whole
# reduced pixels: the spline integrated over a pixel.
REDUCED_KERNEL = np.array([1, 76, 230, 76, 1], np.float32) / np.float32(384)
COARSEST = 4  # the lowest band of the smallest photo is this many pixels wide
HALO = 3  # times 2^levels: what lies farther away changes a pixel by less than 0.0001 of a grey level


def blend_reduced(
    pieces: Sequence[Piece], labels: Labels, composite: Floats, canvas: Canvas, factor: int, levels: int | None
) -> Floats | None:
    """The picture (h, w, 3) blended in the bands that the tiles leave over; None where they leave none.

    levels: number of bands beside the low-pass, those of the tiles included; None for as many as the photos are wide
    """
    fine = _fine(factor)
    if levels is not None and levels < fine:
        return None
    bands = _Bands(composite.shape[:2], _widest(pieces) if levels is None else levels - fine, wraps=canvas.wraps)
    others, shared = _others(pieces, labels, composite)
    for photo in sorted({piece.photo for piece in pieces}):
        owns = np.asarray(labels == photo)
        if owns.any():
            own = [piece for piece in pieces if piece.photo == photo]
            around = np.where(owns[..., None], others, composite)
            pixels = _continued(own, around, shared | ~owns)
            weight = np.asarray(owns, np.float32)
            bands.add(pixels, _smoothed(weight) if factor > 1 else weight)
    return bands.collapse()


def _fine(factor: int) -> int:
    return factor.bit_length() - 1


def _widest(pieces: Sequence[Piece]) -> int:
    """Number of bands of the reduced canvas after which the smallest photo is `COARSEST` pixels wide.

    A photo that lies across the edge of a full turn is as wide as its two pieces together, however narrow one is.
    """
    sides = []
    for photo in {piece.photo for piece in pieces}:
        heights, widths = zip(*(piece.mask.shape for piece in pieces if piece.photo == photo), strict=True)
        sides.append(min(max(heights), sum(widths)))
    return max(0, floor(log2(max(1, min(sides, default=1) / COARSEST))))


def _others(pieces: Sequence[Piece], labels: Labels, composite: Floats) -> tuple[Floats, Booleans]:
    """What a photo that is not the owner shows of each pixel (h, w, 3), and where there is one."""
    picture, shared = composite.copy(), np.zeros(labels.shape, bool)
    for piece in pieces:
        seen = piece.mask & (labels[piece.place] != piece.photo) & ~shared[piece.place]
        np.copyto(picture[piece.place], piece.pixels, where=seen[..., None])
        shared[piece.place] |= seen
    return picture, shared


def join(
    pieces: Sequence[Piece], changes: Sequence[Floats], composite: Floats, factor: int, levels: int | None
) -> Floats:
    """Fine bands of a tile (h, w, 3) over the blended low ones; its sides must be multiples of the factor."""
    fine = _fine(factor)
    owners = [(piece, change) for piece, change in zip(pieces, changes, strict=True) if piece.owns.any()]
    if len(owners) == 1:
        return composite + _enlarged(owners[0][1], fine)
    depth = fine if levels is None else min(levels, fine)
    bands = _Bands(composite.shape[:2], depth, wraps=False)
    for piece, change in owners:
        # with fewer bands nothing was blended on the reduced canvas
        bands.add(piece.pixels, np.asarray(piece.owns, np.float32), change if depth == fine else None)
    return bands.collapse()


def _enlarged(change: Floats, levels: int) -> Floats:
    """As the lowest level of a pyramid comes out of it."""
    for _ in range(levels):
        change = np.asarray(cv2.pyrUp(change), np.float32)
    return change


def reach(factor: int) -> int:
    """The halo of the fine bands, in px of the reduced canvas."""
    return HALO if factor > 1 else 0


def _smoothed(weight: Floats) -> Floats:
    smooth = cv2.sepFilter2D(weight, -1, REDUCED_KERNEL, REDUCED_KERNEL, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(smooth, np.float32)


def _continued(own: Sequence[Piece], around: Floats, comparable: Booleans) -> Floats:
    """All parts of a photo on the whole canvas, continued beyond its edges: bands then see no edge.

    Beyond them lies what is `around` (h, w, 3), the other photos, and the difference to them, which is known where
    the photo overlaps them (`comparable`) and goes on smoothly. Photos that agree are so continued by what they would
    have seen, and where they differ, bands see the photo's own brightness.
    """
    pixels, shown = np.zeros_like(around), np.zeros(around.shape[:2], bool)
    for piece in own:
        pixels[piece.place][piece.mask] = piece.pixels[piece.mask]
        shown[piece.place] |= piece.mask
    known = shown & comparable
    difference = np.where(known[..., None], pixels - around, np.float32(0))
    half = around.shape[1] // 2 if len(own) > 1 else 0
    # a photo that touches the left and the right edge of a closed turn goes on at the far side of the turn
    extended = np.roll(fill(np.roll(difference, half, axis=1), np.roll(known, half, axis=1)), -half, axis=1)
    return np.asarray(np.where(shown[..., None], pixels, around + extended), np.float32)


class _Bands:
    """The sum over photos of weight times Laplacian band, fine to coarse and last the low-pass."""

    def __init__(self, shape: tuple[int, ...], levels: int, *, wraps: bool) -> None:
        height, width = shape
        step = 1 << levels
        margin = min(HALO * step, width) if wraps else 0
        self._wraps = wraps
        self._inner = (slice(0, height), slice(margin, margin + width))
        self._frame = ((0, -height % step), (margin, -(width + 2 * margin) % step + margin))
        self._sum: list[Floats] = []
        self._levels = levels

    def add(self, photo: Floats, weight: Floats, change: Floats | None = None) -> None:
        """Add a photo (h, w, 3) with its weights (h, w); the weights of all photos sum to one.

        `change` is added to the photo's lowest level, whose size it has.
        """
        bands = _weighted_bands(
            _framed(photo, self._frame, wraps=self._wraps),
            _framed(weight, self._frame, wraps=self._wraps),
            self._levels,
            change,
        )
        for level, band in enumerate(bands):
            if level == len(self._sum):
                self._sum.append(band)
            else:
                self._sum[level] += band

    def collapse(self) -> Floats:
        """The blended picture (h, w, 3)."""
        whole = self._sum[-1]
        for band in reversed(self._sum[:-1]):
            whole = cv2.pyrUp(whole, dstsize=band.shape[1::-1]) + band
        return np.asarray(whole[self._inner], np.float32)


def _framed(array: Floats, frame: tuple[tuple[int, int], tuple[int, int]], *, wraps: bool) -> Floats:
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
        bands.append((photo - cv2.pyrUp(smaller, dstsize=photo.shape[1::-1])) * weight[..., None])
        photo, weight = np.asarray(smaller, np.float32), np.asarray(cv2.pyrDown(weight), np.float32)
    bands.append((photo if change is None else photo + change) * weight[..., None])
    return [np.asarray(band, np.float32) for band in bands]
