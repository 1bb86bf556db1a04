"""The canvas: projection, scale and size, so that every photo is on it at its own resolution."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from panostitch.errors import AlignmentError, LimitError, UsageError
from panostitch.geometry.projections import PROJECTIONS
from panostitch.model.alignment import Alignment
from panostitch.model.camera import Camera
from panostitch.model.canvas import Canvas
from panostitch.options import LayoutOptions
from panostitch.runtime.trace import Trace, silent

Floats = NDArray[np.float64]

RECTILINEAR_UNTIL = np.deg2rad(47.0)  # from straight ahead: beyond, the edges are stretched twice as wide
CYLINDRICAL_UNTIL = np.deg2rad(50.0)  # above or below the horizon
RECTILINEAR_LIMIT = np.deg2rad(80.0)
CYLINDRICAL_LIMIT = np.deg2rad(80.0)
CLOSED_GAP = np.deg2rad(1.0)  # a turn with a smaller hole than this is closed
HAIR = 1e-9  # radians
GRID = 24  # rays along each side of a photo that find its extent
EDGE_MULTIPLE = 64  # a closed canvas is wide a multiple of this, so that reductions of it close as well
ABSURD = 40.0  # times the photos' own pixels: no sound alignment spreads them so thin
MAX_PIXELS = 1_000_000_000


def lay_out(alignment: Alignment, options: LayoutOptions, *, trace: Trace = silent) -> Canvas:
    """The canvas of an alignment.

    Raises UsageError where the projection cannot show the view, AlignmentError for an absurd size, LimitError for one
    that is too large.
    """
    if alignment.model != "rotation":
        canvas, reason = _plane(alignment.cameras, options), "flat subject"
    else:
        canvas, reason = _sphere(alignment.cameras, options)
    _check_size(alignment, canvas, options)
    trace("layout.chosen", alignment=alignment, canvas=canvas, reason=reason)
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
    return _canvas("rectilinear", options.scale, PROJECTIONS["rectilinear"].forward(outlines))


def _sphere(cameras: Sequence[Camera], options: LayoutOptions) -> tuple[Canvas, str]:
    rays = np.vstack([camera.rays(_grid(camera)) for camera in cameras])
    scale = float(np.median([camera.focal for camera in cameras])) * options.scale
    name, reason = _choose_projection(cameras, rays, options)
    if not PROJECTIONS[name].period:
        return _canvas(name, scale, PROJECTIONS[name].forward(rays)), reason
    uv = np.vstack([PROJECTIONS[name].forward(rays), *_poles(cameras, name)])
    start, width = _arc(cameras)
    if width > 2 * np.pi - CLOSED_GAP:
        turn = max(EDGE_MULTIPLE, round(2 * np.pi * scale / EDGE_MULTIPLE) * EDGE_MULTIPLE)
        whole = _canvas(name, turn / (2 * np.pi), np.column_stack([np.zeros(len(uv)), uv[:, 1]]))
        return Canvas(name, whole.scale, (-turn / 2 + 0.5, whole.origin[1]), (turn, whole.size[1]), wraps=True), reason
    # the canvas may reach beyond half a turn on one side; a hair's breadth keeps its left edge from wrapping
    uv[:, 0] = (uv[:, 0] - start + HAIR) % (2 * np.pi) + start - HAIR
    return _canvas(name, scale, uv), reason


def _canvas(name: str, scale: float, uv: Floats) -> Canvas:
    """The smallest canvas that holds these plane coordinates (n, 2); NaN are no matter."""
    low, high = np.nanmin(uv, axis=0) * scale, np.nanmax(uv, axis=0) * scale
    x, y = np.floor(low)
    width, height = (max(1, int(n)) for n in np.ceil(high) - (x, y) + 1)
    return Canvas(name, scale, (float(x), float(y)), (width, height))


def _grid(camera: Camera) -> Floats:
    """Pixels (n, 2) all over a photo, its outline among them."""
    width, height = camera.size
    x, y = np.meshgrid(np.linspace(-0.5, width - 0.5, GRID), np.linspace(-0.5, height - 0.5, GRID))
    return np.column_stack([x.ravel(), y.ravel()])


def _arc(cameras: Sequence[Camera]) -> tuple[float, float]:
    """Start and width (radians of longitude) of what the photos cover, without the widest gap between them."""
    if _poles(cameras, "equirectangular"):
        return -np.pi, 2 * np.pi
    intervals = sorted(_interval(camera) for camera in cameras)
    first = intervals[0][0]
    gaps, end = [], first
    for start, width in [*intervals, (first + 2 * np.pi, 0.0)]:
        gaps.append((start - end, start))
        end = max(end, start + width)
    gap, start = max(gaps)
    if start > np.pi / 2:  # keep straight ahead inside the canvas, where the photos were centred
        start -= 2 * np.pi
    return float(start), float(2 * np.pi - max(gap, 0.0))


def _interval(camera: Camera) -> tuple[float, float]:
    """Start in -pi..pi and width (radians of longitude) of what one photo covers; it must not show a pole."""
    rays, ahead = camera.rays(_grid(camera)), camera.cam_from_world[2]
    middle = np.arctan2(ahead[0], ahead[2])
    aside = (np.arctan2(rays[:, 0], rays[:, 2]) - middle + np.pi) % (2 * np.pi) - np.pi
    start = (middle + aside.min() + np.pi) % (2 * np.pi) - np.pi
    return float(start), float(aside.max() - aside.min())


def _poles(cameras: Sequence[Camera], name: str) -> list[Floats]:
    """Plane coordinates of the zenith and the nadir with a full turn around them, where a photo shows them."""
    found = []
    for vertical in (-1.0, 1.0):
        seen = [camera.project(np.array([[0.0, vertical, 0.0]]))[0] for camera in cameras]
        if any(((xy >= -0.5) & (xy <= np.array(c.size) - 0.5)).all() for xy, c in zip(seen, cameras, strict=True)):
            turn = np.linspace(-np.pi, np.pi, 720)
            height = vertical * (np.pi / 2 if name == "equirectangular" else np.tan(CYLINDRICAL_LIMIT))
            found.append(np.column_stack([turn, np.full(len(turn), height)]))
    return found


def _choose_projection(cameras: Sequence[Camera], rays: Floats, options: LayoutOptions) -> tuple[str, str]:
    """Name of the projection and why. Raises UsageError where a forced one cannot show the view."""
    longitude = np.arctan2(rays[:, 0], rays[:, 2])
    latitude = np.arctan2(rays[:, 1], np.hypot(rays[:, 0], rays[:, 2]))
    wide, high = float(np.abs(longitude).max()), float(np.abs(latitude).max())
    high = max(high, np.pi / 2 if _poles(cameras, "equirectangular") else 0.0)
    width = np.rad2deg(_arc(cameras)[1])
    field = f"the view is {width:.0f} degrees wide and reaches {np.rad2deg(high):.0f} degrees from the horizon"
    if options.projection == "auto":
        if wide < RECTILINEAR_UNTIL and high < RECTILINEAR_UNTIL:
            return "rectilinear", field
        return ("cylindrical" if high < CYLINDRICAL_UNTIL else "equirectangular"), field
    too_wide = options.projection == "rectilinear" and max(wide, high) > RECTILINEAR_LIMIT
    if too_wide or (options.projection == "cylindrical" and high > CYLINDRICAL_LIMIT):
        raise UsageError(
            f"--projection {options.projection} cannot show this: {field}",
            hint="use --projection auto" if too_wide else "use --projection equirectangular",
        )
    return options.projection, "as asked"


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
