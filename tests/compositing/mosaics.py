"""Panoramas of photos whose cameras are known, without any matching."""

import numpy as np

from panostitch.compositing import lay_out, make_panorama, make_plan
from panostitch.model.alignment import Alignment
from panostitch.model.camera import Camera
from panostitch.model.photo import Photo
from panostitch.options import CompositingOptions, LayoutOptions
from panostitch.synthetic.render import ArraySource

BLANK = ArraySource(np.zeros((1, 1, 3), np.uint8))


def alignment_of(cameras, pictures=None, *, model="rotation"):
    """The alignment of these cameras, with pictures (h, w, 3) or without."""
    pictures = pictures or [None] * len(cameras)
    photos = [
        Photo(f"p{n}", camera.size, BLANK if picture is None else ArraySource(np.ascontiguousarray(picture)))
        for n, (camera, picture) in enumerate(zip(cameras, pictures, strict=True))
    ]
    return Alignment(model, tuple(photos), tuple(cameras), (), (), 0.0, 0.0)


def shifted(size, x, y):
    """The camera of a flat picture that lies at (x, y) px of a plane."""
    return Camera(size, 1.0, (0.0, 0.0), np.array([[1.0, 0, -x], [0, 1, -y], [0, 0, 1]]))


def panorama_of(alignment, *, layout=None, compositing=None):
    layout, compositing = layout or LayoutOptions(), compositing or CompositingOptions()
    canvas = lay_out(alignment, layout)
    plan = make_plan(alignment, canvas, compositing, layout.crop)
    return make_panorama(alignment, canvas, plan, compositing)
