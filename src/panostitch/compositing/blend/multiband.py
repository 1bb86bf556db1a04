"""Multi-band blending (Burt & Adelson 1983; Brown & Lowe 2007, section 7), in two scales.

All low bands are blended once, on the reduced canvas. What that changes in a photo is smooth, and zero where only one
photo matters. Fine bands, up to the factor of the reduction, reach only a few pixels: they are blended in each tile,
after the change has been added to the lowest level of each photo. Far from seams a pixel is its photo's pixel.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from math import floor, log2

import cv2
import numpy as np

from panostitch.compositing.blend.bands import HALO, Bands
from panostitch.compositing.blend.pieces import EVERYWHERE, Booleans, Floats, Labels, Piece, fill, only, put
from panostitch.compositing.crop import bounding_box
from panostitch.model.canvas import Canvas, Region

# Repeated `pyrDown` smooths by a cubic B-spline. Weights at the reduced size are what it leaves of seams between whole
# reduced pixels: the spline integrated over a pixel.
REDUCED_KERNEL = np.array([1, 76, 230, 76, 1], np.float32) / np.float32(384)
COARSEST = 4  # the lowest band of the smallest photo is this many pixels wide
ENLARGING = 2  # times 2^levels: how far a change that is enlarged looks


def blend_reduced(
    pieces: Sequence[Piece], labels: Labels, composite: Floats, canvas: Canvas, factor: int, levels: int | None
) -> Floats | None:
    """The picture (h, w, 3) blended in the bands that the tiles leave over; None where they leave none.

    levels: number of bands beside the low-pass, those of the tiles included; None for as many as the photos are wide
    """
    fine = _fine(factor)
    if levels is not None and levels < fine:
        return None
    depth = _widest(pieces) if levels is None else levels - fine
    bands = Bands(composite.shape[:2], depth, wraps=canvas.wraps)
    others, shared = _others(pieces, labels, composite)
    for photo in sorted({piece.photo for piece in pieces}):
        owned = np.asarray(labels == photo)
        if owned.any():
            box = matters(owned, depth, wraps=canvas.wraps)
            at = box.within(Region.of(composite))
            own, owns = [piece for piece in pieces if piece.photo == photo], owned[at]
            around = composite[at].copy()
            put(around, others[at], owns)
            pixels = _continued(own, box, around, shared[at] | ~owns)
            weight = np.asarray(owns, np.float32)
            bands.add(pixels, _smoothed(weight) if factor > 1 else weight, place=at)
    return bands.collapse()


def matters(owned: Booleans, levels: int, *, wraps: bool) -> Region:
    """Where a photo that owns this (h, w) matters to bands, at multiples of the lowest step; whole rows of a turn.

    Its weights reach two pixels of the lowest band beyond what it owns, and its own bands must be sound there.
    """
    whole = Region.of(owned)
    box = bounding_box(owned).grown((HALO + 2) << levels, multiple=1 << levels) & whole
    return replace(box, x=0, width=whole.width) if wraps else box


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
        put(picture[piece.place], piece.pixels, seen)
        shared[piece.place] |= seen
    return picture, shared


def join(
    pieces: Sequence[Piece], changes: Sequence[Floats], composite: Floats, factor: int, levels: int | None
) -> Floats:
    """Fine bands of a tile (h, w, 3) over the blended low ones; its sides and places are multiples of the factor.

    A piece must reach as far around what it owns as its bands do. Where there is but one, all its bands add up to
    itself: they are made only around the seams.
    """
    fine = _fine(factor)
    for piece, change in zip(pieces, changes, strict=True):
        put(composite[piece.place], alone(piece.pixels, change, factor), piece.owns)
    places = [_region(piece.place) for piece in pieces]
    shared = _around([a & b for a, b in combinations(places, 2)])
    if not shared:
        return composite
    whole = Region.of(composite)
    around = shared.grown(ENLARGING * factor) & whole
    depth = fine if levels is None else min(levels, fine)
    bands = Bands((around.height, around.width), depth, wraps=False)
    for piece, place, change in zip(pieces, places, changes, strict=True):
        part = place & around
        if part:
            own = part.within(place)
            # with fewer bands nothing was blended on the reduced canvas
            low = change[part.divided(factor).within(place.divided(factor))] if depth == fine else None
            bands.add(piece.pixels[own], np.asarray(piece.owns[own], np.float32), low, part.within(around))
    composite[shared.within(whole)] = bands.collapse()[shared.within(around)]
    return composite


def alone(pixels: Floats, change: Floats, factor: int, place: tuple[slice, slice] = EVERYWHERE) -> Floats:
    """Pixels (h, w, 3) of a photo far from seams; the change covers the tile of which they are a place."""
    return np.asarray(cv2.add(pixels, _enlarged(change, _fine(factor))[place]), np.float32)


def _region(place: tuple[slice, slice]) -> Region:
    rows, columns = place
    return Region(columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start)


def _around(regions: Sequence[Region]) -> Region:
    """The smallest region that holds all these; empty where all of them are."""
    found = [region for region in regions if region]
    x, y = (min((getattr(region, side) for region in found), default=0) for side in ("x", "y"))
    right, bottom = (max((getattr(region, side) for region in found), default=0) for side in ("right", "bottom"))
    return Region(x, y, right - x, bottom - y)


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


def _continued(own: Sequence[Piece], box: Region, around: Floats, comparable: Booleans) -> Floats:
    """All parts of a photo in a box of the canvas, continued beyond its edges: bands then see no edge.

    Beyond them lies what is `around` (h, w, 3), the other photos, and the difference to them, which is known where
    the photo overlaps them (`comparable`) and goes on smoothly. Photos that agree are so continued by what they would
    have seen, and where they differ, bands see the photo's own brightness.
    """
    pixels, shown = np.zeros_like(around), np.zeros(around.shape[:2], bool)
    for piece in own:
        place = _region(piece.place)
        here, there = ((place & box).within(frame) for frame in (box, place))
        put(pixels[here], piece.pixels[there], piece.mask[there])
        shown[here] |= piece.mask[there]
    known = shown & comparable
    difference = only(pixels - around, known)
    half = around.shape[1] // 2 if len(own) > 1 else 0
    # a photo that touches the left and the right edge of a closed turn goes on at the far side of the turn
    extended = np.roll(fill(np.roll(difference, half, axis=1), np.roll(known, half, axis=1)), -half, axis=1)
    continued = around + extended
    put(continued, pixels, shown)
    return continued
