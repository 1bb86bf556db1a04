"""How photos are joined. A blender blends low bands once, on the reduced canvas, and joins tiles at full size."""

from collections.abc import Callable
from dataclasses import dataclass

from panostitch.compositing.blend import feather, multiband, none
from panostitch.compositing.blend.pieces import Alone, BlendReduced, Join


@dataclass(frozen=True)
class Blender:
    """A way to join photos.

    blend_reduced: all pieces on the reduced canvas
    join:          the pieces of one tile, with what the low bands change in each
    alone:         a tile of one photo only
    reach:         from the factor of the reduction to the halo that a tile needs, in px of the reduced canvas
    """

    blend_reduced: BlendReduced
    join: Join
    alone: Alone
    reach: Callable[[int], int]


BLENDERS = {
    "multiband": Blender(multiband.blend_reduced, multiband.join, multiband.alone, multiband.reach),
    "feather": Blender(none.blend_reduced, feather.join, none.alone, feather.reach),
    "none": Blender(none.blend_reduced, none.join, none.alone, none.reach),
}
