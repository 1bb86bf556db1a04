"""Stage 4: cameras to pixels."""

from functools import partial

from panostitch.compositing.compose import Work, compose
from panostitch.compositing.cost import decoding_bytes, photo_budget, shown_bytes, tile_bytes
from panostitch.compositing.cube import make_cube
from panostitch.compositing.frame import frame
from panostitch.compositing.layout import lay_out
from panostitch.compositing.plan import make_plan
from panostitch.compositing.warp import decoded_photos
from panostitch.model.alignment import Alignment
from panostitch.model.canvas import Canvas
from panostitch.model.panorama import Panorama, Plan
from panostitch.options import CompositingOptions

__all__ = ["decoding_bytes", "frame", "lay_out", "make_cube", "make_panorama", "make_plan"]


def make_panorama(
    alignment: Alignment, canvas: Canvas, plan: Plan, options: CompositingOptions, *, memory: int | None = None
) -> Panorama:
    """The panorama as a function of a region; `memory` is what the whole program may take, in bytes."""
    budget = photo_budget(alignment.photos, memory)
    work = Work(alignment, canvas, plan, options, decoded_photos(budget))
    return Panorama(
        canvas,
        plan,
        partial(compose, work),
        work.photos,
        work.decoded.forget,
        partial(tile_bytes, work),
        partial(shown_bytes, alignment.photos, work.photos),
        budget,
        alignment,
    )
