"""The meshes of all photos that bring matches together, as one sparse system.

A match pulls both of its photos half-way. Second differences of the displacement cost (stiffness), so does its size, a
little: where there is no evidence it falls to nothing. Along straight lines of a photo, what would bend them costs
more. Robust by iteratively reweighted least squares. Compare Li et al., "Parallax-tolerant image stitching based on
robust elastic warping", 2018; lines: Zhang et al., "Multi-viewpoint panorama construction with wide-baseline images",
2016.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csc_array, csr_array, diags_array, eye_array, hstack, kron
from scipy.sparse.linalg import LinearOperator, SuperLU, cg, splu

from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints
from panostitch.model.mesh import CELLS, STEEPEST, Mesh, flat_mesh

Floats = NDArray[np.float64]

ROUNDS = 3
CLOSE = 3.0  # times the median error: matches within it count fully
CLOSEST = 0.2  # px, and at least these
NARROWER = 3.0  # times, from round to round, at most
STIFFNESS = 0.03  # of a second difference of 1 px between nodes, in errors of 1 px of a match: depth may jump
FADING = 0.2  # of the photo's longer side, over which a displacement fades where nothing holds it
LINE_STIFFNESS = 100.0  # the same as STIFFNESS, across a straight line and for each step of a cell along it
EXACT, MOST_STEPS = 2e-4, 200  # of the conjugate gradients: share of the right side that is left, and steps
LARGEST = 0.06  # of the photo's longer side: the most that a photo is displaced
TAMED = 0.99  # times the steepest that a mesh may be: from here on it would have been steeper
STIFFER = 4.0  # times, where a mesh would be steeper than it may be
STIFF_CELLS = 4  # along a photo, of the coarse grid on which all photos are solved together to precondition with


@dataclass(frozen=True)
class _Pair:
    """What the matches of a pair say under the cameras alone; slope (n, 2, 2): of the place in photo j by that in i."""

    points: ControlPoints
    slope: Floats


def with_meshes(
    cameras: Sequence[Camera], points: Sequence[ControlPoints], lines: Sequence[Floats], cells: int = CELLS
) -> tuple[Camera, ...]:
    """The cameras with the meshes, of so many cells along a photo, that explain the matches best.

    lines: of each photo, (n, 3, 2) px: points at equal distances along straight lines
    """
    plain = [replace(camera, mesh=None) for camera in cameras]
    pairs = [_Pair(pair, _slope(plain[pair.i], plain[pair.j], pair.xy_i)) for pair in points if len(pair)]
    stiffness = np.full(len(plain), STIFFNESS)
    while True:
        found = _solved(plain, pairs, lines, cells, stiffness)
        steep = np.array([bool(camera.mesh and camera.mesh.steepness >= TAMED * STEEPEST) for camera in found])
        if not steep.any():
            return found
        stiffness[steep] *= STIFFER


def errors(cameras: Sequence[Camera], points: ControlPoints) -> Floats:
    """Distances (n, 2) px in photo j by which matches are off, meshes included."""
    return np.asarray(points.xy_j - cameras[points.j].project(cameras[points.i].rays(points.xy_i)))


def _solved(
    cameras: Sequence[Camera], pairs: Sequence[_Pair], lines: Sequence[Floats], cells: int, stiffness: Floats
) -> tuple[Camera, ...]:
    meshes = [flat_mesh(camera.size, cells) for camera in cameras]
    prior = block_diag([_prior(mesh, lines[n], stiffness[n]) for n, mesh in enumerate(meshes)], format="csr")
    places = [(pair.points.xy_i, pair.points.xy_j) for pair in pairs]
    nearly, solution, scale = None, np.zeros(prior.shape[0]), 0.0
    for _ in range(ROUNDS if pairs else 0):
        rows, target = _equations(cameras, meshes, pairs, places)
        weight, scale = _weights(target - rows @ solution, least=scale / NARROWER)
        weighted = rows.T @ diags_array(weight)
        normal = LinearOperator(prior.shape, lambda x, w=weighted, r=rows: w @ (r @ x) + prior @ x, dtype=np.float64)
        # only the weights change from round to round: what helped in the first helps in the others
        nearly = nearly or _nearly(meshes, rows, weight, prior)
        solution, _ = cg(normal, weighted @ target, x0=solution, rtol=EXACT, maxiter=MOST_STEPS, M=nearly)
        meshes = _displaced(meshes, solution)
        solution = np.concatenate([mesh.nodes.transpose(2, 0, 1).ravel() for mesh in meshes])
        places = [_straightened(meshes, pair.points, *place) for pair, place in zip(pairs, places, strict=True)]
    return tuple(replace(camera, mesh=mesh) for camera, mesh in zip(cameras, meshes, strict=True))


def _nearly(meshes: Sequence[Mesh], rows: csr_array, weight: Floats, prior: csr_array) -> LinearOperator:
    """About the inverse of the system, to precondition with: each photo as if the others stood still (block Jacobi),
    and all photos together, but stiff (a coarse grid).

    The factors of all photos together fill up, where many lie over one place. The blocks alone know nothing of what
    costs next to nothing, photos that go the same way together: up to five times as many steps.
    Dryja & Widlund, "An additive variant of the Schwarz alternating method for the case of many subregions", 1987.
    """
    columns, scaled = csc_array(rows), csc_array(diags_array(weight) @ rows)
    ends = np.cumsum([0, *(mesh.nodes.size for mesh in meshes)])
    places = [slice(first, behind) for first, behind in pairwise(ends)]
    alone = [_factors(columns[:, own].T @ scaled[:, own] + prior[own, own]) for own in places]
    stiff = csr_array(block_diag([_stiff(*mesh.nodes.shape[:2]) for mesh in meshes for _ in "xy"]))
    coarse = csr_array(rows @ stiff)
    together = _factors(coarse.T @ (diags_array(weight) @ coarse) + stiff.T @ (prior @ stiff))

    def solve(x: Floats) -> Floats:
        apart = np.concatenate([factors.solve(x[own]) for factors, own in zip(alone, places, strict=True)])
        return np.asarray(apart + stiff @ together.solve(stiff.T @ x))

    return LinearOperator(prior.shape, solve, dtype=np.float64)


def _factors(matrix: csr_array) -> SuperLU:
    """Of a symmetric matrix."""
    return splu(csc_array(matrix), permc_spec="MMD_AT_PLUS_A")


@lru_cache(maxsize=8)
def _stiff(rows: int, columns: int) -> csr_array:
    """The nodes (rows * columns, fewer) of a mesh that only a few of them move, the others between these."""
    cell = max(rows, columns) / STIFF_CELLS
    return csr_array(kron(*(_between(count, max(1, round(count / cell))) for count in (rows, columns))))


def _between(count: int, cells: int) -> csr_array:
    """Weights (count, cells + 1) by which the ends of equal cells move so many nodes: linear interpolation."""
    place = np.linspace(0, cells, count)[:, None]
    return csr_array(np.maximum(0, 1 - np.abs(place - np.arange(cells + 1))))


def _straightened(meshes: Sequence[Mesh], points: ControlPoints, q_i: Floats, q_j: Floats) -> tuple[Floats, Floats]:
    """Nearer to where the cameras see the matches: one step, the rounds make the others."""
    return points.xy_i - meshes[points.i].displacement(q_i), points.xy_j - meshes[points.j].displacement(q_j)


def _weights(residuals: Floats, *, least: float) -> tuple[Floats, float]:
    """Cauchy weights (2 n,), one for each coordinate of each match, and their scale: px, `least` or more.

    Were it to become small at once, what the first mesh does not follow yet would never count again.
    """
    length = np.linalg.norm(residuals.reshape(-1, 2), axis=1)
    scale = max(CLOSE * float(np.median(length)), CLOSEST, least)
    return np.repeat(1 / (1 + (length / scale) ** 2), 2), scale


def _displaced(meshes: Sequence[Mesh], solution: Floats) -> list[Mesh]:
    """The meshes with their parts of the solution; rounded, so that a project file holds the same."""
    found, start = [], 0
    for mesh in meshes:
        shape = mesh.nodes.shape[:2]
        count = shape[0] * shape[1]
        nodes = solution[start : start + 2 * count].reshape(2, *shape).transpose(1, 2, 0)
        length = np.linalg.norm(nodes, axis=2, keepdims=True)
        most = LARGEST * max(mesh.size)
        nodes = nodes * np.minimum(1, most / np.maximum(length, 1e-12))
        steepness = Mesh(mesh.size, nodes).steepness
        tamed = nodes * min(1.0, STEEPEST / max(steepness, 1e-12))  # what folds has no inverse
        found.append(Mesh(mesh.size, tamed.round(4)))
        start += 2 * count
    return found


def _equations(
    cameras: Sequence[Camera], meshes: Sequence[Mesh], pairs: Sequence[_Pair], places: Sequence[tuple[Floats, Floats]]
) -> tuple[csr_array, Floats]:
    """Rows (2 n, unknowns) and right side (2 n,): what the nodes, x of a photo and then y, do to each match.

    Photo i shows at p what its camera sees at q; with the slope A of the cameras' map f, D_j - A D_i = p_j - f(q_i) -
    A (p_i - q_i).
    """
    counts = [mesh.nodes[..., 0].size for mesh in meshes]
    starts = 2 * np.cumsum([0, *counts])
    columns, factors, targets = [], [], []
    for pair, (q_i, q_j) in zip(pairs, places, strict=True):
        points, slope = pair.points, pair.slope
        seen = cameras[points.j].project(cameras[points.i].rays(q_i))
        right = points.xy_j - seen - np.einsum("nab,nb->na", slope, points.xy_i - q_i)
        known = np.isfinite(right).all(1)
        targets.append(np.where(known[:, None], right, 0.0))
        (here, weight_i), (there, weight_j) = meshes[points.i].terms(q_i), meshes[points.j].terms(q_j)
        here, there, weight_i, weight_j = here.T, there.T, weight_i.T * known[:, None], weight_j.T * known[:, None]
        first, second = here + starts[points.i], there + starts[points.j]
        other = first + counts[points.i]
        columns.append(np.stack([np.hstack([first, other, second + axis * counts[points.j]]) for axis in (0, 1)], 1))
        factors.append(
            np.stack(
                [
                    np.hstack([-slope[:, axis, :1] * weight_i, -slope[:, axis, 1:] * weight_i, weight_j])
                    for axis in (0, 1)
                ],
                1,
            )
        )
    values, numbers = np.concatenate(factors).reshape(-1), np.concatenate(columns).reshape(-1)
    ends = np.arange(0, len(values) + 1, 48)
    return csr_array((values, numbers, ends), shape=(len(ends) - 1, int(starts[-1]))), np.concatenate(targets).ravel()


def _basis(mesh: Mesh, xy: Floats) -> csr_array:
    """Weights (n, nodes) by which the nodes displace pixels (n, 2)."""
    numbers, weights = mesh.terms(xy)
    ends = np.arange(0, 16 * len(xy) + 1, 16)
    return csr_array((weights.T.ravel(), numbers.T.ravel(), ends), shape=(len(xy), mesh.nodes[..., 0].size))


def _prior(mesh: Mesh, lines: Floats, stiffness: float) -> csr_array:
    """What displacements cost by themselves: a symmetric matrix over the nodes, x and then y."""
    prior = stiffness * _plate(*mesh.nodes.shape[:2])
    if len(lines):
        bend = _line_rows(mesh, lines)
        prior = prior + LINE_STIFFNESS * bend.T @ bend
    return csr_array(prior)


@lru_cache(maxsize=8)
def _plate(rows: int, columns: int) -> csr_array:
    """What second differences and the size of displacements cost, x and then y; most photos are of one size."""
    one, other = (diags_array([1.0, -2.0, 1.0], offsets=[0, 1, 2], shape=(n - 2, n)) for n in (rows, columns))
    down, right = (diags_array([1.0, -1.0], offsets=[0, 1], shape=(n - 1, n)) for n in (rows, columns))
    across = kron(eye_array(rows), other)
    along = kron(one, eye_array(columns))
    twisted = kron(down, right)
    cells = max(rows, columns) - 3
    plate = across.T @ across + along.T @ along + 2 * twisted.T @ twisted
    single = plate + eye_array(rows * columns) / (FADING * cells) ** 4
    return csr_array(block_diag([single, single]))


def _line_rows(mesh: Mesh, lines: Floats) -> csr_array:
    """How much (n, nodes) the displacement bends each three points of a line, x and then y, across the line."""
    before, middle, after = (_basis(mesh, lines[:, k]) for k in range(3))
    bend = before - 2 * middle + after
    along = lines[:, 2] - lines[:, 0]
    normal = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
    return csr_array(hstack([diags_array(normal[:, 0]) @ bend, diags_array(normal[:, 1]) @ bend]))


def _slope(camera_i: Camera, camera_j: Camera, xy: Floats) -> Floats:
    """Derivative (n, 2, 2) of the place in photo j by the place in photo i."""
    steps = np.array([[0.5, 0.0], [0.0, 0.5]])
    sides = [camera_j.project(camera_i.rays(xy + s)) - camera_j.project(camera_i.rays(xy - s)) for s in steps]
    return np.nan_to_num(np.stack(sides, axis=-1))
