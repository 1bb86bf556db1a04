"""Diagrams of the debug dump: the graph of links, the photos' outlines on the canvas, bars of gains."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.debug.ink import (
    GREY,
    LONGEST,
    WHITE,
    Colour,
    Picture,
    blank,
    colour,
    filled,
    fit,
    path,
    shorten,
    text_width,
    to_bytes,
    write,
)
from panostitch.geometry.projections import PROJECTIONS
from panostitch.geometry.sampling import rescale
from panostitch.model.camera import Camera
from panostitch.model.canvas import Canvas

Floats = NDArray[np.float64]

OUTLINE_POINTS = 48  # per side: a bent edge still looks smooth
MOST_NUMBERS = 80  # edges of a graph that carry their number; more would lie on each other
_BEND = 0.4  # how far links are drawn towards the middle of the circle, 0 to 1
_MARGIN = 44  # px around the canvas in the layout picture: names may stand out
_FAR = 50 * LONGEST  # px; a point beyond is on its way to infinity


@dataclass(frozen=True)
class Edge:
    """A line of the graph between nodes i and j with a number; `sound` False draws it dashed and grey."""

    i: int
    j: int
    number: int
    sound: bool = True


def graph(
    names: Sequence[str], thumbnails: Sequence[Picture | None], groups: Sequence[int | None], edges: Sequence[Edge]
) -> Picture:
    """Photos on a circle, links between them; groups in colours, photos of no group (None) in grey.

    names, thumbnails and groups are in the same order; thick lines have many inliers.
    """
    side = min(LONGEST, 720 + 60 * len(names))
    picture = blank(side, side)
    # photos of a group stand side by side
    order = sorted(range(len(names)), key=lambda k: (groups[k] is None, groups[k] or 0))
    node = int(min(190, 2 * np.pi * (side / 2 - 130) / max(1, len(names)) * 0.82))
    turn = 2 * np.pi * np.arange(len(names)) / max(1, len(names)) - np.pi / 2
    places = np.empty((len(names), 2))
    places[order] = side / 2 + (side / 2 - node / 2 - 40) * np.column_stack([np.cos(turn), np.sin(turn)])
    _draw_edges(picture, places, groups, edges)
    for k in order:
        _draw_node(picture, names[k], thumbnails[k], places[k], node, _group_colour(groups[k]))
    _write_numbers(picture, places, edges)
    _draw_legend(picture, groups)
    return picture


def _group_colour(group: int | None) -> Colour:
    return GREY if group is None else colour(group)


def _draw_edges(picture: Picture, places: Floats, groups: Sequence[int | None], edges: Sequence[Edge]) -> None:
    most = max((edge.number for edge in edges), default=1)
    for edge in sorted(edges, key=lambda e: (e.sound, e.number)):
        bow = _bow(places[edge.i], places[edge.j], picture.shape[0] / 2)
        if edge.sound:
            thickness = 1 + round(9 * np.sqrt(edge.number / max(1, most)))
            path(picture, bow, _group_colour(groups[edge.i]), thickness)
        else:
            for k in range(0, len(bow) - 1, 2):
                path(picture, bow[k : k + 2], GREY, 2)


def _write_numbers(picture: Picture, places: Floats, edges: Sequence[Edge]) -> None:
    taken: list[tuple[float, float, float, float]] = []
    for edge in sorted(edges, key=lambda e: -e.number)[:MOST_NUMBERS]:
        bow = _bow(places[edge.i], places[edge.j], picture.shape[0] / 2)
        x, y = bow[len(bow) // 2]
        at = _free_place(taken, x, y, text_width(str(edge.number)), 20)
        write(picture, str(edge.number), at, centred=True, ink=WHITE if edge.sound else GREY)


def _bow(start: Floats, end: Floats, centre: float) -> Floats:
    """A curve (m, 2) between two points that keeps clear of the photos between them on the circle."""
    middle = (start + end) / 2
    bend = middle + _BEND * (centre - middle)
    t = np.linspace(0, 1, 2 * max(8, int(np.hypot(*(end - start)) / 24)) + 1)[:, None]
    return np.asarray((1 - t) ** 2 * start + 2 * t * (1 - t) * bend + t**2 * end)


def _draw_node(picture: Picture, name: str, thumbnail: Picture | None, at: Floats, size: int, ink: Colour) -> None:
    """A thumbnail in a coloured frame at (2,) px with its name below."""
    frame = max(2, size // 24)
    if thumbnail is not None:
        inner = to_bytes(fit(thumbnail, size - 2 * frame))
    else:
        inner = blank(size // 2, size - 2 * frame, (70, 72, 76))
    height, width = inner.shape[:2]
    x, y = round(at[0] - width / 2), round(at[1] - height / 2)
    cv2.rectangle(picture, (x - frame, y - frame), (x + width + frame - 1, y + height + frame - 1), ink, -1)
    picture[y : y + height, x : x + width] = inner
    letters = 18 if size > 100 else 14
    write(picture, shorten(name, size + 20, letters), (at[0], y + height + frame + 14), height=letters, centred=True)


def _draw_legend(picture: Picture, groups: Sequence[int | None]) -> None:
    present = sorted({group for group in groups if group is not None})
    lines = [(f"group {g + 1}: {sum(group == g for group in groups)} photos", colour(g)) for g in present[:12]]
    alone = sum(group is None for group in groups)
    if alone:
        lines.append((f"in no group: {alone}", GREY))
    for number, (words, ink) in enumerate(lines):
        cv2.rectangle(picture, (12, 14 + 24 * number), (28, 28 + 24 * number), ink, -1)
        write(picture, words, (36, 21 + 24 * number))


def outline_on(camera: Camera, canvas: Canvas) -> Floats:
    """The closed outline (m, 2) of a photo in canvas px; NaN where the projection does not show it.

    On a canvas of a full turn it does not jump at the edges but runs on beyond them.
    """
    xy = canvas.pixels(camera.rays(camera.outline(OUTLINE_POINTS)))
    xy = np.vstack([xy, xy[:1]])
    period = turn_width(canvas)
    seen = np.asarray(np.isfinite(xy).all(axis=1))
    if period:
        xy[seen, 0] = np.unwrap(xy[seen, 0], period=period)
    return np.asarray(np.where(seen[:, None], xy, np.nan))


def turn_width(canvas: Canvas) -> float:
    """Canvas px of a full turn; 0 where it does not close."""
    return PROJECTIONS[canvas.projection].period * canvas.scale


def layout(outlines: Sequence[Floats], names: Sequence[str], size: tuple[int, int], *, period: float = 0.0) -> Picture:
    """Outlines (m, 2), in canvas px, of all photos on a canvas of this size (width, height), with names.

    period: canvas px of a full turn; outlines that leave on one side come in on the other.
    """
    factor = (LONGEST - 2 * _MARGIN) / max(size)
    width, height = (max(1, round(n * factor)) for n in size)
    picture = blank(height + 2 * _MARGIN, width + 2 * _MARGIN)
    cv2.rectangle(picture, (_MARGIN, _MARGIN), (_MARGIN + width - 1, _MARGIN + height - 1), (12, 12, 14), -1)
    placed = [[rescale(xy + np.array([shift, 0.0]), factor) + _MARGIN for shift in shifts(period)] for xy in outlines]
    for number, copies in enumerate(placed):
        _fill(picture, copies, colour(number), closes=_closes(outlines[number], period))
    for number, copies in enumerate(placed):
        for piece in (piece for copy in copies for piece in pieces(copy)):
            path(picture, piece, colour(number), 2)
    cv2.rectangle(picture, (_MARGIN, _MARGIN), (_MARGIN + width - 1, _MARGIN + height - 1), GREY, 1)
    taken: list[tuple[float, float, float, float]] = []
    for name, copies in zip(names, placed, strict=True):
        _name(picture, name, copies, taken)
    return picture


def shifts(period: float) -> tuple[float, ...]:
    """How far (px) to the right the copies of what lies on a canvas are, of which those in sight are drawn."""
    return (0.0, -period, period) if period else (0.0,)


def _closes(xy: Floats, period: float) -> bool:
    """Whether an outline encloses an area: not where part of it is out of sight, nor where it runs round a pole."""
    return bool(np.isfinite(xy).all() and (not period or abs(xy[-1, 0] - xy[0, 0]) < period / 2))


def _fill(picture: Picture, copies: Iterable[Floats], ink: Colour, *, closes: bool) -> None:
    tinted = picture.copy()
    for xy in copies:
        if closes and np.abs(xy).max() < _FAR:
            filled(tinted, xy, ink)
    cv2.addWeighted(picture, 0.78, tinted, 0.22, 0, dst=picture)


def pieces(xy: Floats) -> list[Floats]:
    """The stretches of a line (m, 2) that are in sight."""
    with np.errstate(invalid="ignore"):
        gaps = np.flatnonzero(~(np.abs(xy) < _FAR).all(axis=1))
    return [piece for piece in (part[np.isfinite(part).all(axis=1)] for part in _split(xy, gaps)) if len(piece) > 1]


def _split(xy: Floats, gaps: NDArray[np.intp]) -> list[Floats]:
    bounds = [-1, *gaps.tolist(), len(xy)]
    return [xy[first + 1 : last] for first, last in pairwise(bounds)]


def _name(
    picture: Picture, name: str, copies: Sequence[Floats], taken: list[tuple[float, float, float, float]]
) -> None:
    """Write a name amid the copy of an outline that lies most on the picture."""
    height, width = picture.shape[:2]
    centres = [np.mean(np.vstack(seen), axis=0) for seen in map(pieces, copies) if seen]
    if not centres:
        return
    x, y = min(centres, key=lambda c: float(np.abs(c - (width / 2, height / 2)).max()))
    words = shorten(name, 220)
    half = text_width(words) / 2 + 4
    x, y = float(np.clip(x, half, width - half)), float(np.clip(y, 14, height - 14))
    write(picture, words, _free_place(taken, x, y, 2 * half, 20), centred=True)


def _free_place(
    taken: list[tuple[float, float, float, float]], x: float, y: float, width: float, height: float
) -> tuple[float, float]:
    """A place for a box centred near (x, y) px, above or below if others are there already; it is then taken."""
    for step in range(9):
        at = y + height * ((step + 1) // 2) * (1 if step % 2 else -1)
        if all(abs(x - a) > (width + w) / 2 or abs(at - b) > (height + h) / 2 - 1 for a, b, w, h in taken):
            break
    else:
        at = y
    taken.append((x, at, width, height))
    return x, at


def gains(names: Sequence[str], values: Floats) -> Picture:
    """Bars of the photos' gains (n,), to the right of a line at 1 if brightened, to the left if darkened."""
    row = int(np.clip((LONGEST - 80) // max(1, len(names)), 3, 30))
    shown = min(len(names), (LONGEST - 80) // row)
    picture = blank(shown * row + 70, 1000)
    reach = max(0.05, float(np.abs(np.nan_to_num(values) - 1).max(initial=0.0)))
    middle, length = 590, 300
    write(picture, f"gain of each photo (full width: 1 +- {reach:.2f})", (12, 24))
    for k in range(shown):
        top = 48 + k * row
        value = float(values[k])
        tip = middle + (round(length * (value - 1) / reach) if np.isfinite(value) else 0)
        cv2.rectangle(
            picture, (min(middle, tip), top + row // 8), (max(middle, tip), top + row - row // 4), colour(k), -1
        )
        if row >= 14:
            write(picture, shorten(names[k], 260, 16), (12, top + row / 2 - 1), height=16)
            write(picture, f"{value:.3f}", (920, top + row / 2 - 1), height=16)
    cv2.line(picture, (middle, 40), (middle, 48 + shown * row), WHITE, 1)
    return picture
