"""The canvas: projection, scale and size, so that every photo is on it at its own resolution."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from panostitch.compositing.choice import PLANET_EDGE, Choice, choose_projection
from panostitch.compositing.coverage import HAIR, arc, rays_over
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
MAX_PIXELS = 1_000_000_000


def lay_out(alignment: Alignment, options: LayoutOptions, *, trace: Trace = silent) -> Canvas:
    """The canvas of an alignment.

    Raises UsageError where the projection cannot show the view, AlignmentError for an absurd size, LimitError for one
    that is too large.
    """
    canvas = (_plane if alignment.model != "rotation" else _sphere)(alignment.cameras, options)
    _check_size(alignment, canvas, options)
    trace("layout.chosen", alignment=alignment, canvas=canvas, reason=canvas.reason)
    return canvas


def _plane(cameras: Sequence[Camera], options: LayoutOptions) -> Canvas:
    """The plane of a flat subject, seen straight on from the photo that defines it."""
    if options.projection not in ("auto", "rectilinear"):
        raise UsageError(
            f"--projection {options.projection} cannot show a flat subject",
            hint="leave it out, or force the other model with --model rotation",
        )
    outlines = np.vstack([camera.rays(camera.outline()) for camera in cameras])
    if (outlines[:, 2] <= 0).any():
        raise AlignmentError(
            "a photo reaches beyond the horizon of the plane", hint="try --model rotation, or fewer photos"
        )
    choice = Choice("rectilinear", (), "flat subject")
    return _canvas(choice, options.scale, PROJECTIONS["rectilinear"].forward(outlines))


def _sphere(cameras: Sequence[Camera], options: LayoutOptions) -> Canvas:
    rays = rays_over(cameras)
    scale = float(np.median([camera.focal for camera in cameras])) * options.scale
    choice = choose_projection(cameras, rays, options)
    projection = PROJECTIONS[choice.name]
    uv = projection.forward(rays, *choice.parameters)
    if options.projection == "little-planet":
        return _canvas(choice, scale, np.clip(uv, -PLANET_EDGE, PLANET_EDGE))
    if not projection.period:
        return _canvas(choice, scale, uv)
    start, width = arc(cameras)
    if width > 2 * np.pi - CLOSED_GAP:
        return _closed(choice, scale, uv)
    # the canvas may reach beyond half a turn on one side; a hair's breadth keeps its left edge from wrapping
    uv[:, 0] = (uv[:, 0] - start + HAIR) % projection.period + start - HAIR
    return _canvas(choice, scale, uv)


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


def _check_size(alignment: Alignment, canvas: Canvas, options: LayoutOptions) -> None:
    pixels = canvas.size[0] * canvas.size[1]
    given = sum(photo.size[0] * photo.size[1] for photo in alignment.photos) * options.scale**2
    if pixels > ABSURD * max(given, 1):
        raise AlignmentError(
            f"the photos would be spread over {canvas.size[0]} x {canvas.size[1]} px: the alignment is not sound",
            hint="look at the matches with --debug-dir, and leave out photos that do not belong",
        )
    if pixels > MAX_PIXELS:
        raise LimitError(
            f"the panorama would be {canvas.size[0]} x {canvas.size[1]} px; "
            f"{MAX_PIXELS / 1e6:.0f} megapixels is the most",
            hint="make it smaller, for example with --scale 0.5",
        )
