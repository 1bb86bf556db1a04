"""Feathering: across a seam each photo fades into the other over a fixed width."""

from collections.abc import Sequence

import cv2
import numpy as np

from panostitch.compositing.blend.pieces import Floats, Piece

SPREAD = 4.0  # standard deviation of the fading, px of the reduced canvas


def join(
    pieces: Sequence[Piece], changes: Sequence[Floats], composite: Floats, factor: int, levels: int | None
) -> Floats:
    """Mean of the photos with weights that fall off across the seams; only where a photo shows something."""
    del changes, levels
    total, weights = np.zeros_like(composite), np.zeros(composite.shape[:2], np.float32)
    for piece in pieces:
        owns = np.zeros(composite.shape[:2], np.float32)
        owns[piece.place] = piece.owns
        weight = cv2.GaussianBlur(owns, (0, 0), SPREAD * factor)[piece.place] * piece.mask
        total[piece.place] += cv2.multiply(piece.pixels, cv2.merge([weight] * 3))
        weights[piece.place] += weight
    blended = total / np.maximum(weights, 1e-6)[..., None]
    return np.asarray(np.where((weights > 1e-3)[..., None], blended, composite), np.float32)


def reach(factor: int) -> int:
    """OpenCV cuts a Gaussian off at four standard deviations."""
    del factor
    return int(np.ceil(4 * SPREAD)) + 1
