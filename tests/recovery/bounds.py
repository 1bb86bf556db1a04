"""What the healthy program keeps to, and what a damaged one must break: one place for both."""

import numpy as np

from panostitch import pipeline
from panostitch.model.alignment import Alignment
from panostitch.model.camera import Camera
from panostitch.model.canvas import Canvas
from panostitch.options import Options
from panostitch.synthetic.render import photograph
from panostitch.synthetic.score import Score, score

# px, rms of the true error in the row of six 1200 x 900 photos, noise-free; at least twice what was measured: sift
# 0.052, surf 0.14, orb 0.29, akaze 0.20. No error at all would mean that the truth was looked at.
ROW_PX = {"sift": 0.3, "surf": 0.3, "orb": 0.6, "akaze": 0.4}
ROW_LEAST_PX = 1e-3

# px, rms, the same in the row of four 400 x 300 photos, one of them upright, with sift at their own size: 0.031 seen;
# 0.017 where they are enlarged first, 0.040 where they are reduced to a half.
SMALL_PX = 0.08
# px, the same where a part of the scene is repeated and the photos are noisy. 0.027 seen.
HOUSE_PX = 0.08
# px, the same through a lens with barrel distortion. 0.028 seen.
BARREL_PX = 0.08

# px, rms, of the same three where control points are measured again on the full photos: 0.0026, 0.0011 and 0.0029 seen.
ROW_REFINED_PX = 0.01
SMALL_REFINED_PX = 0.005
BARREL_REFINED_PX = 0.01

# Grey levels, mean, between the rendered panorama and a photograph by one camera that sees all of it: two samplings of
# fine grain, and the low bands of the blend. 0.81 seen; one pixel aside 3.2.
VIEW_LEVELS = 1.6

# Share of planted exposure steps that is left: see contracts/test_exposures.py. 0.16 seen.
GAINS_LEFT = 0.3


def quick(**options) -> Options:
    """Options under which small photos are searched at their own size, which is quicker than enlarged.

    Key points stay where they were found, no second attempt is made, and nothing is bent: all that would hide damages.
    """
    plain = {"refine": "none", "retries": "none", "local_warp": "none"}
    return Options.of(**{"work_megapixels": 0.12, "max_features": 2000, **plain, **options})


def aligned(known, **options) -> tuple[Alignment, Score]:
    """The alignment of photos and how far it is from the truth."""
    alignment = pipeline.align(known.photos, quick(**options))
    return alignment, error_of(known, alignment)


def error_of(known, alignment) -> Score:
    """How far an alignment is from the truth; photos may come in any order, and others may be among them."""
    found = {photo.name: camera for photo, camera in zip(alignment.photos, alignment.cameras, strict=True)}
    return score(known.cameras, [found.get(photo.name) for photo in known.photos])


def within(known, result: tuple[Alignment, Score], bound: float) -> bool:
    """The verdict of the headline test: every photo is in, and nearly where it belongs."""
    alignment, error = result
    return len(alignment.photos) == len(known.photos) and not error.missing and error.rms < bound


def truth_of(known) -> Alignment:
    """The alignment with the true cameras."""
    return Alignment("rotation", tuple(known.photos), tuple(known.cameras), (), (), 0.0, 0.0)


def view_error(known, alignment=None, **options) -> float:
    """Mean grey levels between the rendered panorama and what one wide camera sees of the scene."""
    panorama = pipeline.render(
        alignment or truth_of(known), Options.of(projection="rectilinear", crop="none", **options)
    )
    layer = panorama.read(panorama.canvas.region)
    assert layer.mask.mean() > 0.5
    return float(np.abs(layer.pixels - _wide_view(known.scene, panorama.canvas))[layer.mask].mean())


_views: dict[tuple[int, Canvas], np.ndarray] = {}  # scenes live as long as the tests


def _wide_view(scene, canvas):
    """What a camera sees whose pixels are those of a rectilinear canvas."""
    key = id(scene), canvas
    if key not in _views:
        wide = Camera(canvas.size, canvas.scale, (-canvas.origin[0], -canvas.origin[1]), np.eye(3))
        _views[key] = photograph(scene, wide, supersample=1).astype(np.float32)
    return _views[key]
