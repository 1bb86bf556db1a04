"""Pictures of what the stages did, drawn on photos and panoramas: arrays in, (h, w, 3) uint8 RGB arrays out.

Coordinates are px of the pictures given; they say nothing about the disk or about events.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.debug.ink import (
    BLACK,
    LONGEST,
    SKY,
    WHITE,
    YELLOW,
    Colour,
    Picture,
    along,
    blank,
    circle,
    colour,
    fit,
    path,
    resized,
    to_bytes,
    write,
)
from panostitch.geometry.sampling import rescale
from panostitch.model.canvas import Layer, Region
from panostitch.model.mesh import Mesh
from panostitch.model.photo import grey_of
from panostitch.model.score import Places

Floats = NDArray[np.float64]

MOST_CIRCLES = 300  # more hide the photo
MOST_LINES = 150  # more become a carpet
GAP = 8  # px between the two photos of a pair
BAND_PEAK = 110.0  # grey levels from the middle that the strong edges of a band are stretched to
MOST_BENT = 0.8  # of a cell: lines of a mesh that are drawn further apart are hard to follow
MESH_POINTS = 100  # along each line
WELL, BADLY = 0.0, 3.0  # faults at the ends of the colours
PLACE = 6.0  # px of the canvas, radius of a place
FAINT = 0.7  # of its brightness that is left of the panorama under them
SMALL = 800  # px; coarse bands are enlarged to about this
_NOBODY_COLOUR: Colour = (24, 24, 26)


@dataclass(frozen=True)
class Lines:
    """Lines from points (n, 2) of the left picture to points (n, 2) of the right one; `ink` None colours by place."""

    left: Floats
    right: Floats
    ink: Colour | None = None


def features(photo: Picture, xy: Floats, scale: Floats, angle: Floats, response: Floats) -> Picture:
    """A photo with its key points: all as dots, the strongest as circles of their scale with their direction.

    xy (n, 2) px, scale (n,) px, angle (n,) radians, response (n,).
    """
    picture = dots(_dimmed(photo, 0.8), xy)
    for k in np.argsort(-response, kind="stable")[:MOST_CIRCLES]:
        radius = max(3.0, float(scale[k]))
        tip = xy[k] + radius * np.array([np.cos(angle[k]), np.sin(angle[k])])
        for ink, thickness in ((BLACK, 3), (YELLOW, 1)):
            circle(picture, xy[k], radius, ink, thickness)
            path(picture, np.array([xy[k], tip]), ink, thickness)
    return picture


def dots(photo: Picture, xy: Floats) -> Picture:
    """A photo with a dot at each of the points xy (n, 2) px."""
    picture = photo.copy()
    for point in xy:
        circle(picture, point, 2.2, BLACK, -1)
        circle(picture, point, 1.5, SKY, -1)
    return picture


def matches(left: Picture, right: Picture, groups: Sequence[Lines], *, overlap: Floats | None = None) -> Picture:
    """Two photos side by side with lines between matching points; later groups lie on top.

    overlap: outline (m, 2) px of the left photo in the right one.
    """
    height, width = max(left.shape[0], right.shape[0]), left.shape[1] + GAP + right.shape[1]
    picture = blank(height, width)
    picture[: left.shape[0], : left.shape[1]] = _dimmed(left, 0.75)
    beside = picture[: right.shape[0], left.shape[1] + GAP :]
    beside[:] = _dimmed(right, 0.75)
    if overlap is not None and np.isfinite(overlap).all() and np.abs(overlap).max() < 20 * LONGEST:
        for ink, thickness in ((BLACK, 4), (WHITE, 2)):
            # drawn into the right photo alone, which cuts it off at its edges
            path(beside, overlap, ink, thickness, closed=True)
    for lines in groups:
        _connect(picture, lines, shift=left.shape[1] + GAP, reach=left.shape[0])
    return picture


def _connect(picture: Picture, lines: Lines, *, shift: int, reach: int) -> None:
    sound = np.isfinite(lines.left).all(axis=1) & np.isfinite(lines.right).all(axis=1)
    starts, ends = lines.left[sound], lines.right[sound] + (shift, 0)
    # evenly spread over the list, always the same ones
    chosen = np.unique(np.linspace(0, len(starts) - 1, min(MOST_LINES, len(starts))).astype(int))
    for start, end in zip(starts[chosen], ends[chosen], strict=True):
        ink = lines.ink or along(float(start[1]) / max(1, reach))
        path(picture, np.array([start, end]), ink)
    for start, end in zip(starts[chosen], ends[chosen], strict=True):
        ink = lines.ink or along(float(start[1]) / max(1, reach))
        for point in (start, end):
            circle(picture, point, 3.5, BLACK, -1)
            circle(picture, point, 2.5, ink, -1)


def on_canvas(layers: Sequence[Layer], size: tuple[int, int]) -> Picture:
    """The pieces of a warped photo in their places on the canvas of this size (width, height) px."""
    whole = Region(0, 0, *size)
    picture = blank(size[1], size[0])
    for layer in layers:
        seen = layer.region & whole
        if seen:
            mask = layer.mask[seen.within(layer.region)]
            picture[seen.within(whole)][mask] = to_bytes(layer.pixels[seen.within(layer.region)][mask])
    return to_bytes(fit(picture))


def seams(labels: NDArray[np.int16], pixels: NDArray[Any]) -> Picture:
    """A panorama (h, w, 3) with lines where one photo (label >= 0) ends and another begins."""
    picture = to_bytes(fit(to_bytes(pixels))).copy()
    core = boundary(resized(labels, picture.shape[1], picture.shape[0], exact=True))
    rim = cv2.dilate(core.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    picture[rim] = BLACK
    picture[core] = YELLOW
    return picture


def faults(panorama: Picture, places: Places, shown: Region) -> Picture:
    """A panorama (h, w, 3) of this region of the canvas, grey, and what is wrong in colour, from blue to yellow."""
    grey = grey_of(to_bytes(fit(panorama)))
    picture = _dimmed(np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2RGB), np.uint8), FAINT)
    scale = picture.shape[1] / shown.width
    known = np.isfinite(places.fault)
    xy = rescale(places.xy[known] - [shown.x, shown.y], scale)
    fault = places.fault[known]
    radius = max(2.0, PLACE * scale)
    for n in np.argsort(fault, kind="stable"):  # the worst on top
        circle(picture, xy[n], radius, along(float(np.clip((fault[n] - WELL) / (BADLY - WELL), 0, 1))), thickness=-1)
    return picture


def boundary(labels: NDArray[Any]) -> NDArray[np.bool_]:
    """Pixels (h, w) beside which another photo begins; the edge of what is covered is no seam."""
    found = np.zeros(labels.shape, np.bool_)
    for one, other, marks, beyond in (
        (labels[:, :-1], labels[:, 1:], found[:, :-1], found[:, 1:]),
        (labels[:-1], labels[1:], found[:-1], found[1:]),
    ):
        differ = (one != other) & (one >= 0) & (other >= 0)
        marks |= differ
        beyond |= differ
    return found


def label_map(labels: NDArray[np.int16], names: Sequence[str]) -> Picture:
    """Which photo owns each pixel: a colour for each label with its name in the middle of its area."""
    small = np.asarray(fit(labels, exact=True))
    table = np.array([colour(k) for k in range(max(int(small.max(initial=0)) + 1, len(names)))] + [_NOBODY_COLOUR])
    picture = to_bytes(table[small])  # -1, nobody, is the last row
    picture[boundary(small)] = BLACK
    for label in np.unique(small[small >= 0]):
        name = names[label] if label < len(names) else str(label)
        write(picture, name, _middle(small == label), centred=True)
    return picture


def _middle(mask: NDArray[np.bool_]) -> tuple[float, float]:
    """A point (x, y) px of a mask as far from its edge as any, and among those the most central one."""
    small = fit(mask.astype(np.uint8), 400, exact=True)
    distance = cv2.distanceTransform(np.pad(small, 1).astype(np.uint8), cv2.DIST_L2, 3)
    inner = np.argwhere(distance >= 0.95 * distance.max())
    y, x = inner[np.argmin(np.abs(inner - inner.mean(axis=0)).sum(axis=1))]
    factor = mask.shape[1] / small.shape[1]
    return (float(x) - 0.5) * factor, (float(y) - 0.5) * factor


def band(pixels: NDArray[np.float32]) -> tuple[Picture, float]:
    """A Laplacian band (h, w, 3), centred on 0, about mid grey; and how much it was strengthened to be seen."""
    numbers = np.nan_to_num(np.asarray(pixels, np.float32))
    strong = float(np.percentile(np.abs(numbers), 99.5)) if numbers.size else 0.0
    gain = BAND_PEAK / strong if strong > 1e-6 else 1.0
    return enlarged(to_bytes(fit(128 + gain * numbers))), gain


def mesh(photo: Picture, bends: Mesh) -> tuple[Picture, float]:
    """The photo with the lines of a mesh, bent as it bends them but so many times as much."""
    picture = _dimmed(photo, 0.5)
    size = np.array(picture.shape[1::-1])
    columns, rows = bends.cells
    step = min(size / (columns, rows))
    scaled = bends.scaled((int(size[0]), int(size[1])))
    times = float(np.clip(round(MOST_BENT * step / max(scaled.largest, 1e-9)), 1, 20))
    ends = size - 0.5
    for place in np.linspace(-0.5, ends[0], columns + 1):
        line = np.column_stack([np.full(MESH_POINTS, place), np.linspace(-0.5, ends[1], MESH_POINTS)])
        path(picture, line + times * scaled.displacement(line), SKY)
    for place in np.linspace(-0.5, ends[1], rows + 1):
        line = np.column_stack([np.linspace(-0.5, ends[0], MESH_POINTS), np.full(MESH_POINTS, place)])
        path(picture, line + times * scaled.displacement(line), SKY)
    return picture, times


def enlarged(picture: Picture) -> Picture:
    """A small picture with each pixel as a block, so that it can be looked at."""
    height, width = picture.shape[:2]
    factor = max(1, SMALL // max(height, width))
    return to_bytes(resized(picture, width * factor, height * factor, exact=True))


def crop(pixels: NDArray[Any], coverage: NDArray[np.bool_], region: Region) -> Picture:
    """The panorama with the rectangle that is written; cut-off parts dark, empty parts as a chequerboard."""
    bright = to_bytes(pixels)
    picture = _dimmed(bright, 0.35)
    inside = (region & Region.of(bright)).within(Region(0, 0, 0, 0))
    picture[inside] = bright[inside]
    picture = to_bytes(fit(picture)).copy()
    height, width = picture.shape[:2]
    empty = np.asarray(resized(coverage.astype(np.uint8), width, height, exact=True)) == 0
    y, x = np.mgrid[:height, :width] // 12
    picture[empty] = np.where((x + y) % 2 == 0, 70, 100).astype(np.uint8)[empty][:, None]
    factor = width / bright.shape[1]
    corners = np.array([(region.x, region.y), (region.right, region.y), (region.right, region.bottom),
                        (region.x, region.bottom)]) * factor - 0.5  # fmt: skip
    corners = np.clip(corners, 1, (width - 2, height - 2))
    for ink, thickness in ((BLACK, 5), (YELLOW, 2)):
        path(picture, corners, ink, thickness, closed=True)
    return picture


def _dimmed(picture: Picture, share: float) -> Picture:
    return np.asarray(picture * np.float32(share), np.uint8)
