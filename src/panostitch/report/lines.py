"""Lines of the page as SVG path data: outlines, seams, dots, strokes. Coordinates are px of what they lie on."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from panostitch.debug.diagram import outline_on, pieces, shifts, turn_width
from panostitch.model.camera import Camera
from panostitch.model.canvas import Canvas

Floats = NDArray[np.float64]


def path(pieces_of: Iterable[Floats]) -> str:
    """Lines through points (n, 2), to a tenth of a px."""
    return "".join("M" + "L".join(f"{_short(x)} {_short(y)}" for x, y in piece.tolist()) for piece in pieces_of)


def dots(xy: Floats) -> str:
    """A stroke without length at each point (n, 2): a round dot under `stroke-linecap: round`."""
    return "".join(f"M{_short(x)} {_short(y)}h0" for x, y in xy.tolist())


def strokes(start: Floats, end: Floats) -> str:
    """A line from each point (n, 2) to its other end (n, 2)."""
    return path(np.stack([start, end], axis=1))


def outline(camera: Camera, canvas: Canvas) -> tuple[str, Floats | None]:
    """The outline of a photo on a canvas, and its middle (2,); None where nothing of it is in sight."""
    xy = outline_on(camera, canvas)
    copies = [pieces(xy + np.array([shift, 0.0])) for shift in shifts(turn_width(canvas))]
    centres = [np.vstack(seen).mean(axis=0) for seen in copies if seen]
    if not centres:
        return "", None
    middle = (np.array(canvas.size) - 1) / 2
    return path(piece for seen in copies for piece in seen), min(centres, key=lambda c: float(abs(c - middle).max()))


def seams(labels: NDArray[np.int16]) -> str:
    """The borders between photos in an array (h, w) of labels, along the edges of its px; -1 is nobody."""
    beside = (labels[:, 1:] != labels[:, :-1]) & (labels[:, 1:] >= 0) & (labels[:, :-1] >= 0)
    below = (labels[1:] != labels[:-1]) & (labels[1:] >= 0) & (labels[:-1] >= 0)
    down = "".join(f"M{x + 1} {start}v{count}" for x, start, count in _runs(beside.T))
    right = "".join(f"M{start} {y + 1}h{count}" for y, start, count in _runs(below))
    return down + right


def _runs(marks: NDArray[np.bool_]) -> Iterable[tuple[int, int, int]]:
    """Row, start and length of the runs of True in the rows of an array."""
    steps = np.diff(np.pad(marks, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, starts = np.nonzero(steps == 1)
    _, ends = np.nonzero(steps == -1)
    return zip(rows.tolist(), starts.tolist(), (ends - starts).tolist(), strict=True)


def _short(number: float) -> str:
    return f"{number:.1f}".removesuffix(".0")
