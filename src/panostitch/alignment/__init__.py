"""Stage 3: verified matches to cameras."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from panostitch.alignment.bundle import standard_errors
from panostitch.alignment.distances import rms
from panostitch.alignment.elastic import elastic
from panostitch.alignment.fit import (
    Fit,
    followed,
    noise_scale,
    pruned,
    refitted,
    rough_fit,
    settled_again,
    without_contradictions,
    without_false_closure,
)
from panostitch.alignment.model_choice import (
    NOTICEABLE,
    Candidate,
    Choice,
    candidate,
    choose,
    flat_parameters,
    flat_to_try,
)
from panostitch.alignment.pictures import Pictures, pictures_of
from panostitch.alignment.refine import refined
from panostitch.alignment.residuals import thinned
from panostitch.alignment.straighten import straighten
from panostitch.errors import AlignmentError
from panostitch.model.alignment import Alignment, LeftOut, LinkSummary, Model, PairTried, Uncertainty
from panostitch.model.match import ControlPoints, VerifiedMatch
from panostitch.model.photo import Photo
from panostitch.options import AlignmentOptions
from panostitch.runtime.executor import Executor, serial
from panostitch.runtime.trace import Trace, silent

__all__ = ["align_group"]

Floats = NDArray[np.float64]

LOSS_SCALE = 2.0  # working px: about the noise of a key point, so that true matches all count fully
MAX_RMS = 12.0  # working px: an alignment that is this far off has not been found
POINTS_PER_PHOTO = 300  # control points to be measured again, over all links of a photo
MOST_POINTS, FEWEST_POINTS = 100, 40  # of one link
SHOWS = 0.5  # px: where 90 % of the control points that were measured are nearer, the photos need no bending
HELD_BACK = 8  # of so many control points one is kept to judge by,
JUDGED_FROM = 24  # in links that have at least this many


def align_group(
    photos: Sequence[Photo],
    links: Sequence[VerifiedMatch],
    options: AlignmentOptions,
    *,
    pixel_size: float,
    left_out: Sequence[LeftOut] = (),
    pairs: Sequence[PairTried] = (),
    run: Executor = serial,
    trace: Trace = silent,
) -> Alignment:
    """Cameras of photos that the links (indices into `photos`) hold together.

    `pixel_size` is the size of a working pixel in px of the photos, the unit of the matches' noise; `left_out` and
    `pairs` are for the record. Raises AlignmentError where no cameras explain the matches, InputError where a photo
    cannot be read any more.
    """
    rough, choice = _rough(photos, links, options, pixel_size)
    pictures = pictures_of(photos)
    points, vague = _control_points(pictures, rough, options, pixel_size, run)
    used, held = _split(points)
    fit = refitted(rough, photos, used)
    used, held = pruned(fit, used, used), pruned(fit, held, used)
    fit = settled_again(fit, photos, used)
    solved = replace(fit, cameras=straighten(fit.cameras)) if _is_to_level(fit, options) else fit
    kept = {(link.i, link.j) for link in fit.links}
    given_up = [thinned(link) for link in links if (link.i, link.j) not in kept]
    alignment = replace(
        _described(solved, photos, used, held),
        left_out=tuple(left_out),
        reason=choice.reason,
        dropped=tuple(_summary(solved, pair) for pair in given_up),
        pairs=tuple(pairs),
    )
    trace("alignment.solved", alignment=alignment, residuals={"rms": alignment.rms, "p95": alignment.p95})
    if options.local_warp == "none" or _explains(solved, points, vague, pixel_size):
        return alignment
    return _bent(alignment, pictures, points, run, trace)


def _explains(fit: Fit, points: Sequence[ControlPoints], vague: Sequence[bool], pixel_size: float) -> bool:
    """Whether the cameras alone explain nine in ten of the control points, each as far as it can tell."""
    limits = [LOSS_SCALE * pixel_size if noisy else SHOWS for noisy in vague]
    return bool(np.percentile(fit.errors(points) / np.repeat(limits, [len(pair) for pair in points]), 90) < 1)


def _bent(
    alignment: Alignment, pictures: Pictures, points: Sequence[ControlPoints], run: Executor, trace: Trace
) -> Alignment:
    """The alignment with a mesh for each photo where that helps. The control points are all there are: those that
    were pruned may be the ones that show parallax."""
    cameras, warp = elastic(pictures, alignment.cameras, points, run=run)
    bent = replace(alignment, cameras=cameras if warp.used else alignment.cameras, local_warp=warp)
    trace("alignment.bent", alignment=bent)
    return bent


def _is_to_level(fit: Fit, options: AlignmentOptions) -> bool:
    return options.straighten == "auto" and fit.model == "rotation"


def _described(
    fit: Fit, photos: Sequence[Photo], used: Sequence[ControlPoints], held: Sequence[ControlPoints]
) -> Alignment:
    """The cameras with what their control points say of them."""
    points = _together(used, held)
    errors, judged = fit.errors(points), fit.errors(held) if held else None
    return Alignment(
        fit.model,
        tuple(photos),
        fit.cameras,
        links=tuple(_summary(fit, pair) for pair in points),
        left_out=(),
        rms=rms(errors),
        p95=_p95(errors),
        control_points=tuple(points),
        held_back_rms=None if judged is None else rms(judged),
        held_back_p95=None if judged is None else _p95(judged),
        uncertainties=_uncertainties(fit, used),
    )


def _rough(
    photos: Sequence[Photo], links: Sequence[VerifiedMatch], options: AlignmentOptions, pixel_size: float
) -> tuple[Fit, Choice]:
    """The model and its cameras, from the key points alone."""
    scale = LOSS_SCALE * pixel_size
    turning = _tried("rotation", photos, links, scale) if options.model in ("auto", "rotation") else None
    models: tuple[Model, ...] = ()
    if options.model == "auto":
        rotation = _candidate(turning, turning.links, scale) if turning else None
        if turning and rotation and rotation.noise > NOTICEABLE * pixel_size:
            # a lens that no two photos have alike, or an image shifted against it, must not pass for a flat subject
            turning = followed(turning, photos, [thinned(link) for link in turning.links], scale=scale, free=True)
            rotation = _candidate(turning, turning.links, scale)
        models = flat_to_try(rotation, turning.cameras if turning else (), pixel_size=pixel_size)
    elif options.model != "rotation":
        models = (options.model,)
    tried = [fit for fit in (turning, *(_tried(model, photos, links, scale) for model in models)) if fit]
    if not tried:
        raise AlignmentError(
            "no lens explains how the photos overlap",
            hint="if the subject is flat or the camera moved, try --model homography",
        )
    # what one model gives up may be what speaks against it; what all of them give up speaks of another scene
    kept = {(link.i, link.j) for fit in tried for link in fit.links}
    judges = [link for link in links if (link.i, link.j) in kept]
    choice = choose([_candidate(fit, judges, scale) for fit in tried], pixel_size=pixel_size)
    fit = next(fit for fit in tried if fit.model == choice.model)
    error = rms(fit.errors([thinned(link) for link in fit.links]))
    if not error <= MAX_RMS * pixel_size:
        raise _failure(photos, error, pixel_size)
    return fit, choice


def _tried(model: Model, photos: Sequence[Photo], links: Sequence[VerifiedMatch], scale: float) -> Fit | None:
    """The solution under a model, if there is one."""
    fit = rough_fit(model, photos, links, scale=scale)
    if fit is None:
        return None
    return without_false_closure(without_contradictions(fit, photos, scale=scale), photos, scale=scale)


def _candidate(fit: Fit, links: Sequence[VerifiedMatch], scale: float) -> Candidate:
    unknowns = fit.freedom.parameters if fit.freedom else flat_parameters(fit.model, len(fit.cameras))
    return candidate(fit.model, fit.cameras, [thinned(link) for link in links], unknowns, scale=scale)


def _control_points(
    pictures: Pictures, fit: Fit, options: AlignmentOptions, pixel_size: float, run: Executor
) -> tuple[list[ControlPoints], list[bool]]:
    """What the cameras are finally adjusted to, pair by pair, and where it is only as exact as key points are."""
    if options.refine == "none":
        return [thinned(link) for link in fit.links], [False] * len(fit.links)
    share = POINTS_PER_PHOTO * len(fit.cameras) // (2 * len(fit.links))
    count = int(np.clip(share, FEWEST_POINTS, MOST_POINTS))
    points = [thinned(link, count) for link in fit.links]
    found = refined(pictures, fit.cameras, points, pixel_size=pixel_size, run=run)
    # what cannot be measured is given back as it was
    return found, [new is old for new, old in zip(found, points, strict=True)]


def _split(points: Sequence[ControlPoints]) -> tuple[list[ControlPoints], list[ControlPoints]]:
    """Control points to adjust to, and those to judge by."""
    used, held = [], []
    for pair in points:
        aside = (np.arange(len(pair)) % HELD_BACK == HELD_BACK // 2) & (len(pair) >= JUDGED_FROM)
        used.append(pair.take(~aside))
        if aside.any():
            held.append(pair.take(aside))
    return used, held


def _uncertainties(fit: Fit, points: Sequence[ControlPoints]) -> tuple[Uncertainty, ...]:
    """Standard errors of turning cameras; a flat subject has no directions to be wrong about."""
    if fit.freedom is None:
        return ()
    return standard_errors(fit.cameras, points, fit.freedom, loss_scale=noise_scale(fit, points))


def _together(used: Sequence[ControlPoints], held: Sequence[ControlPoints]) -> list[ControlPoints]:
    """The control points of each pair, those to judge by last."""
    aside = {(pair.i, pair.j): pair for pair in held}
    return [pair.joined(aside[pair.i, pair.j]) if (pair.i, pair.j) in aside else pair for pair in used]


def _failure(photos: Sequence[Photo], error: float, pixel_size: float) -> AlignmentError:
    names = ", ".join(photo.name for photo in photos[:4]) + (", ..." if len(photos) > 4 else "")
    return AlignmentError(
        f"{names}: the photos match, but no cameras explain the matches",
        details=(f"they are {error / pixel_size:.0f} working pixels off; {MAX_RMS:.0f} is the most that is taken",),
        hint="was the camera moved sideways between photos? Try --model homography, or fewer photos",
    )


def _summary(fit: Fit, points: ControlPoints) -> LinkSummary:
    return LinkSummary(points.i, points.j, len(points), rms(fit.errors([points])))


def _p95(errors: Floats) -> float:
    return float(np.percentile(errors, 95))
