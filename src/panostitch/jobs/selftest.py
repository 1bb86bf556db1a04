"""Photographs of known scenes, aligned like any others: the true error of this program on this machine."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

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
MAX_RMS = 0.5  # px: more than this on photos of this kind is a fault


@dataclass(frozen=True)
class Conditions:
    """Under what light the photos are taken.

    exposure_step: EV, up for one photo and down for the next
    vignetting:    share of the light lost in the corners
    noise:         grey levels
    """

    exposure_step: float
    vignetting: float
    noise: float


CONDITIONS = Conditions(exposure_step=0.3, vignetting=0.2, noise=2.0)


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
    for name in plans:
        yield judge(name, *photograph(name, CONDITIONS), options, run)


def photograph(plan: str, conditions: Conditions) -> tuple[list[Camera], list[Photo]]:
    """The cameras of a plan and the photos they take of a computed scene; the same on every call."""
    scene = plane_scene(_texture()) if plan in FLAT_PLANS else sphere_scene(_texture())
    cameras = PLANS[plan]()
    photos = photograph_plan(
        scene,
        cameras,
        exposures=[conditions.exposure_step * (-1) ** n for n in range(len(cameras))],
        vignetting=conditions.vignetting,
        noise=conditions.noise,
        rng=np.random.default_rng(SEED),
    )
    return cameras, photos


@cache
def _texture() -> NDArray[np.uint8]:
    return np.asarray(procedural_texture(*TEXTURE, SEED), np.uint8)


def judge(plan: str, true: Sequence[Camera], photos: Sequence[Photo], options: Options, run: Executor) -> Finding:
    """Align the photos and compare the cameras found with the true ones."""
    start = time.perf_counter()
    try:
        alignment = pipeline.align(photos, options, run=run)
    except PanostitchError as error:
        return Finding(plan, 0, len(true), np.inf, np.inf, time.perf_counter() - start, error.message)
    seconds = time.perf_counter() - start
    found = {photo.name: camera for photo, camera in zip(alignment.photos, alignment.cameras, strict=True)}
    result = score(true, [found.get(photo.name) for photo in photos])
    return Finding(plan, len(found), len(true), result.rms, result.p95, seconds)
