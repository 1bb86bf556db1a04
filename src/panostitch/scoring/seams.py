"""The judge of our own panorama, seam by seam: all photos' layers are at hand, and only the seams are looked at.

Places that hold a control point which the cameras were fitted to say nothing of the displacement: it has been made
small there.
"""

from dataclasses import replace
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.compose import lit
from panostitch.compositing.warp import Decoded, blocks, decoded_photos, read_for
from panostitch.model.alignment import Alignment
from panostitch.model.canvas import Canvas, Layer, Region
from panostitch.model.panorama import NOBODY, Panorama
from panostitch.model.score import Places, SeamScore
from panostitch.options import CompositingOptions
from panostitch.runtime.executor import Executor, serial
from panostitch.runtime.trace import Trace, silent
from panostitch.scoring.patches import HALF
from panostitch.scoring.places import MARGIN, STEP, judge_tile
from panostitch.scoring.summary import joined, summary

Floats = NDArray[np.float64]
Pair = tuple[int, int]

TILE = 40 * STEP  # px
NEAR = 2 * STEP  # px from the seam within which a place is on it


def score_seams(
    panorama: Panorama, options: CompositingOptions, *, run: Executor = serial, trace: Trace = silent
) -> list[SeamScore]:
    """The score of each seam in the crop of a panorama, in the order of its photos.

    Made tile by tile along the seams; only a few tiles are in memory at once. Raises InputError where a photo cannot be
    read any more.
    """
    alignment = panorama.alignment
    assert alignment, "a panorama of photos that nobody knows"
    tiles = [tile for tile in panorama.plan.crop.tiles(TILE) if len(_labels_near(panorama, tile)) > 1]
    decoded = decoded_photos(panorama.kept(tiles))
    fitted = _fitted_points(alignment, panorama.canvas)
    work = partial(_judge, panorama, options, decoded, fitted)
    parts: dict[Pair, list[Places]] = {}
    lengths: dict[Pair, float] = {}
    for found in run.map(work, tiles, label="Judging seams"):
        for pair, along, length in found:
            parts.setdefault(pair, []).append(along)
            lengths[pair] = lengths.get(pair, 0.0) + length
    places = {pair: joined(parts[pair]) for pair in sorted(parts)}
    names = [photo.name for photo in alignment.photos]
    seams = [SeamScore(names[i], names[j], lengths[i, j], summary(found)) for (i, j), found in places.items()]
    if trace is not silent:
        trace("scoring.judged", seams=seams, places=joined(list(places.values())), crop=panorama.plan.crop)
    return seams


def _labels_near(panorama: Panorama, tile: Region) -> list[int]:
    """The photos that own something in or about a tile."""
    labels, _ = _labels(panorama, tile)
    return [int(n) for n in np.unique(labels) if n != NOBODY]


def _labels(panorama: Panorama, tile: Region) -> tuple[NDArray[np.int16], Region]:
    """The plan's labels in and about a tile, and what of the canvas they cover."""
    factor = panorama.plan.factor
    whole = Region.of(panorama.plan.labels)
    small = tile.grown(NEAR, multiple=factor).divided(factor) & whole
    return panorama.plan.labels[small.within(whole)], small.times(factor)


def _judge(
    panorama: Panorama, options: CompositingOptions, decoded: Decoded, fitted: Floats, tile: Region
) -> list[tuple[Pair, Places, float]]:
    """For each pair of photos with a seam in a tile: the places on it, and its length px there."""
    alignment = panorama.alignment
    assert alignment
    region = tile.grown(MARGIN)
    seams = _seams_in(panorama, tile)
    if not seams:
        return []
    seen = partial(_seen, alignment, panorama, options, decoded, region)
    layers = [layer for n in sorted({n for pair in seams for n in pair}) if (layer := seen(n))]
    if not layers:  # labels go on beyond the photos
        return []
    picture = panorama.read(region)
    pixels = np.clip(np.rint(picture.pixels), 0, 255)
    places = judge_tile(Layer(region, pixels, picture.mask), layers, _about(region, seams))
    places = _unknown_where_fitted(places, fitted)
    return [(pair, places.take(_near(places.xy, points)), length) for pair, (points, length) in seams.items()]


def _seen(
    alignment: Alignment, panorama: Panorama, options: CompositingOptions, decoded: Decoded, region: Region, photo: int
) -> Layer | None:
    """A photo as it lies in a region of the canvas, in the panorama's light; None where it shows nothing of it."""
    canvas, own = panorama.canvas, alignment.cameras[photo]
    grid = blocks(own, canvas, region)
    if grid.misses:
        return None
    raster, camera = decoded.get(photo, partial(read_for, alignment.photos[photo], own, canvas))
    if camera.size != own.size:
        grid = blocks(camera, canvas, region)
    return lit(raster, grid, panorama.plan.light, photo, options)


def _seams_in(panorama: Panorama, tile: Region) -> dict[Pair, tuple[Floats, float]]:
    """For each pair of photos, points (n, 2) px on their seam in and about a tile, and how long it is in the tile."""
    labels, place = _labels(panorama, tile)
    factor = panorama.plan.factor
    found: dict[Pair, list[Floats]] = {}
    for down, right in ((0, 1), (1, 0)):
        one, other = labels[: labels.shape[0] - down, : labels.shape[1] - right], labels[down:, right:]
        rows, columns = np.nonzero((one != other) & (one != NOBODY) & (other != NOBODY))
        # the border between two px of the labels
        x, y = ((v + 0.5 + half / 2) * factor - 0.5 for v, half in ((columns, right), (rows, down)))
        points = np.column_stack([x + place.x, y + place.y])
        pairs = np.sort(np.column_stack([one[rows, columns], other[rows, columns]]), axis=1)
        for pair in np.unique(pairs, axis=0):
            found.setdefault((int(pair[0]), int(pair[1])), []).append(points[(pairs == pair).all(1)])
    return {
        pair: (points, _length(points, tile, factor)) for pair, parts in found.items() for points in [np.vstack(parts)]
    }


def _length(points: Floats, tile: Region, factor: int) -> float:
    """Length px of the seam through these borders of px, in a tile: a slanted one has more borders than it is long."""
    inside = points[(points >= [tile.x, tile.y]).all(1) & (points < [tile.right, tile.bottom]).all(1)]
    return float(len(inside) * factor * np.pi / 4)


def _about(region: Region, seams: dict[Pair, tuple[Floats, float]]) -> NDArray[np.bool_]:
    """Which pixels (h, w) of a region are at most NEAR from a seam."""
    away = np.ones((region.height, region.width), np.uint8)
    for points, _ in seams.values():
        x, y = np.rint(points - [region.x, region.y]).astype(int).T
        inside = (x >= 0) & (y >= 0) & (x < region.width) & (y < region.height)
        away[y[inside], x[inside]] = 0
    return np.asarray(cv2.distanceTransform(away, cv2.DIST_C, cv2.DIST_MASK_3) <= NEAR)


def _near(xy: Floats, points: Floats) -> NDArray[np.bool_]:
    """Which places (n, 2) are at most NEAR from one of the points (m, 2)."""
    if not len(xy):
        return np.zeros(0, bool)
    return np.asarray((np.abs(xy[:, None] - points[None]).max(-1) <= NEAR).any(1))


def _fitted_points(alignment: Alignment, canvas: Canvas) -> Floats:
    """Where (n, 2) px of the canvas the control points are."""
    rays = [alignment.cameras[points.i].rays(points.xy_i) for points in alignment.control_points]
    return canvas.pixels(np.vstack(rays)) if rays else np.zeros((0, 2))


def _unknown_where_fitted(places: Places, fitted: Floats) -> Places:
    """The places, of which those that hold a control point know no displacement."""
    if not len(places) or not len(fitted):
        return places
    holds = (np.abs(places.xy[:, None] - fitted[None]).max(-1) <= HALF).any(1)
    return replace(places, displacement=np.where(holds, np.nan, places.displacement))
