"""panostitch and a rival on the same photos: what each includes, costs, how well its cameras fit, and its faults.

The judge of cameras is neutral: matched points of a detector that panostitch did not align with (cv2.Stitcher aligns
with ORB), on pairs of photos that both programs include. Each program's cameras send a point of photo i to photo j and
back. The judge of the panoramas (`scoring.picture`) knows nothing but the finished pictures and the photos.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.debug import ink
from panostitch.errors import MissingError, PanostitchError
from panostitch.jobs.contender import DONE, OURS, RIVAL, Outcome, Task, run_apart
from panostitch.jobs.hugin import HUGIN, INSTALL, missing_tools
from panostitch.model.match import VerifiedMatch
from panostitch.model.photo import Photo
from panostitch.model.score import Score
from panostitch.options import Options
from panostitch.pipeline import Recognition, recognise
from panostitch.runtime.executor import Executor, serial
from panostitch.scoring import judge, summary
from panostitch.synthetic.score import View

Floats = NDArray[np.float64]
Pixels = NDArray[np.uint8]

JUDGE_MEGAPIXELS = 2.0  # more than either program aligns with, so that the judge sees finer than the judged
RIVALS = {"cv2": RIVAL, "hugin": HUGIN}  # by their names on the command line
WIDEST, HIGHEST = 2400, 1800  # px of one panorama in the picture of both
NARROWEST = 900  # px, so that a label can be read
MARGIN = 12  # px
LABEL = 40  # px
LETTERS = 22  # px


@dataclass(frozen=True)
class Misfit:
    """Distances px between matched points, under one program's cameras; infinite where a camera sees no such point."""

    median: float
    rms: float
    p95: float


@dataclass(frozen=True)
class Comparison:
    """The outcomes of both programs, the rival's first, and what the judges say of their cameras and panoramas.

    misfits:  one for each outcome; None where it has no cameras to judge
    scores:   one for each outcome; None where there is no panorama
    detector: whose points were judged by
    points, pairs: number of matches, and of pairs of photos they lie in
    """

    photos: tuple[Photo, ...]
    outcomes: tuple[Outcome, ...]
    misfits: tuple[Misfit | None, ...]
    detector: str
    points: int
    pairs: int
    scores: tuple[Score | None, ...]

    @property
    def ours(self) -> Outcome:
        """What panostitch made of the photos."""
        return next(outcome for outcome in self.outcomes if outcome.program == OURS)

    @property
    def rival(self) -> Outcome:
        """What the other program made of the photos."""
        return next(outcome for outcome in self.outcomes if outcome.program != OURS)

    def included(self, outcome: Outcome) -> list[str]:
        """Names of the photos in a program's panorama."""
        return [photo.name for photo, camera in zip(self.photos, outcome.cameras, strict=False) if camera]

    def left_out(self, outcome: Outcome) -> list[str]:
        """Names of the photos that are not."""
        kept = set(self.included(outcome))
        return [photo.name for photo in self.photos if photo.name not in kept]

    def to_json(self) -> dict[str, Any]:
        """The comparison for `--json`."""
        programs = [
            {
                "program": outcome.program,
                "version": outcome.version,
                "status": outcome.status,
                "photos": self.included(outcome),
                "left_out": self.left_out(outcome),
                "size": list(outcome.size) if outcome.size else None,
                "seconds": outcome.seconds,
                "cpu_seconds": outcome.cpu_seconds,
                "peak_megabytes": outcome.peak_megabytes,
                # JSON has no infinity
                "misfit": {k: v if np.isfinite(v) else None for k, v in vars(misfit).items()} if misfit else None,
                "score": score and score.to_json(),
            }
            for outcome, misfit, score in zip(self.outcomes, self.misfits, self.scores, strict=True)
        ]
        judge = {"detector": self.detector, "points": self.points, "pairs": self.pairs}
        return {"photos": [photo.name for photo in self.photos], "programs": programs, "judge": judge}


def compare(
    photos: Sequence[Photo],
    options: Options,
    folder: str | Path,
    *,
    rival: str = "cv2",
    threads: int | None = None,
    debug_dir: str | None = None,
    overwrite: bool = False,
    run: Executor = serial,
) -> Comparison:
    """Run both programs, one after the other; their panoramas go to `folder`, an existing one that is empty.

    rival:   name in RIVALS
    threads: for both programs alike; None for as many as each takes by itself
    A failure of either is part of the result, not an exception. Raises MissingError where the rival is not installed.
    """
    check_rival(rival)
    # first of all, so that both programs find the photos in the system's cache
    recognition = recognise(photos, judge_options(options), run=run)
    task = Task(OURS, tuple(photos), options, threads, debug_dir, overwrite)

    def one(program: str) -> Outcome:
        home = Path(folder) / program
        home.mkdir()
        return run_apart(replace(task, program=program), home)

    outcomes = tuple(run.progress(map(one, (RIVALS[rival], OURS)), total=2, label="Stitching twice"))
    links = _common(recognition, photos, outcomes)
    return Comparison(
        tuple(photos),
        outcomes,
        tuple(_misfit(outcome, links) for outcome in outcomes),
        judge_options(options).features.detector,
        sum(link.inliers for link in links),
        len(links),
        tuple(_score(outcome, photos, run) for outcome in outcomes),
    )


def check_rival(rival: str) -> None:
    """Raise MissingError where a rival (name in RIVALS) is not installed."""
    missing = missing_tools() if RIVALS[rival] == HUGIN else []
    if missing:
        raise MissingError(
            f"--with {rival}: {', '.join(missing)} {'is' if len(missing) == 1 else 'are'} not on the path",
            hint=f"install Hugin's tools ({INSTALL}), or compare --with cv2",
        )


def _score(outcome: Outcome, photos: Sequence[Photo], run: Executor) -> Score | None:
    """What the judge says of a panorama, by the photos that it includes."""
    if not outcome.picture:
        return None
    used = [photo for photo, camera in zip(photos, outcome.cameras, strict=True) if camera]
    return summary(judge(np.load(outcome.picture), used, run=run))


def judge_options(options: Options) -> Options:
    """Options of the judge: another detector than the one that panostitch aligns with, on larger pictures."""
    detector: Literal["sift", "akaze"] = "sift" if options.features.detector == "akaze" else "akaze"
    features = replace(options.features, detector=detector)
    features = replace(features, work_megapixels=max(JUDGE_MEGAPIXELS, features.megapixels))
    return replace(options, features=features, matching=replace(options.matching, retries="none"))


def _common(recognition: Recognition, photos: Sequence[Photo], outcomes: Sequence[Outcome]) -> list[VerifiedMatch]:
    """The judge's links, by indices into `photos`, of what every program with a panorama includes."""
    number = {photo.name: n for n, photo in enumerate(photos)}
    names = [number[photo.name] for photo in recognition.photos]
    links = [
        link.renumbered(names[link.i], names[link.j]) for link in recognition.links if isinstance(link, VerifiedMatch)
    ]
    judged = [outcome.cameras for outcome in outcomes if outcome.cameras]
    if not judged:
        return []
    return [link for link in links if all(cameras[link.i] and cameras[link.j] for cameras in judged)]


def _misfit(outcome: Outcome, links: Sequence[VerifiedMatch]) -> Misfit | None:
    if not outcome.cameras or not links:
        return None
    every = np.concatenate([*chain.from_iterable(_distances(outcome.cameras, link) for link in links)])
    p95 = float(np.quantile(every, 0.95, method="higher"))
    return Misfit(float(np.median(every)), float(np.sqrt((every**2).mean())), p95)


def _distances(cameras: Sequence[View | None], link: VerifiedMatch) -> list[Floats]:
    """Distances (n,) px in photo j, and in photo i."""
    camera_i, camera_j = cameras[link.i], cameras[link.j]
    assert camera_i
    assert camera_j
    there = np.hypot(*(camera_j.project(camera_i.rays(link.xy_i)) - link.xy_j).T)
    back = np.hypot(*(camera_i.project(camera_j.rays(link.xy_j)) - link.xy_i).T)
    return [np.where(np.isfinite(d), d, np.inf) for d in (there, back)]


def failure(comparison: Comparison) -> Exception | None:
    """Why panostitch made no panorama: a PanostitchError, or a bug; None if it made one."""
    ours = comparison.ours
    if ours.status == DONE:
        return None
    if isinstance(ours.error, PanostitchError):
        return ours.error
    return RuntimeError("\n".join([f"panostitch in its own process {ours.status}", *ours.log]))


def side_by_side(comparison: Comparison) -> Pixels:
    """One picture (h, w, 3) RGB of both panoramas, one above the other, each under its label."""
    panoramas = [reduced(outcome) for outcome in comparison.outcomes]
    width = max(NARROWEST, *(panorama.shape[1] for panorama in panoramas)) + 2 * MARGIN
    height = sum(LABEL + panorama.shape[0] + MARGIN for panorama in panoramas)
    picture = ink.blank(height, width)
    top = 0
    for outcome, panorama in zip(comparison.outcomes, panoramas, strict=True):
        words = ink.shorten(_label(comparison, outcome), width - 2 * MARGIN, LETTERS)
        ink.write(picture, words, (MARGIN, top + LABEL / 2), height=LETTERS)
        left, top = (width - panorama.shape[1]) // 2, top + LABEL
        picture[top : top + panorama.shape[0], left : left + panorama.shape[1]] = panorama
        top += panorama.shape[0] + MARGIN
    return picture


def _label(comparison: Comparison, outcome: Outcome) -> str:
    name = f"{outcome.program} {outcome.version}"
    if not outcome.size:
        return f"{name}: {outcome.status}"
    count = f"{len(comparison.included(outcome))} of {len(comparison.photos)} photos"
    return f"{name}: {outcome.size[0]} x {outcome.size[1]} px, {count}"


def reduced(outcome: Outcome) -> Pixels:
    """A panorama no larger than fits into the picture of both; nothing (0, 0, 3) where there is none."""
    if not outcome.picture:
        return np.zeros((0, 0, 3), np.uint8)
    pixels = np.load(outcome.picture, mmap_mode="r")
    height, width = pixels.shape[:2]
    scale = min(1.0, WIDEST / width, HIGHEST / height)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    small = np.asarray(cv2.resize(np.ascontiguousarray(pixels), size, interpolation=cv2.INTER_AREA), np.uint8)
    return small[..., :3]
