"""The canvas: projection, scale and size, so that every photo is on it at its own resolution."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.choice import PLANET_EDGE, Choice, choose_projection
from panostitch.compositing.coverage import HAIR
from panostitch.compositing.field import View, half_extent, view_of
from panostitch.errors import AlignmentError, LimitError, UsageError
from panostitch.geometry.projections import PROJECTIONS
from panostitch.model.alignment import Alignment
from panostitch.model.camera import Camera
from panostitch.model.canvas import Canvas
from panostitch.options import LayoutOptions
from panostitch.runtime.trace import Trace, silent

Floats = NDArray[np.float64]

CLOSED_GAP = np.deg2rad(1.0)  # a turn with a smaller hole than this is closed
EDGE_MULTIPLE = 64  # a closed canvas is wide a multiple of this, so that reductions of it close as well
ABSURD = 40.0  # times the photos' own pixels: no sound alignment spreads them so thin
STRETCHED = 4.0  # times its own pixels that a photo is spread over, from which on it is to blame
MAX_PIXELS = 10_000_000_000


def lay_out(alignment: Alignment, options: LayoutOptions, *, trace: Trace = silent) -> Canvas:
    """The canvas of an alignment.

    Raises UsageError where the projection cannot show the view, AlignmentError for an absurd size, LimitError for one
    that is too large.
    """
    canvas = (_plane if alignment.model != "rotation" else _sphere)(alignment.cameras, options)
    check_size(alignment, canvas, options)
    trace("layout.chosen", alignment=alignment, canvas=canvas, reason=canvas.reason)
    return canvas


def _plane(cameras: Sequence[Camera], options: LayoutOptions) -> Canvas:
    """The plane of a flat subject, seen straight on from the photo that defines it."""
    if options.projection not in ("auto", "rectilinear"):
        raise cannot_be_flat(options.projection)
    if options.field:
        raise UsageError(
            "--fov: a flat subject has no field of view",
            hint="--size says how large the picture is, --crop X,Y,W,H which part of it",
        )
    outlines = np.vstack([camera.rays(camera.outline()) for camera in cameras])
    if (outlines[:, 2] <= 0).any():
        raise AlignmentError(
            "a photo reaches beyond the horizon of the plane", hint="try --model rotation, or fewer photos"
        )
    choice = Choice("rectilinear", (), "flat subject")
    return _canvas(choice, options.scale, PROJECTIONS["rectilinear"].forward(outlines))


def cannot_be_flat(projection: str) -> UsageError:
    """The error that says that a projection shows views all around, and no flat subject."""
    return UsageError(
        f"--projection {projection} cannot show a flat subject",
        hint="leave it out, or force the other model with --model rotation",
    )


def _sphere(cameras: Sequence[Camera], options: LayoutOptions) -> Canvas:
    view = view_of(cameras, options)
    scale = float(np.median([camera.focal for camera in cameras])) * options.scale
    choice = choose_projection(view, options)
    projection = PROJECTIONS[choice.name]
    uv = projection.forward(view.rays, *choice.parameters)
    if options.projection == "little-planet" and not view.across:
        uv = np.clip(uv, -PLANET_EDGE, PLANET_EDGE)
    if projection.period and view.width > 2 * np.pi - CLOSED_GAP:
        return _as_high(_closed(choice, scale, uv), view)
    if projection.period:
        # the canvas may reach beyond half a turn on one side; a hair's breadth keeps its left edge from wrapping
        uv[:, 0] = (uv[:, 0] - view.start + HAIR) % projection.period + view.start - HAIR
    return _as_high(_as_wide(_canvas(choice, scale, uv), view), view)


def _closed(choice: Choice, scale: float, uv: Floats) -> Canvas:
    """The canvas of a full turn that is as high as these plane coordinates (n, 2) ask."""
    turn = max(EDGE_MULTIPLE, round(2 * np.pi * scale / EDGE_MULTIPLE) * EDGE_MULTIPLE)
    whole = _canvas(choice, turn / (2 * np.pi), np.column_stack([np.zeros(len(uv)), uv[:, 1]]))
    return replace(whole, origin=(-turn / 2 + 0.5, whole.origin[1]), size=(turn, whole.size[1]), wraps=True)


def _canvas(choice: Choice, scale: float, uv: Floats) -> Canvas:
    """The smallest canvas that holds these plane coordinates (n, 2); NaN are no matter."""
    low, high = np.nanmin(uv, axis=0) * scale, np.nanmax(uv, axis=0) * scale
    x, y = np.floor(low)
    width, height = (max(1, int(n)) for n in np.ceil(high) - (x, y) + 1)
    return Canvas(
        choice.name,
        scale,
        (float(x), float(y)),
        (width, height),
        parameters=choice.parameters,
        reason=choice.reason,
    )


def _as_wide(canvas: Canvas, view: View) -> Canvas:
    """The canvas with the width that was asked for, straight ahead in its middle."""
    if not view.across:
        return canvas
    half = half_extent(canvas.projection, canvas.parameters, view.across, axis=0)
    width = max(1, round(2 * half * canvas.scale))
    return replace(canvas, origin=((1 - width) / 2, canvas.origin[1]), size=(width, canvas.size[1]))


def _as_high(canvas: Canvas, view: View) -> Canvas:
    """The canvas with the height that was asked for, the horizon in its middle."""
    if not view.down:
        return canvas
    half = half_extent(canvas.projection, canvas.parameters, view.down, axis=1)
    height = max(1, round(2 * half * canvas.scale))
    return replace(canvas, origin=(canvas.origin[0], (1 - height) / 2), size=(canvas.size[0], height))


def check_size(alignment: Alignment, canvas: Canvas, options: LayoutOptions) -> None:
    """Raise AlignmentError for a canvas that no sound alignment asks for, LimitError for one that is too large."""
    pixels = canvas.size[0] * canvas.size[1]
    given = sum(photo.size[0] * photo.size[1] for photo in alignment.photos) * options.scale**2
    if pixels > ABSURD * max(given, 1) and not options.field:
        raise AlignmentError(
            f"the photos would be spread over {canvas.size[0]} x {canvas.size[1]} px: the alignment is not sound",
            details=_most_stretched(alignment, canvas, options),
            hint="look at the matches with --debug-dir, and leave out photos that do not belong",
        )
    if pixels > MAX_PIXELS:
        raise LimitError(
            f"the panorama would be {canvas.size[0]} x {canvas.size[1]} px; "
            f"{MAX_PIXELS / 1e6:.0f} megapixels is the most",
            hint="make it smaller, for example with --scale 0.5",
        )


def _most_stretched(alignment: Alignment, canvas: Canvas, options: LayoutOptions) -> tuple[str, ...]:
    """The photo that is stretched most, in a line; or that none is, and what lies between them makes it large."""
    found = []
    for photo, camera in zip(alignment.photos, alignment.cameras, strict=True):
        xy = canvas.pixels(camera.rays(camera.outline()))
        width, height = np.nan_to_num(np.nanmax(xy, axis=0) - np.nanmin(xy, axis=0))
        found.append((width * height / (camera.size[0] * camera.size[1] * options.scale**2), photo.name, width, height))
    times, name, width, height = max(found)
    if times < STRETCHED:
        return ("no photo is stretched; they lie far apart for their focal lengths, with nothing between them",)
    return (f"{name} alone would be spread over {width:.0f} x {height:.0f} px, {times:.0f} times its own size",)
