"""Stage 3: verified matches to cameras."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from panostitch.alignment.bundle import distances
from panostitch.alignment.initialise import holds_together, spanning_tree
from panostitch.alignment.model_choice import Choice, choose
from panostitch.alignment.planar import planar_cameras
from panostitch.alignment.residuals import thinned
from panostitch.alignment.straighten import straighten
from panostitch.alignment.turning import turning_cameras
from panostitch.errors import AlignmentError
from panostitch.model.alignment import Alignment, LeftOut, LinkSummary
from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints, VerifiedMatch
from panostitch.model.photo import Photo
from panostitch.options import AlignmentOptions
from panostitch.runtime.trace import Trace, silent

__all__ = ["align_group"]

LOSS_SCALE = 2.0  # working px: about the noise of a key point, so that true matches all count fully
MAX_RMS = 12.0  # working px: an alignment that is this far off has not been found
CONTRADICTION = 4.0  # times the median error of all links: a link that is further off speaks of another scene
MIN_CONTRADICTION = 4.0  # working px: parallax makes links differ by this much

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
        turning = _consistent(photos, links, partial(turning_cameras, scale=scale), pixel_size)
    if options.model == "homography" or (options.model == "auto" and len(photos) == 2):
        flat = _consistent(photos, links, partial(_flat, scale=scale), pixel_size)
    fit, choice = _chosen(turning, flat, pixel_size)
    if not fit.rms <= MAX_RMS * pixel_size:
        raise _failure(photos, fit, pixel_size)
    alignment = _described(photos, links, fit, choice, straightened=options.straighten == "auto", left_out=left_out)
    trace("alignment.solved", alignment=alignment, residuals={"rms": fit.rms, "p95": fit.p95})
    return alignment


def _described(
    photos: Sequence[Photo],
    links: Sequence[VerifiedMatch],
    fit: _Fit,
    choice: Choice,
    *,
    straightened: bool,
    left_out: Sequence[LeftOut],
) -> Alignment:
    """The solution with all that is said of it."""
    cameras = straighten(fit.cameras) if straightened and choice.model == "rotation" else fit.cameras
    kept = {(link.i, link.j) for link in fit.links}
    return Alignment(
        choice.model,
        tuple(photos),
        cameras,
        links=tuple(_summary(cameras, thinned(link)) for link in fit.links),
        left_out=tuple(left_out),
        rms=fit.rms,
        p95=fit.p95,
        reason=choice.reason,
        dropped=tuple(_summary(cameras, thinned(link)) for link in links if (link.i, link.j) not in kept),
    )


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
        medians = np.array([np.median(distances(cameras, thinned(link))) for link in kept])
        worst = int(np.argmax(medians))
        limit = max(CONTRADICTION * float(np.median(medians)), MIN_CONTRADICTION * pixel_size)
        rest = kept[:worst] + kept[worst + 1 :]
        if medians[worst] <= limit or not holds_together(len(photos), rest):
            return _fit(cameras, kept)
        kept = rest


def _flat(photos: Sequence[Photo], links: Sequence[VerifiedMatch], *, scale: float) -> tuple[Camera, ...]:
    """The cameras of a flat subject."""
    observations = [thinned(link) for link in links]
    return planar_cameras(photos, observations, spanning_tree(len(photos), links), loss_scale=scale)


def _fit(cameras: tuple[Camera, ...], links: Sequence[VerifiedMatch]) -> _Fit:
    errors = np.concatenate([distances(cameras, thinned(link)) for link in links])
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


def _summary(cameras: Sequence[Camera], observation: ControlPoints) -> LinkSummary:
    errors = distances(cameras, observation)
    return LinkSummary(observation.i, observation.j, len(errors), float(np.sqrt((errors**2).mean())))
