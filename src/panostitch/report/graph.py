"""The links between photos, drawn over their places on the canvas; on a circle where there are no places."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from panostitch.debug.diagram import turn_width
from panostitch.model.canvas import Region
from panostitch.report import lines
from panostitch.report.pairs import Pair
from panostitch.report.record import Record

Floats = NDArray[np.float64]

WIDTH = 1000.0  # units of the drawing
ROW = 120.0  # of a row of photos that have no place
COLUMNS = 9  # photos in such a row
RADIUS = 330.0
THUMBNAIL = 96.0
THICKEST, THINNEST = 9.0, 2.0
CROWD = 200.0  # of the widths of all lines together, about
BEND = 0.35  # of a line's length: how far the middle that it bends towards is aside
BOW_POINTS = 17
FLATTEST = 0.1  # height of a very wide canvas, of its width: else all links lie on each other


@dataclass(frozen=True)
class Node:
    """A photo at (x, y). `outline` is path data, empty where it has no place on the canvas and is shown in `size`."""

    number: int
    name: str
    x: float
    y: float
    size: tuple[float, float] = (0.0, 0.0)
    outline: str = ""

    @property
    def placed(self) -> bool:
        """Whether it has a place on the canvas."""
        return bool(self.outline)


@dataclass(frozen=True)
class Edge:
    """A pair of photos as path data: a bow, or two where it leaves a closed turn and comes in again."""

    pair: Pair
    path: str
    width: float


@dataclass(frozen=True)
class Graph:
    """All of it, `height` units high; `backdrop` is where the panorama lies (x, y, width, height), if anywhere."""

    height: float
    nodes: Sequence[Node]
    edges: Sequence[Edge]
    scale: float = 1.0
    backdrop: tuple[float, float, float, float] | None = None


def graph(record: Record, pairs: Sequence[Pair]) -> Graph:
    """Photos as nodes, numbered in their order, pairs as edges."""
    numbers = {name: number for number, name in enumerate(record.photos, start=1)}
    if record.laid_out is None:
        nodes = _circle(record, numbers)
        return Graph(2 * (RADIUS + THUMBNAIL), list(nodes.values()), _edges(pairs, nodes, 0.0))
    alignment, canvas = record.laid_out
    scale = WIDTH / max(canvas.size[0], canvas.size[1])
    nodes = {}
    for photo, camera in zip(alignment.photos, alignment.cameras, strict=True):
        outline, middle = lines.outline(camera, canvas)
        if middle is not None:
            x, y = (middle * scale).tolist()
            nodes[photo.name] = Node(numbers[photo.name], photo.name, x, y, outline=outline)
    height = max(FLATTEST * WIDTH, canvas.size[1] * scale)
    rest = [name for name in numbers if name not in nodes]
    for place, name in enumerate(rest):
        row, column = divmod(place, COLUMNS)
        x, y = WIDTH * (column + 0.5) / COLUMNS, height + ROW * (row + 0.5)
        nodes[name] = Node(numbers[name], name, x, y, _thumbnail(record.photos[name].size))
    below = ROW * -(-len(rest) // COLUMNS)
    shown = record.panorama.plan.crop if record.panorama and record.panorama.canvas == canvas else None
    edges = _edges(pairs, nodes, turn_width(canvas) * scale)
    return Graph(height + below, list(nodes.values()), edges, scale, _placed(shown, scale))


def _thumbnail(size: tuple[int, int]) -> tuple[float, float]:
    """A photo's size (width, height) px in units of the drawing."""
    factor = THUMBNAIL / max(size)
    return size[0] * factor, size[1] * factor


def _placed(region: Region | None, scale: float) -> tuple[float, float, float, float] | None:
    if region is None:
        return None
    return region.x * scale, region.y * scale, region.width * scale, region.height * scale


def _circle(record: Record, numbers: dict[str, int]) -> dict[str, Node]:
    turn = 2 * np.pi * np.arange(len(numbers)) / max(1, len(numbers)) - np.pi / 2
    xy = np.array([WIDTH / 2, RADIUS + THUMBNAIL]) + RADIUS * np.column_stack([np.cos(turn), np.sin(turn)])
    return {
        name: Node(number, name, x, y, _thumbnail(record.photos[name].size))
        for (name, number), (x, y) in zip(numbers.items(), xy.tolist(), strict=True)
    }


def _edges(pairs: Sequence[Pair], nodes: dict[str, Node], period: float) -> list[Edge]:
    most = max((pair.matches for pair in pairs), default=1)
    thickest = min(THICKEST, max(2 * THINNEST, CROWD / max(1, len(pairs))))

    def width(pair: Pair) -> float:
        return THINNEST + (thickest - THINNEST) * pair.matches / max(1, most) if "link" in pair.kind else THINNEST

    return [
        Edge(pair, _line(nodes[pair.photos[0]], nodes[pair.photos[1]], period), width(pair))
        for pair in sorted(pairs, key=lambda pair: (pair.kind == "link", pair.number))
        if all(name in nodes for name in pair.photos)
    ]


def _line(first: Node, second: Node, period: float) -> str:
    start, end = np.array([first.x, first.y]), np.array([second.x, second.y])
    both = first.placed and second.placed
    round_the_back = np.array([period * round((first.x - second.x) / period), 0.0]) if period and both else np.zeros(2)
    line = _bow(start, end + round_the_back)
    return lines.path([line, line - round_the_back] if round_the_back.any() else [line])


def _bow(start: Floats, end: Floats) -> Floats:
    """A curve (m, 2) that rises above the photos between two that stand in a row."""
    along = end - start if end[0] >= start[0] else start - end
    middle = (start + end) / 2 + BEND * np.array([along[1], -along[0]])
    t = np.linspace(0, 1, BOW_POINTS)[:, None]
    return np.asarray((1 - t) ** 2 * start + 2 * t * (1 - t) * middle + t**2 * end)
