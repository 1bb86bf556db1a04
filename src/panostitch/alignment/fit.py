"""A solution under one model, and how it follows its control points."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from panostitch.alignment.bundle import Freedom
from panostitch.alignment.distances import distances
from panostitch.alignment.initialise import holds_together, spanning_tree
from panostitch.alignment.planar import planar_cameras
from panostitch.alignment.residuals import thinned
from panostitch.alignment.turning import KEY_POINT_NOISE, Turning, freed, settled, turning_cameras
from panostitch.model.alignment import Model
from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints, VerifiedMatch
from panostitch.model.photo import Photo

Floats = NDArray[np.float64]

CONTRADICTION = 4.0  # times the median error of all links: a link that is further off speaks of another scene
MIN_CONTRADICTION = 0.03  # of the photo's length: parallax makes true links differ by this much
FAR_BETTER = 0.5  # times the errors before: those of two true rings, held by hand, fell to 0.64 and 0.79 once open
CLOSE = 3.0  # times the median error: control points within it count fully
SHARPER = 0.7  # times the noise before: errors that have become this much smaller are looked at again
FAR = 6.0  # times the median error of its pair: a control point beyond it is none
CLOSEST = 0.1  # px, and at least these


@dataclass(frozen=True)
class Fit:
    """Cameras under a model, the links they rest on, and for a turning camera what was free."""

    model: Model
    cameras: tuple[Camera, ...]
    links: tuple[VerifiedMatch, ...]
    freedom: Freedom | None = None

    def errors(self, points: Sequence[ControlPoints]) -> Floats:
        """Distances (n,) px of control points under the cameras."""
        return np.concatenate(distances(self.cameras, points))


def rough_fit(model: Model, photos: Sequence[Photo], links: Sequence[VerifiedMatch], *, scale: float) -> Fit | None:
    """The solution for matched key points with this noise (`scale`, px); None where no lens explains them."""
    points = [thinned(link) for link in links]
    if model == "rotation":
        turning = turning_cameras(photos, links, scale=scale)
        return Fit(model, turning.cameras, tuple(links), turning.freedom) if turning else None
    tree = spanning_tree(len(photos), links)
    return Fit(model, planar_cameras(photos, points, tree, kind=model, loss_scale=scale).cameras, tuple(links))


def followed(
    fit: Fit, photos: Sequence[Photo], points: Sequence[ControlPoints], *, scale: float, free: bool = False
) -> Fit:
    """The fit adjusted to other control points, from where it is; `free` lets more of a lens vary where that pays."""
    if fit.freedom is not None:
        start = Turning(fit.cameras, fit.freedom)
        turning = freed(photos, start, points, scale=scale) if free else settled(start, points, scale=scale)
        return replace(fit, cameras=turning.cameras, freedom=turning.freedom)
    if fit.model == "rotation":
        raise ValueError("of a turning camera it must be known what is free")
    tree = spanning_tree(len(photos), fit.links)
    solution = planar_cameras(photos, points, tree, kind=fit.model, loss_scale=scale, start=fit.cameras)
    return replace(fit, cameras=solution.cameras)


def without_contradictions(fit: Fit, photos: Sequence[Photo], *, scale: float) -> Fit:
    """The fit without links that contradict all others: repeated windows make confident wrong links.

    The worst links are dropped, as long as the others hold the photos together, until all agree.
    """
    tolerated = MIN_CONTRADICTION * float(np.median([max(photo.size) for photo in photos]))
    while True:
        errors = distances(fit.cameras, [thinned(link) for link in fit.links])
        medians = np.array([np.median(one) for one in errors])
        limit = max(CONTRADICTION * float(np.median(medians)), tolerated)
        kept = list(fit.links)
        # half of them at once: a link that only suffers from a wrong one recovers
        offenders = [fit.links[n] for n in np.argsort(-medians, kind="stable") if medians[n] > limit]
        for link in offenders[: -(-len(offenders) // 2)]:
            rest = [other for other in kept if other is not link]
            if holds_together(len(photos), rest):
                kept = rest
        if len(kept) == len(fit.links):
            return fit
        fit = followed(replace(fit, links=tuple(kept)), photos, [thinned(link) for link in kept], scale=scale)


def without_false_closure(fit: Fit, photos: Sequence[Photo], *, scale: float) -> Fit:
    """The fit without a weak link that closes a long way round, if all others agree far better without it.

    On a ring with a wrong link no link stands out: focal lengths and all the turns give way a little. Short cycles were
    judged by the links themselves (matching.cycles); a long one leaves a homography each too much freedom for that.
    """
    before = _beyond_noise(fit, fit.links, scale)
    weak = [link for link in _on_no_short_cycle(fit.links) if link.strength < 1] if before else []
    if not weak:
        return fit
    doubted = min(weak, key=lambda link: link.strength)
    rest = tuple(link for link in fit.links if link is not doubted)
    opened = rough_fit(fit.model, photos, rest, scale=scale) if holds_together(len(photos), rest) else None
    if opened is None or _beyond_noise(opened, rest, scale) > FAR_BETTER * before:
        return fit
    return without_false_closure(without_contradictions(opened, photos, scale=scale), photos, scale=scale)


def _on_no_short_cycle(links: Sequence[VerifiedMatch]) -> list[VerifiedMatch]:
    """The links that lie on no triangle and on no square."""
    beside: dict[int, set[int]] = {}
    for link in links:
        beside.setdefault(link.i, set()).add(link.j)
        beside.setdefault(link.j, set()).add(link.i)
    return [
        link
        for link in links
        for ends in [beside[link.j] - {link.i}]
        if not any(ends & (beside[photo] | {photo}) for photo in beside[link.i] - {link.j})
    ]


def _beyond_noise(fit: Fit, links: Sequence[VerifiedMatch], scale: float) -> float:
    """The typical error px of a typical link, less what the noise of key points adds to it."""
    errors = distances(fit.cameras, [thinned(link) for link in links])
    typical = float(np.median([np.median(one) for one in errors]))
    return float(np.sqrt(max(0.0, typical**2 - (KEY_POINT_NOISE * scale) ** 2)))


def refitted(fit: Fit, photos: Sequence[Photo], points: Sequence[ControlPoints]) -> Fit:
    """The fit adjusted to control points whose errors set the scale themselves."""
    while True:
        scale = noise_scale(fit, points)
        before, fit = fit, followed(fit, photos, points, scale=scale, free=True)
        # what one lens explains may have hidden that another one would explain more
        if fit.freedom == before.freedom or noise_scale(fit, points) > SHARPER * scale:
            break
    return settled_again(fit, photos, points)


def settled_again(fit: Fit, photos: Sequence[Photo], points: Sequence[ControlPoints]) -> Fit:
    """The fit adjusted to control points on the scale of their own errors, with nothing more freed."""
    return followed(fit, photos, points, scale=noise_scale(fit, points))


def pruned(fit: Fit, points: Sequence[ControlPoints], used: Sequence[ControlPoints]) -> list[ControlPoints]:
    """The control points without those that are far off even for their pair: something moved there.

    `used` are those that the fit rests on.
    """
    scale = noise_scale(fit, used)
    return [
        pair.take(errors <= max(FAR * float(np.median(errors)), scale))
        for pair, errors in zip(points, distances(fit.cameras, points), strict=True)
    ]


def noise_scale(fit: Fit, points: Sequence[ControlPoints]) -> float:
    """Error (px) beyond which control points count less and less."""
    return max(CLOSE * float(np.median(fit.errors(points))), CLOSEST)
