"""Photographs of known scenes, aligned like any others: the true error of this program on this machine, and of others.

The rivals get the same photos: cv2.Stitcher and, where its tools are installed, Hugin.
"""

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from panostitch import pipeline
from panostitch.errors import PanostitchError
from panostitch.jobs.contender import DONE, OURS, RIVAL, Task, run_apart
from panostitch.jobs.hugin import HUGIN, HuginError, is_installed, run_hugin
from panostitch.model.camera import Camera
from panostitch.model.photo import Photo
from panostitch.options import Options
from panostitch.runtime.executor import Executor, serial
from panostitch.synthetic.render import photograph_plan
from panostitch.synthetic.scene import FLAT_PLANS, PLANS, Scene, plane_scene, procedural_texture, sphere_scene
from panostitch.synthetic.score import View, score
from panostitch.synthetic.textures import even_on_sphere

QUICK = ("pair", "low_overlap")
QUICK_SIZE = (800, 600)  # px
PROGRAMS = (OURS, RIVAL, HUGIN)
TEXTURES = (4096, 8192)  # px, widths
LONGEST_FOCAL = 1250.0  # px: longer ones ask for the finer texture, as a pixel of the other would be two of the photo
SEED = 7
EASY, HARD = 0.02, 0.05  # px
# px, rms: more than this on photos of this kind is a fault. A plan is hard where the lens is to be found too, or where
# most of what a photo says of its neighbours lies far off its middle.
BOUNDS = {
    "pair": EASY,
    "row": EASY,
    "rolled": EASY,
    "low_overlap": EASY,
    "barrel": HARD,
    "zoomed": HARD,
    "ring": EASY,
    "two_rows": EASY,
    "mosaic": EASY,
    "sphere": HARD,
    "plane_pair": EASY,
}


@dataclass(frozen=True)
class Conditions:
    """Under what light the photos are taken, and what is noted of it.

    exposure_step: EV, up for one photo and down for the next
    vignetting:    share of the light lost in the corners
    noise:         grey levels
    exif:          whether the photos tell their focal length
    """

    exposure_step: float
    vignetting: float
    noise: float
    exif: bool = False


CONDITIONS = Conditions(exposure_step=0.3, vignetting=0.2, noise=2.0)


@dataclass(frozen=True)
class Finding:
    """How well a program recovered one plan of cameras.

    exif:          whether the photos told their focal length
    photos, given: how many photos were aligned, and how many there were
    rms, p95:      px, distance of where a point is from where the cameras say it is; infinite if alignment failed
    seconds:       until the program was done; cv2.Stitcher's are with the panorama, the others' are not
    message:       why it failed, or how it did it
    """

    plan: str
    photos: int
    given: int
    rms: float
    p95: float
    seconds: float
    message: str = ""
    program: str = OURS
    exif: bool = False

    @property
    def passed(self) -> bool:
        """Every photo is in, and nearly where it belongs."""
        return self.photos == self.given and self.rms <= BOUNDS.get(self.plan, EASY)


def run_selftest(
    plans: Sequence[str],
    options: Options,
    *,
    run: Executor,
    programs: Sequence[str] = (OURS,),
    exif: Sequence[bool] = (False,),
    size: tuple[int, int] | None = None,
) -> Iterator[Finding]:
    """Photograph and align each plan (names in PLANS), with exposure steps, vignetting and noise.

    programs: names in PROGRAMS; those that are not installed are passed over
    exif:     once without, once with the focal length in the metadata, or both
    size:     px of the photos where they are not to be of their full size
    """
    for name, known in product(plans, exif):
        cameras, photos = photograph(name, replace(CONDITIONS, exif=known), size=size, run=run)
        for program in programs:
            if program != HUGIN or is_installed():
                yield replace(JUDGES[program](name, cameras, photos, options, run), exif=known)


def photograph(
    plan: str,
    conditions: Conditions,
    *,
    scene: Scene | None = None,
    size: tuple[int, int] | None = None,
    run: Executor = serial,
) -> tuple[list[Camera], list[Photo]]:
    """The cameras of a plan and the photos they take, by default of a computed scene; the same on every call."""
    cameras = PLANS[plan]()
    if size and plan not in FLAT_PLANS:
        cameras = [camera.scaled(size) for camera in cameras]
    photos = photograph_plan(
        scene or computed_scene(plan, cameras),
        cameras,
        exposures=[conditions.exposure_step * (-1) ** n for n in range(len(cameras))],
        vignetting=conditions.vignetting,
        noise=conditions.noise,
        rng=np.random.default_rng(SEED),
        focal_known=conditions.exif,
        run=run,
    )
    return cameras, photos


def computed_scene(plan: str, cameras: Sequence[Camera]) -> Scene:
    """The computed scene that a plan's cameras look at, fine enough for them."""
    if plan in FLAT_PLANS:
        return plane_scene(_texture(TEXTURES[0]))
    fine = max(camera.focal for camera in cameras) > LONGEST_FOCAL
    return sphere_scene(_even_texture(TEXTURES[fine]))


@cache
def _texture(width: int) -> NDArray[np.uint8]:
    return procedural_texture(width, width // 2, SEED)


@cache
def _even_texture(width: int) -> NDArray[np.uint8]:
    return even_on_sphere(_texture(width))


def judge(plan: str, true: Sequence[Camera], photos: Sequence[Photo], options: Options, run: Executor) -> Finding:
    """Align the photos and compare the cameras found with the true ones."""
    start = time.perf_counter()
    try:
        alignment = pipeline.align(photos, options, run=run)
    except PanostitchError as error:
        return _failed(OURS, plan, true, time.perf_counter() - start, error.message)
    seconds = time.perf_counter() - start
    found = {photo.name: camera for photo, camera in zip(alignment.photos, alignment.cameras, strict=True)}
    return _judged(OURS, plan, true, [found.get(photo.name) for photo in photos], seconds)


def judge_rival(plan: str, true: Sequence[Camera], photos: Sequence[Photo], options: Options, run: Executor) -> Finding:
    """The same of cv2.Stitcher, in a process of its own."""
    with tempfile.TemporaryDirectory(prefix="panostitch-selftest-") as home:
        outcome = run_apart(Task(RIVAL, tuple(photos), options, run.threads), home)
    if outcome.status != DONE:
        return _failed(RIVAL, plan, true, outcome.seconds or 0.0, outcome.status)
    return _judged(RIVAL, plan, true, outcome.cameras, outcome.seconds or 0.0)


def judge_hugin(plan: str, true: Sequence[Camera], photos: Sequence[Photo], _: Options, run: Executor) -> Finding:
    """The same of Hugin: the better one of its default and of an optimisation of the lens after that."""
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="panostitch-selftest-") as home:
        try:
            result = run_hugin(photos, Path(home), threads=run.threads)
        except HuginError as error:
            return _failed(HUGIN, plan, true, time.perf_counter() - start, str(error))
    plain, lens = (_judged(HUGIN, plan, true, cameras, result.seconds) for cameras in (result.plain, result.lens))
    if plain.rms <= lens.rms:
        return replace(plain, message=f"as it comes; {lens.rms:.3f} px with the lens optimised")
    return replace(lens, message=f"lens optimised; {plain.rms:.3f} px as it comes")


Judge = Callable[[str, Sequence[Camera], Sequence[Photo], Options, Executor], Finding]
JUDGES: dict[str, Judge] = {OURS: judge, RIVAL: judge_rival, HUGIN: judge_hugin}


def _failed(program: str, plan: str, true: Sequence[Camera], seconds: float, message: str) -> Finding:
    return Finding(plan, 0, len(true), np.inf, np.inf, seconds, message, program)


def _judged(program: str, plan: str, true: Sequence[Camera], cameras: Sequence[View | None], seconds: float) -> Finding:
    result = score(true, cameras)
    return Finding(plan, len(true) - len(result.missing), len(true), result.rms, result.p95, seconds, program=program)
