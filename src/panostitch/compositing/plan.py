"""All that needs the whole picture at once, on a reduced canvas: light, seams, low bands of the blend, crop."""

from collections.abc import Sequence
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.blend import BLENDERS
from panostitch.compositing.blend.pieces import Piece, fill, hard_composite, only
from panostitch.compositing.burnt import burnt_map
from panostitch.compositing.coverage import POLES, covered_rays
from panostitch.compositing.crop import Crop, choose_crop, surely_covered
from panostitch.compositing.exposure import EXPOSURE
from panostitch.compositing.highlights import Seen, expose_all
from panostitch.compositing.seams import SEAMS, extend
from panostitch.compositing.warp import footprints, read_for, warp_and_place
from panostitch.errors import AlignmentError, UsageError
from panostitch.model.alignment import Alignment
from panostitch.model.camera import Camera
from panostitch.model.canvas import Canvas, Layer, Region
from panostitch.model.light import Light
from panostitch.model.panorama import NOBODY, Plan
from panostitch.model.photo import lens_groups
from panostitch.options import CompositingOptions
from panostitch.runtime.executor import Executor, serial
from panostitch.runtime.memory import give_back
from panostitch.runtime.trace import Trace, silent

Placed = list[tuple[int, Layer]]

PLAN_PIXELS = 0.5e6  # of the reduced canvas: seams to a few pixels; with twice as many they are no better
LARGE_PLAN = 4.5e6  # of that of a huge canvas: it takes memory, but tiles with seams need narrower halos
LARGE_FROM = 16  # times smaller
MAX_FACTOR = 64


def reduction(canvas: Canvas) -> int:
    """The power of two by which the canvas is reduced for the plan."""
    factor = 1
    area = canvas.size[0] * canvas.size[1]
    while area / factor**2 > (PLAN_PIXELS if factor < LARGE_FROM else LARGE_PLAN) and factor < MAX_FACTOR:
        factor *= 2
    return factor


def make_plan(
    alignment: Alignment,
    canvas: Canvas,
    options: CompositingOptions,
    crop: str | Crop,
    *,
    run: Executor = serial,
    trace: Trace = silent,
) -> Plan:
    """The plan of a panorama, cropped by a rule or to a region of the canvas.

    Raises AlignmentError where no photo falls on the canvas, UsageError where none falls into the region.
    """
    factor = reduction(canvas)
    small = canvas.reduced(factor)
    light, exposed, unexposed = _lit(alignment, small, options, run, trace)
    give_back()  # of a huge canvas each step takes hundreds of MB
    labels = SEAMS[options.seams](small, exposed)
    give_back()
    covered = labels != NOBODY
    extended = extend(labels)
    owned = [_piece(n, layer, extended, small.region) for n, layer in exposed]
    composite = _filled(owned, covered.shape)
    blended = BLENDERS[options.blender].blend_reduced(owned, extended, composite, small, factor, options.bands)
    picture = composite if blended is None else blended
    sure = covered if factor == 1 else _surely_covered(covered, alignment.cameras, small)
    kept, reason = crop if isinstance(crop, Crop) else at_full_size(choose_crop(covered, crop, sure), canvas, factor)
    cells = kept.grown(0, multiple=factor).divided(factor)
    if not covered[cells.within(small.region)].any():
        raise UsageError("no photo shows anything of what was asked for", hint="look at the whole with --crop none")
    if trace is not silent:  # pictures that nobody else needs
        before = _filled([_piece(n, layer, extended, small.region) for n, layer in unexposed], covered.shape)
        trace("compositing.exposed", photos=alignment.photos, light=light, before=before, after=composite)
        trace("compositing.seamed", labels=labels, picture=composite, names=[p.name for p in alignment.photos])
        _trace_bands(picture, trace)
    trace("compositing.cropped", picture=picture, coverage=covered, crop=cells, reason=reason)
    changes = _changes(len(alignment.photos), exposed, blended, small)
    return Plan(light, factor, extended, changes, kept, reason, covered=bool(sure[cells.within(small.region)].all()))


def _lit(
    alignment: Alignment, small: Canvas, options: CompositingOptions, run: Executor, trace: Trace
) -> tuple[Light, Placed, Placed]:
    """The light, and the photos on the reduced canvas in it; and as they were, if somebody wants to see that.

    Raises AlignmentError where no photo falls on the canvas.
    """
    pieces, views = _warp_all(alignment, small, run, trace)
    if not pieces:
        raise AlignmentError("no photo falls on the canvas", hint="try another --projection")
    lenses, squares = lens_groups(alignment.photos), lambda n, region: views[n].square(region)
    light, exposed = expose_all(EXPOSURE[options.exposure](lenses, pieces, squares), pieces, views)
    return light, exposed, [] if trace is silent else pieces


def coverage(alignment: Alignment, canvas: Canvas, *, run: Executor = serial) -> NDArray[np.bool_]:
    """Which pixels (h, w) of a canvas, reduced already, photos cover."""
    covered = np.zeros(canvas.size[::-1], bool)
    for _, layer in _warp_all(alignment, canvas, run, silent)[0]:
        covered[layer.region.within(canvas.region)] |= layer.mask
    return covered


def at_full_size(crop: Crop, canvas: Canvas, factor: int) -> Crop:
    """A crop of the reduced canvas on the canvas itself."""
    return crop._replace(region=crop.region.times(factor) & canvas.region)


def _surely_covered(covered: NDArray[np.bool_], cameras: Sequence[Camera], small: Canvas) -> NDArray[np.bool_]:
    """Pixels of the mask of a reduced canvas that photos cover in full."""
    framed = np.pad(np.pad(covered, ((1, 1), (0, 0))), ((0, 0), (1, 1)), mode="wrap" if small.wraps else "constant")
    # beyond the edge there is no mask; a canvas that shows a part of the view goes on there, others end with the photos
    ring = np.ones(framed.shape, bool)
    ring[1:-1, 0 if small.wraps else 1 : None if small.wraps else -1] = False
    y, x = np.nonzero(ring)
    rays = small.rays(np.column_stack([x - 1.0, y - 1.0]))
    # beyond a pole there is nothing; for what lies before it, the pole itself counts
    zenith, nadir = covered_rays(cameras, POLES)
    at_ends = np.where(y == 0, zenith, np.where(y == len(framed) - 1, nadir, zenith and nadir))
    framed[y, x] = np.where(np.isnan(rays).any(1), at_ends, covered_rays(cameras, rays))
    return surely_covered(framed)[1:-1, 1:-1]


def _warp_all(alignment: Alignment, small: Canvas, run: Executor, trace: Trace) -> tuple[Placed, list[Seen]]:
    """All photos on the reduced canvas, as (photo, layer): one may be in two pieces, or none; and what they see."""
    numbers = list(range(len(alignment.photos)))
    work = partial(_warp_one, alignment, small, footprints(alignment.cameras, small))
    placed: Placed = []
    views = []
    for n, (layers, seen) in zip(numbers, run.map(work, numbers, label="Planning"), strict=True):
        trace("compositing.warped", index=n, photo=alignment.photos[n], layers=layers, canvas=small)
        placed += [(n, layer) for layer in layers if layer.mask.any()]
        views.append(seen)
    return placed, views


def _warp_one(
    alignment: Alignment, small: Canvas, places: Sequence[tuple[Region, ...]], n: int
) -> tuple[list[Layer], Seen]:
    """The pieces of a photo, and where they see it."""
    raster, camera = read_for(alignment.photos[n], alignment.cameras[n], small)
    found = [warp_and_place(raster, camera, small, region, interpolation=cv2.INTER_LINEAR) for region in places[n]]
    shown = tuple((layer.region, xy) for layer, xy in found)
    return [layer for layer, _ in found], Seen(camera.size, burnt_map(raster[0]), shown)


def _piece(photo: int, layer: Layer, labels: NDArray[np.int16], whole: Region) -> Piece:
    place = layer.region.within(whole)
    return Piece(photo, place, layer.pixels, layer.mask, labels[place] == photo)


def _filled(pieces: Sequence[Piece], shape: tuple[int, int]) -> NDArray[np.float32]:
    """The hard composite (h, w, 3), uncovered pixels filled smoothly."""
    return fill(*hard_composite(pieces, shape))


def _changes(
    count: int, exposed: Placed, blended: NDArray[np.float32] | None, small: Canvas
) -> tuple[tuple[tuple[Region, NDArray[np.float32]], ...], ...]:
    """For each photo what blending on the reduced canvas changes in it, where it may show."""
    if blended is None:
        return ((),) * count
    changes: list[list[tuple[Region, NDArray[np.float32]]]] = [[] for _ in range(count)]
    for n, layer in exposed:
        change = blended[layer.region.within(small.region)] - layer.pixels
        # beyond the photo's edge there is nothing to compare: what the edge has goes on
        changes[n].append((layer.region, fill(only(change, layer.mask), layer.mask)))
    return tuple(map(tuple, changes))


def _trace_bands(picture: NDArray[np.float32], trace: Trace, levels: int = 5) -> None:
    """Show the bands of the blended picture, fine to coarse, then the low-pass."""
    for level in range(levels):
        smaller = cv2.pyrDown(picture)
        band = picture - cv2.pyrUp(smaller, dstsize=picture.shape[1::-1])
        trace("compositing.band", level=level, levels=levels, pixels=band, lowpass=False)
        picture = np.asarray(smaller, np.float32)
    trace("compositing.band", level=levels, levels=levels, pixels=picture, lowpass=True)
