"""What the healthy program keeps to, and what a damaged one must break: one place for both."""

import numpy as np

from panostitch import pipeline
from panostitch.options import Options
from panostitch.synthetic.render import photograph
from panostitch.synthetic.scene import rig
from panostitch.synthetic.score import score

# px, rms of the true error in the row of six 1200 x 900 photos; about twice what was measured: sift 0.037, surf 0.16,
# orb 0.25, akaze 0.21. Not zero: that would mean that the truth was looked at.
ROW_PX = {"sift": 0.3, "surf": 0.35, "orb": 0.5, "akaze": 0.4}
ROW_LEAST_PX = 1e-3

# px, the same in the row of four 400 x 300 photos with sift. 0.035 seen.
SMALL_PX = 0.12

# Grey levels, mean over the middle of the rendered view against a photograph taken by a camera that sees all of it;
# two samplings of fine grain. 2.1 seen; one pixel aside 15.
VIEW_LEVELS = 4.0

# Relative; what is left of planted exposure steps of 0.5 EV, 17 % of the encoded values. 0.05 seen, see contracts.
GAINS_LEFT = 0.4


def aligned(known, photos=None, **options):
    """The alignment of photos and how far it is from the truth; both fail if a photo is left out."""
    photos = photos or known.photos
    alignment = pipeline.align(photos, Options.of(**options))
    found = {photo.name: camera for photo, camera in zip(alignment.photos, alignment.cameras, strict=True)}
    return alignment, score(known.cameras, [found.get(photo.name) for photo in known.photos])


def all_in(known, alignment):
    return sorted(p.name for p in alignment.photos) == sorted(p.name for p in known.photos)


def true_view(known, size=(480, 240), hfov=1.2):
    """What a camera that looks at the middle of the scene sees."""
    (camera,) = rig([0.0], size=size, hfov=hfov)
    return camera, photograph(known.scene, camera, supersample=1).astype(np.float32)


def view_error(known, panorama):
    """Mean grey levels between the panorama of the true cameras, which sees along z, and the true view."""
    camera, truth = true_view(known)
    canvas = panorama.canvas
    assert canvas.projection == "rectilinear"
    layer = panorama.read(canvas.region)
    y, x = np.mgrid[: canvas.size[1], : canvas.size[0]]
    at = camera.project(canvas.rays(np.column_stack([x.ravel(), y.ravel()]).astype(float)))
    return layer, at, truth
