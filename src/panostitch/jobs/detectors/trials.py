"""Every detector with every matcher on the same photos.

The judge is the refined alignment of the photos. It began with one of the detectors, but its cameras rest on points
that were measured again by registering patches of the full photos, finer than any detector places its own.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from panostitch import pipeline
from panostitch.errors import AlignmentError, NoOverlapError, PanostitchError
from panostitch.features import DETECTORS, detect_one, read_scale
from panostitch.matching import MATCHERS, match, verify
from panostitch.matching.pairs import Pair, choose_pairs
from panostitch.model.alignment import Alignment
from panostitch.model.camera import Camera
from panostitch.model.features import Features
from panostitch.model.match import Link, PutativeMatch, VerifiedMatch
from panostitch.model.photo import Photo, Pixels
from panostitch.options import FeatureOptions, Options
from panostitch.runtime.executor import Executor, serial
from panostitch.runtime.trace import Trace, silent
from panostitch.synthetic.score import pair_errors

Result = TypeVar("Result")

# What stands in the way of using a method. All code is Apache-2.0: that of OpenCV, and SURF, which is our own.
LICENCES = {
    "sift": "free (patent expired 2020)",
    "surf": "patented: see docs/explanation/surf.md",
    "orb": "free",
    "akaze": "free",
}

# Of the longer side: a match that is farther off shows another thing. About the error that a true match may have under
# a homography with the default options, where photos are reduced most.
RIGHT = 0.005


@dataclass(frozen=True)
class Trial:
    """One detector with one matcher.

    detect_ms: of each photo, milliseconds of processor time from pixels in memory to descriptors
    match_ms:  of each pair, milliseconds of processor time from descriptors to matches that passed the ratio test
    features:  of each photo
    matches, links: of each pair, before and after a homography was sought
    right:     of each pair, whether each kept match (m,) is right; None where there is no reference
    errors:    (n,) px between where homography and reference put points, over all links; None where nothing judges
    """

    detector: str
    matcher: str
    detect_ms: tuple[float, ...]
    match_ms: tuple[float, ...]
    features: tuple[Features, ...]
    matches: tuple[PutativeMatch, ...]
    links: tuple[Link, ...]
    right: tuple[NDArray[np.bool_], ...] | None
    errors: NDArray[np.float64] | None

    @property
    def linked(self) -> int:
        """How many pairs a homography links."""
        return sum(isinstance(link, VerifiedMatch) for link in self.links)

    @property
    def right_share(self) -> float | None:
        """Share of the kept matches that are right."""
        every = np.concatenate(self.right) if self.right else np.zeros(0)
        return float(every.mean()) if len(every) else None

    @property
    def error(self) -> float | None:
        """px, median."""
        return float(np.median(self.errors)) if self.errors is not None and len(self.errors) else None

    def to_json(self) -> dict[str, Any]:
        """The figures: means of a photo or of a pair, times medians."""
        return {
            "detector": self.detector,
            "matcher": self.matcher,
            "key_points": float(np.mean([len(one) for one in self.features])),
            "detect_ms": float(np.median(self.detect_ms)),
            "descriptor_bytes": float(np.mean([one.descriptors.nbytes for one in self.features])),
            "match_ms": float(np.median(self.match_ms)),
            "raw": float(np.mean([len(one.raw) for one in self.matches])),
            "kept": float(np.mean([len(one.pairs) for one in self.matches])),
            "verified": float(np.mean([link.inliers if link else 0 for link in self.links])),
            "linked": self.linked,
            "right": self.right_share,
            "error": self.error,
            "licence": LICENCES[self.detector],
        }


@dataclass(frozen=True)
class Contest:
    """All trials, on the same pairs (indices into `photos`).

    reference: what judges; None where the photos could not be aligned, which `failure` tells
    """

    photos: tuple[Photo, ...]
    pairs: tuple[Pair, ...]
    trials: tuple[Trial, ...]
    reference: Alignment | None
    failure: PanostitchError | None

    @property
    def best_pair(self) -> int:
        """Number of the pair that has most verified matches, over all trials."""
        return int(np.argmax(np.sum([[link.inliers for link in trial.links] for trial in self.trials], axis=0)))

    def to_json(self) -> dict[str, Any]:
        """The contest for `--json`."""
        reference = self.reference
        return {
            "photos": [photo.name for photo in self.photos],
            "pairs": [[self.photos[n].name for n in pair] for pair in self.pairs],
            "left_out": [vars(photo) for photo in reference.left_out] if reference else [],
            "reference": {"model": reference.model, "rms": reference.rms} if reference else None,
            "trials": [trial.to_json() for trial in self.trials],
        }


@dataclass(frozen=True)
class _Read:
    """What a photo's source yielded at the one scale that is asked for, so that reading it is not timed."""

    pixels: Pixels
    mask: Pixels | None

    def read(self, scale: float = 1.0) -> tuple[Pixels, Pixels | None]:
        """The same, whatever the scale."""
        del scale
        return self.pixels, self.mask


def hold(photos: Sequence[Photo], options: Options, *, run: Executor = serial, trace: Trace = silent) -> Contest:
    """Try every detector with every matcher; the options hold for all, their detector and matcher for the reference.

    Pairs are those that the reference links, or without one all that deserve a look. Raises InputError where a photo
    cannot be read.
    """
    reference, failure = _aligned(photos, options, run, trace)
    if reference:
        photos = reference.photos
    found = {
        name: [
            _detected(photo, Options.of(**{**vars(options.features), "detector": name}).features)
            for photo in run.progress(photos, total=len(photos), label=f"Trying {name}")
        ]
        for name in DETECTORS
    }
    first = [features for features, _ in next(iter(found.values()))]
    pairs = (
        [(link.i, link.j) for link in reference.links]
        if reference
        else choose_pairs(photos, first, seed=options.matching.seed)
    )
    combinations = list(product(DETECTORS, MATCHERS))
    work = partial(_trial, photos, pairs, found, options, reference)
    trials = run.progress(map(work, combinations), total=len(combinations), label="Trying matchers")
    return Contest(tuple(photos), tuple(pairs), tuple(trials), reference, failure)


def _aligned(
    photos: Sequence[Photo], options: Options, run: Executor, trace: Trace
) -> tuple[Alignment | None, PanostitchError | None]:
    try:
        return pipeline.align(photos, options, run=run, trace=trace), None
    except (NoOverlapError, AlignmentError) as error:
        return None, error


def _detected(photo: Photo, options: FeatureOptions) -> tuple[Features, float]:
    """Key points of a photo, and the milliseconds that they took."""
    in_memory = replace(photo, source=_Read(*photo.source.read(read_scale(photo, options))))
    return _timed(partial(detect_one, in_memory, options))


def _trial(
    photos: Sequence[Photo],
    pairs: Sequence[Pair],
    found: dict[str, list[tuple[Features, float]]],
    options: Options,
    reference: Alignment | None,
    names: tuple[str, str],
) -> Trial:
    """One detector (a name in `found`) with one matcher."""
    detector, matcher = names
    features = [features for features, _ in found[detector]]
    matching = Options.of(**{**vars(options.matching), "matcher": matcher}).matching
    timed = [_timed(partial(match, features, [pair], matching)) for pair in pairs]
    matches = [one for (one,), _ in timed]
    links = verify(photos, features, matches, matching)
    cameras = reference.cameras if reference else None
    return Trial(
        detector,
        matcher,
        tuple(ms for _, ms in found[detector]),
        tuple(ms for _, ms in timed),
        tuple(features),
        tuple(matches),
        tuple(links),
        tuple(_right(cameras, features, one) for one in matches) if cameras else None,
        np.concatenate([np.zeros(0), *(errors_of(cameras, link) for link in links)]) if cameras else None,
    )


def _timed(work: Callable[[], Result]) -> tuple[Result, float]:
    """What comes of it, and milliseconds of the processor: other programs that run at the time do not count."""
    start = time.process_time()
    result = work()
    return result, 1000 * (time.process_time() - start)


def _right(cameras: Sequence[Camera], features: Sequence[Features], match: PutativeMatch) -> NDArray[np.bool_]:
    """Which of the kept matches (m,) of a pair are where the cameras see them."""
    here = features[match.i].xy[match.pairs[:, 0]].astype(np.float64)
    there = cameras[match.j].project(cameras[match.i].rays(here))
    off = np.linalg.norm(there - features[match.j].xy[match.pairs[:, 1]], axis=1)
    return np.asarray(off <= RIGHT * max(cameras[match.j].size))  # NaN, which no camera sees, is not


def errors_of(cameras: Sequence[Camera], link: Link) -> NDArray[np.float64]:
    """Distances (n,) px in photo j between where the homography and the cameras put a grid of points; none unlinked."""
    if not isinstance(link, VerifiedMatch):
        return np.zeros(0)
    here, there = cameras[link.i], cameras[link.j]
    plane = Camera(here.size, 1.0, (0.0, 0.0), np.eye(3)), Camera(there.size, 1.0, (0.0, 0.0), link.j_from_i)
    return pair_errors((here, there), plane)
