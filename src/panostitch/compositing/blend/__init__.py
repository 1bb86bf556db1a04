"""How photos are joined. A blender makes a correction once, on the reduced canvas, and joins tiles at full size."""

from collections.abc import Callable
from dataclasses import dataclass

from panostitch.compositing.blend import feather, multiband, none
from panostitch.compositing.blend.pieces import Correct, Join


@dataclass(frozen=True)
class Blender:
    """A way to join photos.

    correct: from all pieces on the reduced canvas to the correction (h, w, 3) that belongs to the plan
    join:    from the pieces of one tile to its pixels (h, w, 3), to which the correction is added
    reach:   from the factor of the reduction to px of halo that a tile needs, in px of the reduced canvas
    """

    correct: Correct
    join: Join
    reach: Callable[[int], int]


BLENDERS = {
    "multiband": Blender(multiband.correct, multiband.join, multiband.reach),
    "feather": Blender(none.correct, feather.join, feather.reach),
    "none": Blender(none.correct, none.join, none.reach),
}
