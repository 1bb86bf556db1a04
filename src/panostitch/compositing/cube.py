"""The six faces of a cube in a row: rectilinear views that are planned once, on a sphere, and so fit together.

Faces that touch in the row may not touch in the world, and the other way round. So light, seams and low bands of the
blend are made on the sphere; each face takes over what it shows of them, and goes on beyond its edges for the halo of
its fine bands.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.compose import Work, compose, together
from panostitch.compositing.cost import photo_budget, shown_bytes, tile_bytes
from panostitch.compositing.crop import Crop
from panostitch.compositing.frame import window
from panostitch.compositing.layout import cannot_be_flat, check_size, lay_out
from panostitch.compositing.plan import make_plan
from panostitch.compositing.warp import decoded_photos, footprints
from panostitch.errors import UsageError
from panostitch.geometry.projections.cube import FACES, FRONT
from panostitch.model.alignment import Alignment
from panostitch.model.camera import Camera
from panostitch.model.canvas import Canvas, Layer, Region
from panostitch.model.panorama import Panorama, Plan
from panostitch.options import CompositingOptions, LayoutOptions
from panostitch.runtime.executor import Executor, serial
from panostitch.runtime.memory import give_back
from panostitch.runtime.trace import Trace, silent

Floats = NDArray[np.float64]
Change = tuple[tuple[Region, NDArray[np.float32]], ...]  # of one photo, as in a plan

SIDE_MULTIPLE = 16  # px; so that no block of a JPEG lies on two faces
PIXEL = 13  # bytes of a pixel of a layer and its mask
MARGIN = 8  # px of the reduced canvas by which a face goes on: more than the halo of a tile and what seams look at


@dataclass(frozen=True)
class Face:
    """One face.

    shown:  its place in the row
    work:   on a canvas of its own, which is larger by a margin
    margin: px
    """

    shown: Region
    work: Work
    margin: int

    def own(self, part: Region) -> Region:
        """A part of its place in the row, on its own canvas."""
        return replace(part, x=part.x - self.shown.x + self.margin, y=part.y - self.shown.y + self.margin)


def make_cube(
    alignment: Alignment,
    layout: LayoutOptions,
    options: CompositingOptions,
    *,
    memory: int | None = None,
    run: Executor = serial,
    trace: Trace = silent,
) -> Panorama:
    """The panorama of six faces; `memory` is what the whole program may take, in bytes.

    Raises UsageError for a flat subject and for a rectangle that is not on the row, what `lay_out` raises for the size,
    and what `make_plan` raises.
    """
    row, sphere = lay_out_cube(alignment, layout, trace=trace)
    crop = window(row, layout) if layout.window else Crop(row.region, "all faces")
    plan = make_plan(alignment, sphere, options, "none", run=run, trace=trace)
    give_back()
    budget = photo_budget(alignment.photos, memory)
    planned = sphere.reduced(plan.factor)
    faces = _faces(Work(alignment, row, plan, options, decoded_photos(budget)), planned)
    labels = _labels(plan, planned, row.reduced(plan.factor))
    shown = partial(_photos, faces)
    of_row = replace(plan, labels=labels, changes=(), crop=crop.region, crop_reason=crop.reason)
    return Panorama(
        row,
        of_row,
        partial(_read, faces),
        shown,
        faces[0].work.decoded.forget,
        partial(_cost, faces),
        partial(shown_bytes, alignment.photos, shown),
        budget,
        alignment,
    )


def lay_out_cube(alignment: Alignment, layout: LayoutOptions, *, trace: Trace = silent) -> tuple[Canvas, Canvas]:
    """The row of faces, and the sphere on which it is planned, both of the photos' own resolution straight ahead."""
    if alignment.model != "rotation":
        raise cannot_be_flat(layout.projection)
    whole = replace(layout, projection="equirectangular", fov="360x180", size=None, crop="none")
    scale = lay_out(alignment, whole).scale
    side = _side(layout) or max(1, round(2 * scale / SIDE_MULTIPLE)) * SIDE_MULTIPLE
    middle = (side - 1) / 2
    row = Canvas(
        "cube",
        side / 2,
        (-middle - FRONT * side, -middle),
        (len(FACES) * side, side),
        reason=f"as asked: {', '.join(FACES)}",
    )
    check_size(alignment, row, whole)
    return row, lay_out(alignment, replace(whole, scale=layout.scale * row.scale / scale), trace=trace)


def _side(layout: LayoutOptions) -> int | None:
    """Px of the side of a face for the size that was asked for, if one was."""
    if layout.sides is None:
        return None
    width, height = layout.sides
    side = min(n for n in (width and width // len(FACES), height) if n is not None)
    if side < 1:
        raise UsageError(f"--size {layout.size}: too small for {len(FACES)} faces")
    return side


def _faces(whole: Work, sphere: Canvas) -> list[Face]:
    """The faces of a row whose plan is that of a sphere, reduced already."""
    row, plan = whole.canvas, whole.plan
    side, margin = row.size[1], MARGIN * plan.factor
    canvases = [
        replace(
            row,
            origin=(row.origin[0] + n * side - margin, row.origin[1] - margin),
            size=(side + 2 * margin, side + 2 * margin),
            parameters=(float(n),),
        )
        for n in range(len(FACES))
    ]
    smalls = [canvas.reduced(plan.factor) for canvas in canvases]
    plans = [
        replace(plan, labels=_labels(plan, sphere, small), changes=changes)
        for small, changes in zip(smalls, _changes(plan, sphere, smalls, whole.alignment.cameras), strict=True)
    ]
    return [
        Face(Region(n * side, 0, side, side), replace(whole, canvas=canvas, plan=own), margin)
        for n, (canvas, own) in enumerate(zip(canvases, plans, strict=True))
    ]


def _on_sphere(sphere: Canvas, small: Canvas, region: Region) -> Floats:
    """Where (h, w, 2) on the sphere a region of another canvas lies, both reduced."""
    x, y = np.meshgrid(np.arange(region.x, region.right, dtype=float), np.arange(region.y, region.bottom, dtype=float))
    rays = small.rays(np.column_stack([x.ravel(), y.ravel()]))
    # where the canvas shows nothing, anything will do
    return np.asarray(np.nan_to_num(sphere.pixels(rays)).reshape(region.height, region.width, 2))


def _labels(plan: Plan, sphere: Canvas, small: Canvas) -> NDArray[np.int16]:
    """The labels of the sphere on another reduced canvas: those of the nearest pixels."""
    height, width = plan.labels.shape
    x, y = np.moveaxis(np.rint(_on_sphere(sphere, small, small.region)).astype(int), 2, 0)
    return np.asarray(plan.labels[y.clip(0, height - 1), x % width], np.int16)


def _changes(
    plan: Plan, sphere: Canvas, smalls: Sequence[Canvas], cameras: Sequence[Camera]
) -> list[tuple[Change, ...]]:
    """For each reduced canvas and each photo what the low bands change in it, as on the sphere."""
    places = zip(*(footprints(cameras, small) for small in smalls), strict=True)
    of_photos = [
        _moved(pieces, sphere, list(zip(smalls, where, strict=True)))
        for pieces, where in zip(plan.changes, places, strict=True)
    ]
    return list(zip(*of_photos, strict=True))


def _moved(pieces: Change, sphere: Canvas, places: Sequence[tuple[Canvas, tuple[Region, ...]]]) -> list[Change]:
    """The change of one photo on other reduced canvases, at its places there; bilinear."""
    if not pieces:
        return [()] * len(places)
    whole = _around(pieces, sphere)

    def sampled(small: Canvas, region: Region) -> NDArray[np.float32]:
        x, y = np.moveaxis(_on_sphere(sphere, small, region).astype(np.float32) + 1, 2, 0)
        return np.asarray(cv2.remap(whole, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)

    return [tuple((region, sampled(small, region)) for region in regions) for small, regions in places]


def _around(pieces: Change, sphere: Canvas) -> NDArray[np.float32]:
    """The change of a photo on the whole sphere (h + 2, w + 2, 3), whose columns go on round the back."""
    whole = np.zeros((*sphere.size[::-1], 3), np.float32)
    for region, change in pieces:
        whole[region.within(sphere.region)] = change
    return np.pad(np.pad(whole, ((1, 1), (0, 0), (0, 0)), mode="edge"), ((0, 0), (1, 1), (0, 0)), mode="wrap")


def _parts(faces: Sequence[Face], region: Region) -> list[tuple[Face, Region]]:
    """The faces on which a region of the row lies, and what of it."""
    return [(face, region & face.shown) for face in faces if region & face.shown]


def _read(faces: Sequence[Face], region: Region) -> Layer:
    """The pixels of a region of the row."""
    parts = _parts(faces, region)
    return together(region, [replace(compose(face.work, face.own(part)), region=part) for face, part in parts])


def _photos(faces: Sequence[Face], region: Region) -> frozenset[int]:
    """The numbers of the photos that a region of the row is made of."""
    return frozenset().union(*(face.work.photos(face.own(part)) for face, part in _parts(faces, region)))


def _cost(faces: Sequence[Face], region: Region) -> int:
    """Bytes that `_read` takes while it works: faces come one after the other."""
    return region.area * PIXEL + max(tile_bytes(face.work, face.own(part)) for face, part in _parts(faces, region))
