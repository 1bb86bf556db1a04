"""Stage 3: verified matches to cameras."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from panostitch.alignment.bundle import Solution, adjust, distances
from panostitch.alignment.initialise import (
    focal_candidates,
    holds_together,
    initial_cameras,
    lens_groups,
    spanning_tree,
)
from panostitch.alignment.model_choice import Choice, choose
from panostitch.alignment.planar import planar_cameras
from panostitch.alignment.residuals import Observation
from panostitch.alignment.straighten import straighten
from panostitch.errors import AlignmentError
from panostitch.model.alignment import Alignment, LeftOut, LinkSummary
from panostitch.model.camera import Camera
from panostitch.model.match import VerifiedMatch
from panostitch.model.photo import Photo
from panostitch.options import AlignmentOptions
from panostitch.runtime.trace import Trace, silent

__all__ = ["align_group"]

LOSS_SCALE = 2.0  # working px: about the noise of a key point, so that true matches all count fully
MATCHES_PER_LINK = 200  # more make the adjustment slower, not better
MATCHES_TO_START = 40
LENS_EVIDENCE = 0.1  # share by which a lens parameter must lower the cost: parallax poses as distortion too
MAX_DISTORTION = 0.2  # at the corner of the photo, as a share of the radius
MAX_RMS = 12.0  # working px: an alignment that is this far off has not been found
CONTRADICTION = 4.0  # times the median error of all links: a link that is further off speaks of another scene
MIN_CONTRADICTION = 4.0  # working px: parallax makes links differ by this much
MIN_FIELD, MAX_FIELD = 0.5, 170.0  # degrees across one photo that a lens can have

Solve = Callable[[Sequence[Photo], Sequence[VerifiedMatch]], tuple[Camera, ...] | None]


@dataclass(frozen=True)
class _Fit:
    """Cameras with the rms and 95th percentile (px) of the matches under them, and the links they rest on."""

    cameras: tuple[Camera, ...]
    rms: float
    p95: float
    links: tuple[VerifiedMatch, ...]


def align_group(
    photos: Sequence[Photo],
    links: Sequence[VerifiedMatch],
    options: AlignmentOptions,
    *,
    pixel_size: float,
    left_out: Sequence[LeftOut] = (),
    trace: Trace = silent,
) -> Alignment:
    """Cameras of photos that the links (indices into `photos`) hold together.

    `pixel_size` is the size of a working pixel in px of the photos, the unit of the matches' noise. Raises
    AlignmentError where no cameras explain the matches.
    """
    scale = LOSS_SCALE * pixel_size
    turning = flat = None
    if options.model != "homography":
        turning = _consistent(photos, links, partial(_turning, scale=scale), pixel_size)
    if options.model == "homography" or (options.model == "auto" and len(photos) == 2):
        flat = _consistent(photos, links, partial(_flat, scale=scale), pixel_size)
    fit, choice = _chosen(turning, flat, pixel_size)
    if not fit.rms <= MAX_RMS * pixel_size:
        raise _failure(photos, fit, pixel_size)
    cameras = fit.cameras
    if choice.model == "rotation" and options.straighten == "auto":
        cameras = straighten(cameras)
    alignment = Alignment(
        choice.model,
        tuple(photos),
        cameras,
        tuple(_summary(cameras, _thinned(link, MATCHES_PER_LINK)) for link in fit.links),
        tuple(left_out),
        fit.rms,
        fit.p95,
        choice.reason,
    )
    dropped = [link for link in links if link not in fit.links]
    trace("alignment.solved", alignment=alignment, residuals={"rms": fit.rms, "p95": fit.p95}, history=[])
    trace("alignment.dropped", photos=photos, links=dropped)
    return alignment


def _consistent(
    photos: Sequence[Photo], links: Sequence[VerifiedMatch], solve: Solve, pixel_size: float
) -> _Fit | None:
    """The solution without links that contradict all others: repeated windows make confident wrong links.

    The worst link is dropped, as long as the others hold the photos together, until all agree.
    """
    kept = list(links)
    while True:
        cameras = solve(photos, kept)
        if cameras is None:
            return None
        medians = np.array([np.median(distances(cameras, _thinned(link, MATCHES_PER_LINK))) for link in kept])
        worst = int(np.argmax(medians))
        limit = max(CONTRADICTION * float(np.median(medians)), MIN_CONTRADICTION * pixel_size)
        rest = kept[:worst] + kept[worst + 1 :]
        if medians[worst] <= limit or not holds_together(len(photos), rest):
            return _fit(cameras, kept)
        kept = rest


def _flat(photos: Sequence[Photo], links: Sequence[VerifiedMatch], *, scale: float) -> tuple[Camera, ...]:
    """The cameras of a flat subject."""
    observations = [_thinned(link, MATCHES_PER_LINK) for link in links]
    return planar_cameras(photos, observations, spanning_tree(len(photos), links), loss_scale=scale)


def _thinned(link: VerifiedMatch, most: int) -> Observation:
    """At most `most` matches of a link, evenly from all of them: they come spread over the photo."""
    index = np.linspace(0, link.inliers - 1, min(link.inliers, most)).astype(int)
    return Observation(link.i, link.j, link.xy_i[index], link.xy_j[index])


def _turning(photos: Sequence[Photo], links: Sequence[VerifiedMatch], *, scale: float) -> tuple[Camera, ...] | None:
    """The best cameras that turn about one point; None if every start ends in an impossible lens."""
    lenses = lens_groups(photos)
    tree = spanning_tree(len(photos), links)
    few = [_thinned(link, MATCHES_TO_START) for link in links]
    solutions = []
    for focals in focal_candidates(photos, links):
        start = initial_cameras(photos, focals, tree)
        # wide first, so that a rough start is not taken for a heap of outliers
        for loss_scale in (8 * scale, scale):
            solution = adjust(start, few, lenses, free_lens=1, loss_scale=loss_scale, max_steps=15, tolerance=1e-3)
            start = list(solution.cameras)
        if all(_possible(camera) for camera in solution.cameras):
            solutions.append(solution)
    if not solutions:
        return None
    best = min(solutions, key=lambda s: s.cost)
    many = [_thinned(link, MATCHES_PER_LINK) for link in links]
    exact = adjust(best.cameras, many, lenses, free_lens=1, loss_scale=scale)
    return _with_lens(exact, many, lenses, scale).cameras


def _with_lens(
    solution: Solution, observations: Sequence[Observation], lenses: Sequence[int], scale: float
) -> Solution:
    """Free the distortion too, as far as the evidence pays for it."""
    for free_lens in (2, 3):
        richer = adjust(solution.cameras, observations, lenses, free_lens=free_lens, loss_scale=scale)
        possible = all(_possible(camera) for camera in richer.cameras)
        if not possible or richer.cost > (1 - LENS_EVIDENCE) * solution.cost:
            break
        solution = richer
    return solution


def _possible(camera: Camera) -> bool:
    """Whether a lens could exist: a sane field of view, and no fold inside the photo."""
    field = np.rad2deg(2 * np.arctan(max(camera.size) / 2 / camera.focal))
    corner = float(np.hypot(*camera.size)) / 2 / camera.focal
    slope = 1 + corner**2 * (3 * camera.k1 + corner**2 * 5 * camera.k2)
    distortion = abs(camera.k1) * corner**2 + abs(camera.k2) * corner**4
    return bool(MIN_FIELD < field < MAX_FIELD and slope > 0.2 and distortion < MAX_DISTORTION)


def _fit(cameras: tuple[Camera, ...], links: Sequence[VerifiedMatch]) -> _Fit:
    errors = np.concatenate([distances(cameras, _thinned(link, MATCHES_PER_LINK)) for link in links])
    return _Fit(cameras, float(np.sqrt((errors**2).mean())), float(np.percentile(errors, 95)), tuple(links))


def _chosen(turning: _Fit | None, flat: _Fit | None, pixel_size: float) -> tuple[_Fit, Choice]:
    if turning and flat:
        choice = choose(turning.rms, flat.rms, pixel_size=pixel_size)
        return (turning if choice.model == "rotation" else flat), choice
    if turning:
        return turning, choose(turning.rms, None, pixel_size=pixel_size)
    if flat:
        return flat, Choice("homography", f"a flat subject explains the matches to {flat.rms:.2f} px")
    raise AlignmentError(
        "no lens explains how the photos overlap",
        hint="if the subject is flat or the camera moved, try --model homography",
    )


def _failure(photos: Sequence[Photo], fit: _Fit, pixel_size: float) -> AlignmentError:
    names = ", ".join(photo.name for photo in photos[:4]) + (", ..." if len(photos) > 4 else "")
    return AlignmentError(
        f"{names}: the photos match, but no cameras explain the matches",
        details=(f"they are {fit.rms / pixel_size:.0f} working pixels off; {MAX_RMS:.0f} is the most that is taken",),
        hint="was the camera moved sideways between photos? Try --model homography, or fewer photos",
    )


def _summary(cameras: Sequence[Camera], observation: Observation) -> LinkSummary:
    errors = distances(cameras, observation)
    return LinkSummary(observation.i, observation.j, len(errors), float(np.sqrt((errors**2).mean())))
