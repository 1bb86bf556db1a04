"""A turning camera: from links to cameras that share one point, with as much of a lens as the evidence pays for."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from panostitch.alignment.bundle import Freedom, Solution, adjust
from panostitch.alignment.initialise import focal_candidates, initial_cameras, lens_groups, spanning_tree
from panostitch.alignment.residuals import thinned
from panostitch.geometry import lens
from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints, VerifiedMatch
from panostitch.model.photo import Photo

MATCHES_TO_START = 40  # of each link: enough to tell a good start from a bad one
START_STEPS = 15
START_TOLERANCE = 1e-3
WIDE = 8  # times the final loss scale: a rough start is not to be taken for a heap of outliers
LENS_EVIDENCE = 0.1  # share by which a freed parameter must lower the cost: parallax poses as distortion too
MAX_DISTORTION = 0.2  # at the corner of the photo, as a share of the radius
MIN_FIELD, MAX_FIELD = 0.5, 170.0  # degrees across one photo that a lens can have


def turning_cameras(
    photos: Sequence[Photo], links: Sequence[VerifiedMatch], *, scale: float
) -> tuple[Camera, ...] | None:
    """The best cameras that turn about one point; None if every start ends in an impossible lens.

    `scale` is the noise of a match, px: errors well beyond it count little.
    """
    groups = tuple(lens_groups(photos))
    freedom = Freedom(focals=groups, lenses=groups)
    start = _best_start(photos, links, freedom, scale)
    if start is None:
        return None
    observations = [thinned(link) for link in links]
    solution = adjust(start, observations, freedom, loss_scale=scale)
    each_its_own = tuple(range(len(photos)))
    for richer in (
        Freedom(groups, groups, terms=1),
        Freedom(groups, groups, terms=2),
        Freedom(each_its_own, groups),  # zoom, or a lens that breathes as it focuses
    ):
        if len(photos) == 2 and (richer.terms == 2 or richer.focals != groups):
            continue  # two photos cannot tell
        richer = replace(richer, terms=max(richer.terms, freedom.terms))
        candidate = adjust(solution.cameras, observations, richer, loss_scale=scale)
        if _possible(candidate) and candidate.cost < (1 - LENS_EVIDENCE) * solution.cost:
            solution, freedom = candidate, richer
    return solution.cameras


def _best_start(
    photos: Sequence[Photo], links: Sequence[VerifiedMatch], freedom: Freedom, scale: float
) -> tuple[Camera, ...] | None:
    """Cameras from the focal length, among all candidates, from which the adjustment gets farthest."""
    tree = spanning_tree(len(photos), links)
    few = [thinned(link, MATCHES_TO_START) for link in links]
    solutions = []
    for focals in focal_candidates(photos, links):
        cameras: Sequence[Camera] = initial_cameras(photos, focals, tree)
        for loss_scale in (WIDE * scale, scale):
            solution = _roughly(cameras, few, freedom, loss_scale)
            cameras = solution.cameras
        if _possible(solution):
            solutions.append(solution)
    return min(solutions, key=lambda s: s.cost).cameras if solutions else None


def _roughly(
    cameras: Sequence[Camera], observations: Sequence[ControlPoints], freedom: Freedom, scale: float
) -> Solution:
    return adjust(cameras, observations, freedom, loss_scale=scale, max_steps=START_STEPS, tolerance=START_TOLERANCE)


def _possible(solution: Solution) -> bool:
    """Whether lenses like these could exist: sane fields of view, and no fold inside the photos."""
    return all(map(_possible_lens, solution.cameras))


def _possible_lens(camera: Camera) -> bool:
    field = np.rad2deg(2 * np.arctan(max(camera.size) / 2 / camera.focal))
    corner = float(np.hypot(*camera.size)) / 2 / camera.focal
    slope = lens.slope(np.array(corner**2), camera.k1, camera.k2)
    distortion = abs(camera.k1) * corner**2 + abs(camera.k2) * corner**4
    return bool(MIN_FIELD < field < MAX_FIELD and slope > 0.2 and distortion < MAX_DISTORTION)
