"""What blenders work on: the pieces of photos that meet in one array."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.model.canvas import Canvas

Floats = NDArray[np.float32]
Booleans = NDArray[np.bool_]
Labels = NDArray[np.int16]

EVERYWHERE = (slice(None), slice(None))  # the place of what fills the whole array


@dataclass(frozen=True)
class Piece:
    """One photo, or a part of one, in an array; gain applied.

    photo:  its number
    place:  rows and columns of the array that it touches
    pixels: (h, w, 3) 0..255, of the size of `place`; outside the mask its edge goes on
    mask:   (h, w) where it shows something
    owns:   (h, w) where it is the owner; owners share out the whole array, covered or not
    """

    photo: int
    place: tuple[slice, slice]
    pixels: Floats
    mask: Booleans
    owns: Booleans


# From pieces, labels (h, w) without a gap and the hard composite (h, w, 3), all on the reduced canvas, the factor of
# the reduction and the number of bands (None: by the photos) to the blended picture (h, w, 3); None where a blender
# does nothing there.
BlendReduced = Callable[[Sequence[Piece], Labels, Floats, Canvas, int, int | None], Floats | None]
# From the pieces of a tile, the change (h / factor, w / factor, 3) of each on its place, the hard composite (h, w, 3),
# which may be overwritten, the factor and the number of bands to the pixels (h, w, 3) where an owner covers them.
# Change (i, j) belongs to the piece's pixel (factor i, factor j), as in `cv2.pyrDown`.
Join = Callable[[Sequence[Piece], Sequence[Floats], Floats, int, int | None], Floats]

# The same for the pixels of a photo that is the only one in the tile: its pixels, its change on the whole tile, the
# factor, and the place of the tile where the pixels are.
Alone = Callable[[Floats, Floats, int, tuple[slice, slice]], Floats]


def hard_composite(pieces: Sequence[Piece], shape: tuple[int, int]) -> tuple[Floats, Booleans]:
    """Each pixel (h, w, 3) from its owner, 0 where the owner does not cover it, and where it does."""
    picture, covered = np.zeros((*shape, 3), np.float32), np.zeros(shape, bool)
    for piece in pieces:
        shown = piece.owns & piece.mask
        put(picture[piece.place], piece.pixels, shown)
        covered[piece.place] |= shown
    return picture, covered


def put(picture: Floats, pixels: Floats, where: Booleans) -> None:
    """Write some of the pixels (h, w, 3) into a picture, which may be a part of an array; NumPy is slow at that."""
    cv2.copyTo(pixels, where.view(np.uint8), picture)


def only(pixels: Floats, where: Booleans) -> Floats:
    """Some of the pixels (h, w, 3), and 0 elsewhere."""
    picture = np.zeros_like(pixels)
    put(picture, pixels, where)
    return picture


def fill(picture: Floats, known: Booleans) -> Floats:
    """Continue the known pixels of a picture (h, w, 3) into the unknown ones, smoother with distance.

    Push-pull (Gortler et al. 1996): means of the known pixels at half size, filled there, enlarged.
    """
    height, width = known.shape
    if known.all() or not known.any() or min(height, width) < 2:
        return picture
    size = ((width + 1) // 2, (height + 1) // 2)
    weight = known.astype(np.float32)
    small_weight = cv2.resize(weight, size, interpolation=cv2.INTER_AREA)
    small = cv2.resize(only(picture, known), size, interpolation=cv2.INTER_AREA)
    means = np.asarray(small / cv2.merge([np.maximum(small_weight, 1e-6)] * 3), np.float32)
    filled = fill(means, np.asarray(small_weight > 1e-6))
    enlarged = np.asarray(cv2.resize(filled, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)
    put(enlarged, picture, known)
    return enlarged
