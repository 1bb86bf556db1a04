"""A picture of a known scene with defects planted into it, and the photos it could have been made of."""

from dataclasses import replace

import cv2
import numpy as np

from panostitch.synthetic.render import photograph, photograph_plan
from panostitch.synthetic.scene import procedural_texture, rig, sphere_scene

DIRECTION = np.array([0.6, 0.8])  # of planted shifts
NOISE = 2.0  # grey levels
EXPOSURES = [0.0, 0.3]  # EV

SCENE = sphere_scene(procedural_texture(2048, 1024, seed=3))
CAMERAS = rig(np.deg2rad([-11, 11]), np.deg2rad([1.0, -1.0]), np.deg2rad([1.0, -1.0]), size=(400, 320), focal=380)
(WIDE,) = rig(0.0, size=(528, 200), focal=375)
LINE = 264  # px, a column in the middle of what both photos show


def photos():
    return photograph_plan(SCENE, CAMERAS, exposures=EXPOSURES, noise=NOISE, rng=np.random.default_rng(1))


def perfect(px=0.0):
    """The picture (h, w, 3) of the whole, with noise of its own; shifted by so many px in DIRECTION."""
    x, y = WIDE.centre + DIRECTION * px
    return photograph(SCENE, replace(WIDE, centre=(x, y)), noise=NOISE, rng=np.random.default_rng(2))


def cut(picture, px):
    """Right of a hidden line, all is shifted."""
    return spliced(picture, perfect(px), slice(LINE, None))


def ghost(picture, px):
    """About the line, two shifted copies are blended."""
    return spliced(picture, (picture + perfect(px).astype(float)) / 2, slice(LINE - 40, LINE + 40))


def blurred(picture, sigma):
    """About the line, the picture is soft."""
    return spliced(picture, cv2.GaussianBlur(picture, (0, 0), sigma), slice(LINE - 40, LINE + 40))


def tinted(picture, share):
    """Right of the line, all is redder and less blue by this share."""
    return spliced(picture, np.clip(picture * [1 + share, 1, 1 - share], 0, 255), slice(LINE, None))


def spliced(picture, other, columns):
    changed = picture.copy()
    changed[:, columns] = np.rint(other[:, columns])
    return changed
