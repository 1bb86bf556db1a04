"""What a single centre of rotation cannot explain: an elastic mesh for each photo, kept where it clearly helps.

Coarse to fine. Dense flow between the smallest photos (alignment.flow) finds what lies far from where the cameras see
it, the ground at one's feet. Then corners all over the overlaps are measured in the other photo
(alignment.registration), near where the meshes so far say that they are; the meshes are fitted to them, and the next
finer photos are looked at. Cells all over the photos are held back from that, and judge.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.alignment.distances import rms
from panostitch.alignment.elastic_system import errors, with_meshes
from panostitch.alignment.flow import followed
from panostitch.alignment.pictures import Pictures
from panostitch.alignment.refine import measured
from panostitch.alignment.registration import BORDER, HALF
from panostitch.alignment.straight_lines import straight_lines
from panostitch.geometry.sampling import rescale
from panostitch.model.alignment import LocalWarp
from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints
from panostitch.model.mesh import CELLS
from panostitch.model.photo import Photo
from panostitch.runtime.executor import Executor

Floats = NDArray[np.float64]
Look = Callable[[Pictures, Sequence[Camera], int, Mapping[int, Floats], tuple[int, int]], ControlPoints]

COARSEST, FINEST = 240, 1600  # px of the photos' longer side
FLOWS = 2  # times that flow is followed: what was out of its reach, the meshes may have brought nearer
WAY = 8.0  # px of the reduced photo, from where a patch is sought
BLOCKS = 1000  # of a photo in a pair, a corner sought in each,
FEWEST_BLOCKS = 200  # less where a photo has many partners
SMALLEST_BLOCK = 10  # px: what is nearer lies in much the same patch
DENSER = 4  # times as many points are followed by flow, which is there for all pixels,
SMALLEST_FLOW_BLOCK = 5  # px
FEWEST_CELLS = 12  # along a photo, of meshes that only say where to look, and of those of very many photos
FEW = 6  # photos; with more, cells become larger
CORNER = 5  # px, side of the window
NEIGHBOURS = 8
ODD = 0.01  # of the photo's longer side: a match that is this much off its neighbours' median is none
# Of the error of matches that are held back, what may be left; and px by which it must fall. Meshes that follow noise
# leave more than all of it, those of parallax a third to a tenth.
CLEARLY, NOTICEABLE = 0.8, 0.1
FEWEST_JUDGES = 10
LATTICE = 24  # cells along a photo,
HELD_BACK = 5  # of so many of which one is held back


def elastic(
    pictures: Pictures, cameras: Sequence[Camera], points: Sequence[ControlPoints], *, run: Executor
) -> tuple[tuple[Camera, ...], LocalWarp]:
    """The cameras with meshes, and what these gain. Raises InputError where a photo cannot be read."""
    photos = pictures.photos
    lines = list(run.map(partial(straight_lines, pictures), range(len(photos)), label="Finding straight lines"))
    blocks = int(np.clip(BLOCKS * len(photos) / (2 * len(points)), FEWEST_BLOCKS, BLOCKS))
    known = [agreeing(cameras, pair) for pair in points]
    bent = tuple(cameras)
    held: list[ControlPoints] = []
    factors = _factors(photos)
    looks: list[tuple[Look, int, int, int]] = [(_followed, factors[0], DENSER * blocks, SMALLEST_FLOW_BLOCK)] * FLOWS
    looks += [(_measured, factor, blocks, SMALLEST_BLOCK) for factor in factors]
    for n, (look, factor, count, smallest) in enumerate(looks):
        sought = [pair for pair in known if not 0 < n < FLOWS or relative_shift(cameras, bent, pair) >= WAY * factor]
        if not sought:
            continue
        firsts = sorted({pair.i for pair in sought})
        corners = run.map(partial(_corners, pictures, factor, count, smallest), firsts, label="Finding corners")
        work = partial(look, pictures, bent, factor, dict(zip(firsts, corners, strict=True)))
        seen = run.map(work, [(pair.i, pair.j) for pair in sought], label="Measuring parallax")
        found = {(pair.i, pair.j): pair for pair in (*known, *seen)}.values()
        sound = [agreeing(bent, pair) for pair in found]
        held = [pair.take(_held_back(cameras, pair)) for pair in sound]
        known = [_completed(cameras, new, old) for new, old in zip(sound, known, strict=True)]
        used = [pair.take(~_held_back(cameras, pair)) for pair in known]
        bent = with_meshes(cameras, used, lines, _cells_for(photos) if n == len(looks) - 1 else FEWEST_CELLS)
        if n == FLOWS and _hopeless(_judged(cameras, bent, held)):
            break
    return bent, _judged(cameras, bent, held)


def _factors(photos: Sequence[Photo]) -> list[int]:
    """By what the photos are reduced, one after the other: less by a factor of four, at the end of two or four."""
    longest = max(max(photo.size) for photo in photos)
    finest = max(1, int(longest / FINEST))
    halvings = max(0, int(np.log2(longest / finest / COARSEST)))
    return [finest * 2**k for k in (*range(halvings, 0, -2), 0)]


def _cells_for(photos: Sequence[Photo]) -> int:
    """Cells along a photo: as many as can be solved for in a few seconds."""
    return int(np.clip(CELLS * np.sqrt(FEW / len(photos)), FEWEST_CELLS, CELLS))


def _followed(
    pictures: Pictures, cameras: Sequence[Camera], factor: int, corners: Mapping[int, Floats], pair: tuple[int, int]
) -> ControlPoints:
    """Corners of one photo, and where dense flow leads them in the other."""
    i, j = pair
    grey_i, grey_j = pictures.read(i, factor), pictures.read(j, factor)
    small_i, small_j = (cameras[n].scaled((g.shape[1], g.shape[0])) for n, g in ((i, grey_i), (j, grey_j)))
    here, there = followed(corners[i].astype(int), small_i, small_j, grey_i, grey_j)
    up_i, up_j = (np.array(cameras[n].size) / small.size for n, small in ((i, small_i), (j, small_j)))
    return ControlPoints(i, j, rescale(here, up_i), rescale(there, up_j))


def _measured(
    pictures: Pictures, cameras: Sequence[Camera], factor: int, corners: Mapping[int, Floats], pair: tuple[int, int]
) -> ControlPoints:
    """Corners of one photo, and where their patches are in the other."""
    i, j = pair
    grey = pictures.read(i, factor)
    size = (grey.shape[1], grey.shape[0])
    here = rescale(corners[i], np.array(cameras[i].size) / size)
    there = cameras[j].project(cameras[i].rays(here))
    margin = (HALF + BORDER) * factor
    with np.errstate(invalid="ignore"):
        seen = ((there >= margin) & (there <= np.array(cameras[j].size) - 1 - margin)).all(1)
    _, points = measured(pictures, cameras, ControlPoints(i, j, here[seen], there[seen]), factor, WAY * factor)
    return points


def _corners(pictures: Pictures, factor: int, blocks: int, smallest: int, index: int) -> Floats:
    """Pixels (n, 2) of a reduced photo: the best corner of each block; no side of a block is below `smallest` px."""
    grey = pictures.read(index, factor)
    height, width = grey.shape
    side = max(smallest, round(float(np.sqrt(height * width / blocks))))
    strength = cv2.cornerMinEigenVal(grey.astype(np.float32), CORNER)
    rows, columns = height // side, width // side
    tiles = strength[: rows * side, : columns * side].reshape(rows, side, columns, side).swapaxes(1, 2)
    best = tiles.reshape(rows, columns, side * side).argmax(2)
    row, column = np.indices((rows, columns))
    return np.column_stack([(column * side + best % side).ravel(), (row * side + best // side).ravel()]).astype(float)


def agreeing(cameras: Sequence[Camera], points: ControlPoints) -> ControlPoints:
    """The matches that go about the same way as their neighbours."""
    if len(points) <= NEIGHBOURS:
        return points.take(np.zeros(len(points), bool))
    from scipy.spatial import cKDTree  # long to load, and only meshes need it

    off = errors(cameras, points)
    _, near = cKDTree(points.xy_i).query(points.xy_i, k=NEIGHBOURS + 1)
    usual = np.median(off[near[:, 1:]], axis=1)
    odd = np.linalg.norm(off - usual, axis=1)
    return points.take(np.asarray(odd <= ODD * max(cameras[points.j].size)))


def _completed(cameras: Sequence[Camera], new: ControlPoints, old: ControlPoints) -> ControlPoints:
    """The new matches, and the old ones in cells where there are no new ones: what is too plain for a small patch."""
    seen = {*map(tuple, _cells(cameras, new).tolist())}
    return new.joined(old.take(np.array([tuple(cell) not in seen for cell in _cells(cameras, old).tolist()], bool)))


def _held_back(cameras: Sequence[Camera], points: ControlPoints) -> NDArray[np.bool_]:
    """Which matches (n,) lie in cells that are held back: a lattice all over the first photo."""
    column, row = _cells(cameras, points).T
    return np.asarray((column + 2 * row) % HELD_BACK == 0)


def _cells(cameras: Sequence[Camera], points: ControlPoints) -> NDArray[np.intp]:
    """Column and row (n, 2) of the cell, of LATTICE along the first photo, in which each match lies."""
    return np.floor((points.xy_i + 0.5) * LATTICE / max(cameras[points.i].size)).astype(np.intp)


def _judged(cameras: Sequence[Camera], bent: Sequence[Camera], held: Sequence[ControlPoints]) -> LocalWarp:
    """What the meshes gain for matches that were held back, and whether that is enough."""
    before, after = (_lengths(some, held) for some in (cameras, bent))
    if not len(before):
        return LocalWarp(False, 0, 0.0, 0.0, 0.0, 0.0)
    error, bent_error = rms(before), rms(after)
    median, bent_median = float(np.median(before)), float(np.median(after))
    clear = bent_error < CLEARLY * error and error - bent_error > NOTICEABLE and bent_median <= median
    return LocalWarp(clear and len(before) >= FEWEST_JUDGES, len(before), error, median, bent_error, bent_median)


def relative_shift(cameras: Sequence[Camera], bent: Sequence[Camera], points: ControlPoints) -> float:
    """Px by which the meshes shift the photos of a pair against each other, at most, where they lie on each other."""
    one, other = cameras[points.i], cameras[points.j]
    across, down = (np.linspace(0, n - 1, LATTICE) for n in one.size)
    xy = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    before, after = other.project(one.rays(xy)), bent[points.j].project(bent[points.i].rays(xy))
    with np.errstate(invalid="ignore"):
        seen = [((there >= 0) & (there <= np.array(other.size) - 1)).all(1) for there in (before, after)]
    return float(np.linalg.norm(after - before, axis=1)[seen[0] | seen[1]].max(initial=0.0))


def _hopeless(warp: LocalWarp) -> bool:
    """Whether what the smallest photos show is reason enough not to look at larger ones: one wrong match is none."""
    better = warp.bent_rms < CLEARLY * warp.rms or warp.bent_median < CLEARLY * warp.median
    return warp.matches >= FEWEST_JUDGES and not better


def _lengths(cameras: Sequence[Camera], points: Sequence[ControlPoints]) -> Floats:
    return np.concatenate([np.linalg.norm(errors(cameras, pair), axis=1) for pair in points] or [np.zeros(0)])
