"""No blending: hard seams."""

from collections.abc import Sequence

import numpy as np

from panostitch.compositing.blend.pieces import Floats, Labels, Piece
from panostitch.model.canvas import Canvas


def correct(pieces: Sequence[Piece], labels: Labels, composite: Floats, canvas: Canvas, factor: int) -> Floats:
    """No correction."""
    del pieces, labels, canvas, factor
    return np.zeros_like(composite)


def join(pieces: Sequence[Piece], composite: Floats, factor: int) -> Floats:
    """The hard composite as it is."""
    del pieces, factor
    return composite


def reach(factor: int) -> int:
    """No pixel looks at another one."""
    del factor
    return 0
