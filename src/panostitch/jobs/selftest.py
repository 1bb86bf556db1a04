"""Photographs of known scenes, aligned like any others: the true error of this program on this machine."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from panostitch import pipeline
from panostitch.errors import PanostitchError
from panostitch.model.camera import Camera
from panostitch.model.photo import Photo
from panostitch.options import Options
from panostitch.runtime.executor import Executor
from panostitch.synthetic.render import photograph_plan
from panostitch.synthetic.scene import FLAT_PLANS, PLANS, plane_scene, procedural_texture, sphere_scene
from panostitch.synthetic.score import score

QUICK = ("pair", "low_overlap")
TEXTURE = (4096, 2048)  # px
SEED = 7
EXPOSURE_STEP = 0.3  # EV, up and down in turn
VIGNETTING = 0.2  # share of light lost in the corners
NOISE = 2.0  # grey levels
MAX_RMS = 0.5  # px: more than this on photos of this kind is a fault


@dataclass(frozen=True)
class Finding:
    """How well one plan of cameras was recovered.

    photos, given: how many photos were aligned, and how many there were
    rms, p95:      px, distance of where a point is from where the cameras say it is; infinite if alignment failed
    """

    plan: str
    photos: int
    given: int
    rms: float
    p95: float
    seconds: float
    message: str = ""

    @property
    def passed(self) -> bool:
        """Every photo is in, and nearly where it belongs."""
        return self.photos == self.given and self.rms <= MAX_RMS


def run_selftest(plans: Sequence[str], options: Options, *, run: Executor) -> Iterator[Finding]:
    """Photograph and align each plan (names in PLANS), with exposure steps, vignetting and noise."""
    texture = procedural_texture(*TEXTURE, SEED)
    for name in plans:
        scene = plane_scene(texture) if name in FLAT_PLANS else sphere_scene(texture)
        true = PLANS[name]()
        photos = photograph_plan(
            scene,
            true,
            exposures=[EXPOSURE_STEP * (-1) ** n for n in range(len(true))],
            vignetting=VIGNETTING,
            noise=NOISE,
            rng=np.random.default_rng(SEED),
        )
        yield _judged(name, true, photos, options, run)


def _judged(plan: str, true: Sequence[Camera], photos: Sequence[Photo], options: Options, run: Executor) -> Finding:
    start = time.perf_counter()
    try:
        alignment = pipeline.align(photos, options, run=run)
    except PanostitchError as error:
        return Finding(plan, 0, len(true), np.inf, np.inf, time.perf_counter() - start, error.message)
    seconds = time.perf_counter() - start
    found = {photo.name: camera for photo, camera in zip(alignment.photos, alignment.cameras, strict=True)}
    result = score(true, [found.get(photo.name) for photo in photos])
    return Finding(plan, len(found), len(true), result.rms, result.p95, seconds)
