"""Canvas and crop for a picture of a given size, or of a given rectangle; otherwise the canvas and the rule."""

from dataclasses import replace

import numpy as np

from panostitch.compositing.crop import Crop, choose_crop
from panostitch.compositing.layout import EDGE_MULTIPLE, check_size, lay_out
from panostitch.compositing.plan import at_full_size, coverage, reduction
from panostitch.errors import UsageError
from panostitch.model.alignment import Alignment
from panostitch.model.canvas import Canvas, Region
from panostitch.options import LayoutOptions
from panostitch.runtime.executor import Executor, serial
from panostitch.runtime.trace import Trace, silent

INSET = 2  # px of the reduced canvas by which a full rectangle is made smaller: at another size it is still full


def frame(
    alignment: Alignment, options: LayoutOptions, *, run: Executor = serial, trace: Trace = silent
) -> tuple[Canvas, str | Crop]:
    """The canvas, and the rule or the region to crop it by.

    Raises what `lay_out` raises, and UsageError for a rectangle or a size that cannot be.
    """
    if options.sides is None:
        canvas = lay_out(alignment, options, trace=trace)
        return canvas, window(canvas, options) if options.window else _rule(options)
    measured = lay_out(alignment, options)
    crop = _measured(alignment, measured, _rule(options), run)
    canvas = _resized(measured, crop.region, *_fitting(measured, crop.region, options))
    check_size(alignment, canvas, replace(options, scale=canvas.scale / measured.scale))
    trace("layout.chosen", alignment=alignment, canvas=canvas, reason=canvas.reason)
    return canvas, Crop(canvas.region, f"{crop.reason}, at the size that was asked for")


def _rule(options: LayoutOptions) -> str:
    # who asks for a field of view wants to see all of it
    return "none" if options.field and options.crop == "auto" else options.crop


def window(canvas: Canvas, options: LayoutOptions) -> Crop:
    """The rectangle that was asked for. Raises UsageError where it is not on the canvas."""
    region = Region(*(options.window or ()))
    if region & canvas.region != region:
        raise UsageError(
            f"--crop {options.crop}: the canvas is {canvas.size[0]} x {canvas.size[1]} px",
            hint="X,Y,W,H are pixels of the picture that --crop none writes, with the same --scale",
        )
    return Crop(region, "the rectangle that was asked for")


def _measured(alignment: Alignment, canvas: Canvas, rule: str, run: Executor) -> Crop:
    """What the rule leaves of a canvas."""
    factor = reduction(canvas)
    small = canvas.reduced(factor)
    covered = coverage(alignment, small, run=run)
    region, reason = choose_crop(covered, rule)
    if rule != "none" and min(region.width, region.height) > 4 * INSET and covered[region.within(small.region)].all():
        aside = 0 if canvas.wraps and region.width == small.size[0] else INSET
        region = Region(region.x + aside, region.y + INSET, region.width - 2 * aside, region.height - 2 * INSET)
    return at_full_size(Crop(region or small.region, reason), canvas, factor)


def _fitting(canvas: Canvas, region: Region, options: LayoutOptions) -> tuple[int, int]:
    """The size of a region of the canvas that was asked for: the side that is not given follows the other one."""
    width, height = options.sides or (None, None)
    times = min(side / own for side, own in ((width, region.width), (height, region.height)) if side)
    fitted = [max(1, round(own * times)) for own in (region.width, region.height)]
    if canvas.wraps and region.width == canvas.size[0] and fitted[0] != width:
        # a closed turn has to be wide a multiple of its reductions, to close in them as well
        fitted[0] = -(-fitted[0] // EDGE_MULTIPLE) * EDGE_MULTIPLE
        if width and fitted[0] > width:
            fitted[0] = max(EDGE_MULTIPLE, fitted[0] - EDGE_MULTIPLE)
            fitted[1] = max(1, round(region.height * fitted[0] / region.width))
    return fitted[0], fitted[1]


def _resized(canvas: Canvas, region: Region, width: int, height: int) -> Canvas:
    """The canvas that shows a region of another one at the size (width, height) px."""
    turn = canvas.wraps and region.width == canvas.size[0]
    times = width / region.width if turn else np.sqrt(width / region.width * height / region.height)
    middle = (np.array([region.x + region.right - 1, region.y + region.bottom - 1]) / 2 + canvas.origin) * times
    # in halves of a pixel, as Hugin has it as well
    x, y = np.rint(2 * middle - (np.array([width, height]) - 1)) / 2
    resized = replace(
        canvas, scale=canvas.scale * float(times), origin=(float(x), float(y)), size=(width, height), wraps=turn
    )
    step = reduction(resized)
    if turn and width % step:
        raise UsageError(
            f"a full turn {width} px wide cannot be closed: its width has to be a multiple of {step}",
            hint=f"use --size {width - width % step}",
        )
    return resized
