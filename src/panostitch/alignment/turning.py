"""A turning camera: from links to cameras that share one point, with as much of a lens as the evidence pays for."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from panostitch.alignment.bundle import Freedom, Solution, adjust
from panostitch.alignment.distances import distances
from panostitch.alignment.initialise import focal_candidates, initial_cameras, spanning_tree, zoomed_focals
from panostitch.alignment.residuals import thinned
from panostitch.geometry import lens
from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints, VerifiedMatch
from panostitch.model.photo import Photo, lens_groups

MATCHES_TO_START = 40  # of each link: enough to tell a good start from a bad one
START_STEPS = 15
START_TOLERANCE = 1e-3
SAME_END = 0.01  # share of the cost by which two starts that end at the same place may differ
# Times the final loss scale: a rough start is not to be taken for a heap of outliers, nor the link that closes a ring
# for a wrong one while the focal length is off by some per cent.
LOSS_SCALES = (64, 8, 1)
KEY_POINT_NOISE = 0.25  # times the loss scale, median: errors that no other cameras explain better
ZOOM = 1.1  # ratio of focal lengths from which they are taken for different ones
# Share by which what is freed must lower the squares of the errors. Parallax poses as a lens too, best of all as a
# decentred one.
DISTORTION_EVIDENCE, CENTRE_EVIDENCE, FOCAL_EVIDENCE, JOINT_EVIDENCE = 0.1, 0.3, 0.3, 0.5
BETTER_PART = 0.8
NOTHING = 1e-3  # px, an error that needs no explanation
MAX_DISTORTION = 0.1  # at the corner of the photo, as a share of the radius
MAX_DECENTRING = 0.05  # of the photo's diagonal
MIN_FIELD, MAX_FIELD = 0.5, 170.0  # degrees across one photo that a lens can have


@dataclass(frozen=True)
class Turning:
    """Cameras that turn about one point, and what of them was free."""

    cameras: tuple[Camera, ...]
    freedom: Freedom


def turning_cameras(photos: Sequence[Photo], links: Sequence[VerifiedMatch], *, scale: float) -> Turning | None:
    """The best cameras that turn about one point; None if every start ends in an impossible lens.

    `scale` is the noise of a match, px: errors well beyond it count little.
    """
    start = _best_start(photos, links, scale)
    if start is None:
        return None
    return freed(photos, start, [thinned(link) for link in links], scale=scale, distortion_only=True)


def freed(
    photos: Sequence[Photo],
    start: Turning,
    points: Sequence[ControlPoints],
    *,
    scale: float,
    distortion_only: bool = False,
) -> Turning:
    """The cameras adjusted to the points, with as much of a lens freed, step by step, as the evidence pays for.

    `distortion_only` is for key points, whose noise hides the rest.
    """
    freedom = start.freedom
    cameras = adjust(start.cameras, points, freedom, loss_scale=scale).cameras
    least = _square(cameras, points)
    for richer, evidence in _steps(photos):
        wider = _joined(freedom, richer)
        if wider == freedom or (distortion_only and evidence != DISTORTION_EVIDENCE):
            continue
        candidate = adjust(cameras, points, wider, loss_scale=scale)
        square = _square(candidate.cameras, points)
        if _possible(candidate) and square < (1 - evidence) * least - NOTHING**2:
            cameras, freedom, least = candidate.cameras, wider, square
    return Turning(cameras, freedom)


def settled(start: Turning, points: Sequence[ControlPoints], *, scale: float) -> Turning:
    """The cameras adjusted to the points, with nothing more freed."""
    return replace(start, cameras=adjust(start.cameras, points, start.freedom, loss_scale=scale).cameras)


def _square(cameras: Sequence[Camera], points: Sequence[ControlPoints]) -> float:
    """Mean square (px^2) of the better part of the errors: what a lens explains shows there, not among the outliers."""
    square = np.sort(np.concatenate(distances(cameras, points))) ** 2
    return float(square[: max(int(BETTER_PART * len(square)), 1)].mean())


def _steps(photos: Sequence[Photo]) -> Iterator[tuple[Freedom, float]]:
    """What may be freed and the evidence it takes, the most plausible first."""
    groups, each_its_own = tuple(lens_groups(photos)), tuple(range(len(photos)))
    yield Freedom(groups, groups, terms=1), DISTORTION_EVIDENCE
    if len(photos) == 2:
        return  # two photos cannot tell more
    yield Freedom(groups, groups, terms=2), DISTORTION_EVIDENCE
    yield Freedom(groups, groups, centres=True), CENTRE_EVIDENCE
    yield Freedom(each_its_own, groups), FOCAL_EVIDENCE  # zoom, or a lens that breathes as it focuses
    yield Freedom(each_its_own, groups, 2, centres=True), JOINT_EVIDENCE  # each alone may do little


def _joined(freedom: Freedom, richer: Freedom) -> Freedom:
    """All that is free in one or the other."""
    focals = max(freedom.focals, richer.focals, key=lambda numbers: len(set(numbers)))
    return replace(
        freedom, focals=focals, terms=max(freedom.terms, richer.terms), centres=freedom.centres or richer.centres
    )


def _best_start(photos: Sequence[Photo], links: Sequence[VerifiedMatch], scale: float) -> Turning | None:
    """Cameras from the focal length, among all candidates, from which the adjustment gets farthest."""
    tree = spanning_tree(len(photos), links)
    few = [thinned(link, MATCHES_TO_START) for link in links]
    groups, each_its_own = tuple(lens_groups(photos)), tuple(range(len(photos)))
    together = Freedom(focals=groups, lenses=groups)
    best: Start | None = None
    for focals in focal_candidates(photos, links):
        start = _start(initial_cameras(photos, focals, tree, links), few, together, scale)
        if start is None:
            continue
        if _explains_all(start.turning.cameras, few, scale):
            return start.turning
        if best and abs(start.cost - best.cost) < SAME_END * best.cost:
            break  # two starts that end at the same place: the others will too
        best = min(best or start, start, key=lambda s: s.cost)
    if best is None:
        return None
    focals = zoomed_focals(photos, best.turning.cameras[tree.root].focal, tree)
    if max(focals) > ZOOM * min(focals) and len(photos) > 2:
        apart = replace(together, focals=each_its_own)
        start = _start(initial_cameras(photos, focals, tree, links), few, apart, scale)
        best = start if start and start.cost < (1 - FOCAL_EVIDENCE) * best.cost else best
    return best.turning


@dataclass(frozen=True)
class Start:
    """Where the adjustment got to from one start, and its robust cost (px^2) there."""

    turning: Turning
    cost: float


def _start(cameras: Sequence[Camera], points: Sequence[ControlPoints], freedom: Freedom, scale: float) -> Start | None:
    """Roughly adjusted cameras; None where they need an impossible lens."""
    for loss_scale in (scale * times for times in LOSS_SCALES):
        solution = adjust(
            cameras, points, freedom, loss_scale=loss_scale, max_steps=START_STEPS, tolerance=START_TOLERANCE
        )
        cameras = solution.cameras
    return Start(Turning(solution.cameras, freedom), solution.cost) if _possible(solution) else None


def _explains_all(cameras: Sequence[Camera], points: Sequence[ControlPoints], scale: float) -> bool:
    """Whether no other start can do better: the errors are the noise of key points, and no link stands apart."""
    medians = np.array([np.median(errors) for errors in distances(cameras, points)])
    return bool(np.median(medians) < KEY_POINT_NOISE * scale and medians.max() < scale)


def _possible(solution: Solution) -> bool:
    """Whether lenses like these could exist: sane fields of view, and no fold inside the photos."""
    return all(map(_possible_lens, solution.cameras))


def _possible_lens(camera: Camera) -> bool:
    field = np.rad2deg(2 * np.arctan(max(camera.size) / 2 / camera.focal))
    diagonal = float(np.hypot(*camera.size))
    corner = diagonal / 2 / camera.focal
    slope = lens.slope(np.array(corner**2), camera.k1, camera.k2)
    distortion = abs(camera.k1) * corner**2 + abs(camera.k2) * corner**4
    shift = np.hypot(*(np.array(camera.centre) - (np.array(camera.size) - 1) / 2))
    return bool(
        MIN_FIELD < field < MAX_FIELD
        and slope > 0.2
        and distortion < MAX_DISTORTION
        and shift < MAX_DECENTRING * diagonal
    )
