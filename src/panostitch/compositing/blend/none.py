"""No blending: hard seams."""

from collections.abc import Sequence

from panostitch.compositing.blend.pieces import EVERYWHERE, Floats, Labels, Piece
from panostitch.model.canvas import Canvas


def blend_reduced(
    pieces: Sequence[Piece], labels: Labels, composite: Floats, canvas: Canvas, factor: int, levels: int | None
) -> None:
    """Nothing is blended on the reduced canvas."""
    del pieces, labels, composite, canvas, factor, levels


def join(
    pieces: Sequence[Piece], changes: Sequence[Floats], composite: Floats, factor: int, levels: int | None
) -> Floats:
    """The hard composite as it is."""
    del pieces, changes, factor, levels
    return composite


def alone(pixels: Floats, change: Floats, factor: int, place: tuple[slice, slice] = EVERYWHERE) -> Floats:
    """The photo as it is."""
    del change, factor, place
    return pixels


def reach(factor: int) -> int:
    """No pixel looks at another one."""
    del factor
    return 0
