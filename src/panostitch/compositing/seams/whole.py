"""Photos in one piece each, also where they lie across the edge of a full turn."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.model.canvas import Canvas, Layer, Region

Floats = NDArray[np.float32]
Booleans = NDArray[np.bool_]
Place = tuple[slice, slice] | tuple[NDArray[np.intp], ...]


@dataclass(frozen=True)
class Whole:
    """A photo in a frame of the canvas, 1 px larger where there is more; columns go on round the edge of a full turn.

    place:  index of the frame in an array (H, W) of the canvas; slices, which are quick, where it lies in one piece
    pixels: (h, w, 3) 0..255
    mask:   (h, w) where it shows something
    depth:  (h, w) px from the photo's edge
    closed: the frame goes all the way round, its last column lies next to its first
    """

    number: int
    place: Place
    pixels: Floats
    mask: Booleans
    depth: Floats
    closed: bool


def whole_photos(canvas: Canvas, pieces: Sequence[tuple[int, Layer]]) -> list[Whole]:
    """The photos in the order of their numbers."""
    numbers = sorted({number for number, _ in pieces})
    return [_whole(canvas, number, [layer for n, layer in pieces if n == number]) for number in numbers]


def _whole(canvas: Canvas, number: int, layers: Sequence[Layer]) -> Whole:
    columns = _columns(canvas, layers)
    top, bottom = min(layer.region.y for layer in layers), max(layer.region.bottom for layer in layers)
    rows = np.arange(max(0, top - 1), min(bottom + 1, canvas.size[1]))
    column_of = np.zeros(canvas.size[0], np.intp)
    column_of[columns] = np.arange(len(columns))
    frame = Region(0, 0, len(columns), len(rows))
    pixels, mask = np.zeros((len(rows), len(columns), 3), np.float32), np.zeros((len(rows), len(columns)), bool)
    for layer in layers:
        # a piece is contiguous in the frame, or has been cut at the edge of the canvas
        down, across = layer.region.y - rows[0], column_of[layer.region.x]
        place = Region(across, down, layer.region.width, layer.region.height).within(frame)
        np.copyto(pixels[place], layer.pixels, where=layer.mask[..., None])
        mask[place] |= layer.mask
    closed = canvas.wraps and len(columns) == canvas.size[0]
    in_one = columns[0] <= columns[-1]
    frame_at: Place = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] if in_one else np.ix_(rows, columns)
    return Whole(number, frame_at, pixels, mask, edge_distance(mask), closed)


def _columns(canvas: Canvas, layers: Sequence[Layer]) -> NDArray[np.intp]:
    """Columns of the canvas from before the first to behind the last that a photo touches, around the widest gap."""
    width = canvas.size[0]
    touched = np.zeros(width, bool)
    for layer in layers:
        touched[layer.region.x : layer.region.right] = True
    used = np.flatnonzero(touched)
    if not canvas.wraps:
        return np.arange(max(0, used[0] - 1), min(used[-1] + 2, width))
    last = int(np.argmax(np.diff(used, append=used[0] + width)))
    first = used[(last + 1) % len(used)]
    extent = (used[last] - first) % width + 1
    return np.asarray((first - 1 + np.arange(min(width, extent + 2))) % width)


def edge_distance(mask: Booleans) -> Floats:
    """Distance (h, w) px of each pixel from the edge of what is shown; 0 outside it."""
    framed = np.pad(mask.astype(np.uint8), 1)
    return np.asarray(cv2.distanceTransform(framed, cv2.DIST_L2, cv2.DIST_MASK_5)[1:-1, 1:-1], np.float32)
