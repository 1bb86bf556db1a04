"""How far a cycle of homographies is from closing, and how far it may be.

Points of one link are sent the other way round the cycle and compared with where the link has them. A homography is
good where its matches lie and ever less so beyond; its own normal equations say how much, and that, carried round the
cycle, is the error to be expected. Pixels are taken as rays of a lens with a focal length of the photo's long side, so
that photos all around cause no infinities; errors are in that unit, photo lengths.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from panostitch.matching.web import Cycle
from panostitch.model.match import VerifiedMatch
from panostitch.model.photo import Photo

Floats = NDArray[np.float64]
Integers = NDArray[np.intp]

SAMPLES = 24  # matches of a link that stand for all
SENT = 8  # of them are sent round
# Photo lengths; what parallax and distortion make of a homography where its matches lie, rms.
MODEL_ERROR = 0.01
# So many matches that are off by this, each on its own, would leave a homography as uncertain as it is.
INDEPENDENT = 8.0
SANE = 0.3  # spread of the entries of any homography about what is measured: bounds what thin overlaps leave open
BATCH = 2048  # cycles at once


@dataclass(frozen=True)
class Judged:
    """A cycle, by how much (photo lengths) it fails to close, how much was to be expected, and the one by the other."""

    cycle: Cycle
    error: float
    expected: float
    ratio: float


@dataclass(frozen=True)
class Steps:
    """Links as steps from photo to photo, each in both directions.

    number:    of the step from one photo (first) to the next (second)
    turn:      (s, 3, 3) homography of rays
    freedom:   (s, 9, 3, 3) ways in which it may be off, each by one standard deviation
    start, end: (s, SENT, 3) unit rays of matches in the one and in the other photo
    """

    number: dict[tuple[int, int], int]
    turn: Floats
    freedom: Floats
    start: Floats
    end: Floats


def judge(steps: Steps, cycles: Sequence[Cycle]) -> list[Judged]:
    """Every cycle (all of the same length) as its best supported link sees it."""
    if not cycles:
        return []
    rings = np.array([cycle.photos for cycle in cycles])
    rounds = [_round(steps, np.roll(rings, -shift, axis=1)) for shift in range(rings.shape[1])]
    error, expected, ratio = (np.array(values) for values in zip(*rounds, strict=True))
    best = expected.argmin(0)
    return [
        Judged(cycle, *(float(values[best[n], n]) for values in (error, expected, ratio)))
        for n, cycle in enumerate(cycles)
    ]


def _round(steps: Steps, rings: Integers) -> tuple[Floats, Floats, Floats]:
    """Error, expected error, and ratio (n,) of cycles (n, m): the link from the first photo to the second is
    compared with the way round the others."""
    backwards = np.column_stack([rings[:, :1], rings[:, :0:-1]]).tolist()
    path = np.array([[steps.number[step] for step in pairwise(way)] for way in backwards])
    link = np.array([steps.number[way[0], way[-1]] for way in backwards])
    parts = [
        _send(steps, link[first : first + BATCH], path[first : first + BATCH]) for first in range(0, len(rings), BATCH)
    ]
    error, expected, ratio = (np.concatenate(values) for values in zip(*parts, strict=True))
    return error, expected, ratio


def _send(steps: Steps, link: Integers, path: Integers) -> tuple[Floats, Floats, Floats]:
    """The medians over the points of n links (n,) that are sent along n paths (n, m)."""
    ray, true = steps.start[link], steps.end[link]
    covariance = np.zeros((*ray.shape, 3))
    for step in path.T:
        off = np.moveaxis(ray[:, None] @ np.swapaxes(steps.freedom[step], 2, 3), 1, 3)
        turn = steps.turn[step][:, None]
        covariance = turn @ covariance @ np.swapaxes(turn, 2, 3) + off @ np.swapaxes(off, 2, 3)
        ray = (turn @ ray[..., None])[..., 0]
        length = np.linalg.norm(ray, axis=2, keepdims=True)  # of no meaning, but it must not run away
        ray, covariance = ray / length, covariance / length[..., None] ** 2
    along = np.einsum("npk,npkl,npl->np", ray, covariance, ray)
    expected = np.sqrt(np.trace(covariance, axis1=2, axis2=3) - along + MODEL_ERROR**2)
    error = np.arctan2(np.linalg.norm(np.cross(ray, true), axis=2), (ray * true).sum(2))
    return np.median(error, axis=1), np.median(expected, axis=1), np.median(error / expected, axis=1)


def steps_of(photos: Sequence[Photo], links: Sequence[VerifiedMatch]) -> Steps:
    """The links (indices into `photos`) as steps."""
    number = {pair: n for n, pair in enumerate(p for link in links for p in ((link.i, link.j), (link.j, link.i)))}
    lenses = {n: _lens(photos[n]) for pair in number for n in pair}
    back = {n: np.asarray(np.linalg.inv(lens), np.float64) for n, lens in lenses.items()}
    first, second, turn = [], [], []
    for link in links:
        chosen = np.linspace(0, link.inliers - 1, SAMPLES).round().astype(int)
        a, b = _rays(back[link.i], link.xy_i[chosen]), _rays(back[link.j], link.xy_j[chosen])
        forth = back[link.j] @ link.j_from_i @ lenses[link.i]
        first += [a, b]
        second += [b, a]
        turn += [forth, np.linalg.inv(forth)]
    start, end = np.array(first), np.array(second)
    scaled = _scaled(np.array(turn), start)
    sent = slice(None, None, SAMPLES // SENT)
    return Steps(number, scaled, _freedom(scaled, start), _unit(start[:, sent]), _unit(end[:, sent]))


def _lens(photo: Photo) -> Floats:
    """Pixels from rays (3, 3)."""
    side = float(max(photo.size))
    return np.array([[side, 0, (photo.size[0] - 1) / 2], [0, side, (photo.size[1] - 1) / 2], [0, 0, 1]])


def _rays(lens_back: Floats, xy: Floats) -> Floats:
    return np.asarray(xy @ lens_back[:, :2].T + lens_back[:, 2])


def _unit(rays: Floats) -> Floats:
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))


def _scaled(turn: Floats, start: Floats) -> Floats:
    """Homographies (s, 3, 3) whose depth is one in the middle of their matches: that settles factor and sign."""
    depth = np.einsum("sk,sk->s", turn[:, 2], start.mean(1))
    return np.asarray(turn / np.where(abs(depth) > 1e-9, depth, 1.0)[:, None, None])


def _freedom(turn: Floats, start: Floats) -> Floats:
    """Ways (s, 9, 3, 3) in which homographies may be off: their covariance is the sum of the outer products."""
    image = start @ np.swapaxes(turn, 1, 2)
    depth = np.where(abs(image[..., 2:]) > 1e-6, image[..., 2:], 1e-6)
    xy = image[..., :2] / depth
    point = start / depth
    slope = np.zeros((*start.shape[:2], 2, 9))
    slope[:, :, 0, 0:3] = slope[:, :, 1, 3:6] = point
    slope[:, :, :, 6:9] = -xy[..., None] * point[:, :, None, :]
    information = np.einsum("snki,snkj->sij", slope, slope) * (INDEPENDENT / start.shape[1] / MODEL_ERROR**2)
    covariance = np.linalg.inv(information + np.eye(9) / SANE**2)
    return np.swapaxes(np.linalg.cholesky(covariance), 1, 2).reshape(-1, 9, 3, 3)
