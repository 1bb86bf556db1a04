"""Homographies of a flat subject as Hugin's mosaic: cameras of one field of view, in front of one plane.

Hugin sends the ray of a panorama's pixel to a plane with unit normal n at distance 1, and looks from T at where it
meets (libpano13, plane_transfer_to_camera): `H = K R (I - T n^T)`. Photos of a real camera are of this form with their
own focal length and the plane's own n. With both given, R and T follow from each homography: on the two directions w
across n, `K^-1 H w` is R w but for a factor. What is left of that to be wrong is brought down by the choice of focal
length and n, then everything is adjusted to the pixels.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from panostitch.model.camera import Camera

Floats = NDArray[np.float64]

GRID = 6  # points along each side of a photo that are compared
GOOD = 0.02  # px: no further start is tried
FAR = 0.02  # degrees along the longer side: from so far away there is no perspective, and the horizon is flat
ADJUSTMENTS = 20  # steps at most
FIELDS = (50.0, 20.0)  # degrees along the longer side: starts of the search
TILTS = ((0.0, 0.0), (0.3, 0.0), (-0.3, 0.0), (0.0, 0.3), (0.0, -0.3), (0.9, 0.0), (-0.9, 0.0), (0.0, 0.9), (0.0, -0.9))
NEAREST = 1e-3  # of the plane's distance: points that are no farther ahead are not seen


@dataclass(frozen=True)
class View:
    """The photo that the panorama's axes are taken from.

    ahead: plane coordinates (x, y) that are straight ahead
    pixel: plane units per px of it
    side:  its longer side, px
    """

    ahead: tuple[float, float]
    pixel: float
    side: int


@dataclass(frozen=True)
class Mosaic:
    """Cameras in front of a plane.

    focal:  px of the longer side of the photo that the axes are taken from: a common field of view
    normal: (3,) unit vector towards the plane
    turns:  (n, 3, 3) rotations of the cameras
    places: (n, 3) of the cameras, in distances of the plane; x right, y down, z forward
    error:  px at most between these cameras and the homographies
    """

    focal: float
    normal: Floats
    turns: Floats
    places: Floats
    error: float


def reference(cameras: Sequence[Camera]) -> View:
    """The view of the photo that shows the plane most nearly as it is."""
    return min((_view(camera) for camera in cameras), key=lambda found: found[0])[1]


def mosaic(cameras: Sequence[Camera], view: View, *, hint: float | None = None) -> Mosaic:
    """Hugin's cameras for homographies; `hint` is a focal length px of the reference photo, if one is known."""
    focals = [view.side / 2 / np.tan(np.deg2rad(field) / 2) for field in FIELDS]
    problem = _Problem(cameras, view)
    best: Mosaic | None = None
    for focal in [*([hint] if hint else []), *focals]:
        for tilt in TILTS:
            found = problem.solved(np.array([np.log(focal), *tilt]))
            if best is None or found.error < best.error:
                best = found
            if best.error < GOOD:
                return best
    far = problem.far(view.side / 2 / np.tan(np.deg2rad(FAR) / 2))
    if best is None or far.error < best.error:
        best = far
    return best if best.error < GOOD else problem.adjusted(best)


class _Problem:
    """Homographies, and the points (n, m, ...) on a grid of each photo and on the plane."""

    def __init__(self, cameras: Sequence[Camera], view: View) -> None:
        grids = [_grid(camera.size) for camera in cameras]
        self.view = view
        self.pixels = np.stack(grids)
        self.plane = np.stack([camera.rays(grid) for camera, grid in zip(cameras, grids, strict=True)])
        self.plane /= self.plane[..., 2:]
        self.middles = np.array([[(n - 1) / 2 for n in camera.size] for camera in cameras])
        # one field of view for all: photos of another size have another focal length in px
        self.ratios = np.array([max(camera.size) / view.side for camera in cameras])
        self.homographies = np.stack([_signed(camera) for camera in cameras])

    def solved(self, start: Floats) -> Mosaic:
        """Focal length and normal near a start (3,) that suit all homographies; R and T follow."""
        from scipy.optimize import least_squares  # long to load

        found = least_squares(self._skews, start, x_scale=0.1, max_nfev=30)
        focal, normal = _length(found.x[0]), _normal(found.x[1:])
        pairs = [_pose(matrix, normal) for matrix in self._calibrated(focal)]
        turns, places = (np.stack(parts) for parts in zip(*pairs, strict=True))
        return self._judged(Mosaic(focal, normal, turns, places, 0.0))

    def far(self, focal: float) -> Mosaic:
        """Cameras so far away that a tilt only squeezes: for affine maps, which no camera near by makes."""
        matrices = self._calibrated(focal)
        pairs = [_far_pose(matrix) for matrix in matrices]
        turns, places = (np.stack(parts) for parts in zip(*pairs, strict=True))
        return self._judged(Mosaic(focal, np.array([0.0, 0.0, 1.0]), turns, places, 0.0))

    def adjusted(self, start: Mosaic) -> Mosaic:
        """Everything adjusted to the pixels, from a start."""
        from scipy.optimize import least_squares
        from scipy.spatial.transform import Rotation

        count = len(start.turns)
        tilt = start.normal[:2] / start.normal[2]

        def at(x: Floats) -> Mosaic:
            turns = Rotation.from_rotvec(x[3 : 3 + 3 * count].reshape(-1, 3)).as_matrix() @ start.turns
            return Mosaic(_length(x[0]), _normal(x[1:3]), turns, x[3 + 3 * count :].reshape(-1, 3), 0.0)

        first = np.concatenate([[np.log(start.focal)], tilt, np.zeros(3 * count), start.places.ravel()])
        found = least_squares(lambda x: self._residuals(at(x)).ravel(), first, x_scale="jac", max_nfev=ADJUSTMENTS)
        better = self._judged(at(found.x))
        return better if better.error < start.error else start

    def _judged(self, found: Mosaic) -> Mosaic:
        error = np.linalg.norm(self._residuals(found), axis=-1).max()
        return replace(found, error=float(np.nan_to_num(error, nan=np.inf)))

    def _rays(self, focal: float, plane: Floats) -> Floats:
        """Plane coordinates (..., 3) as rays of the panorama's camera."""
        across = np.array([*self.view.ahead, 0.0])
        unit = focal * self.view.pixel
        return np.asarray((plane - across * plane[..., 2:]) / [unit, unit, 1.0])

    def _calibrated(self, focal: float) -> Floats:
        """Homographies (n, 3, 3) from rays of the panorama to rays of the photos."""
        unit, (x, y) = focal * self.view.pixel, self.view.ahead
        plane_from_ray = np.array([[unit, 0, x], [0, unit, y], [0, 0, 1]])
        found = self.homographies.copy()
        found[:, :2] -= self.middles[:, :, None] * found[:, 2:]
        found[:, :2] /= focal * self.ratios[:, None, None]
        return np.asarray(found @ plane_from_ray)

    def _skews(self, x: Floats) -> Floats:
        """How far (2 n,) the directions across the normal are from being turned and scaled only, roughly px."""
        w = _across(_normal(x[1:]))
        a, b = np.moveaxis(self._calibrated(_length(x[0])) @ w, -1, 0)
        whole = (a**2 + b**2).sum(1)
        return np.concatenate([((a**2 - b**2).sum(1)) / whole, 2 * (a * b).sum(1) / whole]) * self.view.side

    def _residuals(self, found: Mosaic) -> Floats:
        """Differences (n, m, 2) px of where the photos see the points of the plane."""
        rays = self._rays(found.focal, self.plane)
        met = rays / np.maximum(rays @ found.normal, NEAREST)[..., None] - found.places[:, None]
        local = np.einsum("nij,nmj->nmi", found.turns, met)
        seen = local[..., :2] / np.maximum(local[..., 2:], NEAREST)
        return np.asarray(seen * (found.focal * self.ratios)[:, None, None] + self.middles[:, None] - self.pixels)


def _grid(size: tuple[int, int]) -> Floats:
    x, y = np.meshgrid(*(np.linspace(0, n - 1.0, GRID) for n in size))
    return np.column_stack([x.ravel(), y.ravel()])


def _signed(camera: Camera) -> Floats:
    """Homography (3, 3) from the plane to pixels, of positive depth in the photo."""
    x, y = camera.centre
    matrix = np.array([[camera.focal, 0, x], [0, camera.focal, y], [0, 0, 1]]) @ camera.cam_from_world
    seen = camera.rays(np.array([[(n - 1) / 2 for n in camera.size]]))[0]
    return np.asarray(matrix * np.sign(matrix[2] @ seen * seen[2]))


def _view(camera: Camera) -> tuple[float, View]:
    """How much a photo deforms the plane beyond a similarity, as a share, and its view."""
    pixels = _grid(camera.size)
    plane = camera.rays(pixels)
    flat = plane[:, 0] / plane[:, 2] + 1j * plane[:, 1] / plane[:, 2]
    photo = pixels[:, 0] + 1j * pixels[:, 1]
    columns = np.column_stack([photo, np.ones(len(photo))])
    found = np.linalg.lstsq(columns, flat, rcond=None)[0]
    wrong = float(np.abs(columns @ found - flat).max() / max(abs(found[0]) * max(camera.size), 1e-12))
    middle = found[0] * ((camera.size[0] - 1) / 2 + 1j * (camera.size[1] - 1) / 2) + found[1]
    return wrong, View((float(middle.real), float(middle.imag)), float(abs(found[0])), max(camera.size))


def _length(logarithm: float) -> float:
    """Focal length px; the search may stray, but not to where arithmetic ends."""
    return float(np.exp(np.clip(logarithm, 0.0, 20.0)))


def _normal(tilt: Floats) -> Floats:
    """Unit vector (3,) towards a plane that falls off by `tilt` (2,)."""
    normal = np.array([*tilt, 1.0])
    return np.asarray(normal / np.linalg.norm(normal))


def _across(normal: Floats) -> Floats:
    """Two unit vectors (3, 2) across a unit vector; with it they are right-handed."""
    first = np.cross([0.0, 1.0, 0.0], normal)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(normal, first)])


def _pose(matrix: Floats, normal: Floats) -> tuple[Floats, Floats]:
    """Rotation (3, 3) and place (3,) of the camera whose homography comes nearest to one from rays to rays."""
    across = _across(normal)
    u, singular, vt = np.linalg.svd(matrix @ across, full_matrices=False)
    turned = u @ vt
    whole = np.column_stack([turned, np.cross(turned[:, 0], turned[:, 1])])
    turn = whole @ np.column_stack([across, normal]).T
    return turn, normal - turn.T @ (matrix @ normal) / singular.mean()


def _far_pose(matrix: Floats) -> tuple[Floats, Floats]:
    """The same for a homography that is nearly affine, with the plane straight ahead."""
    met = np.linalg.solve(matrix, [0.0, 0.0, 1.0])
    met /= met[2]
    # the map around the photo's middle: (near / distance) times two rows and columns of R
    local = matrix[:2, :2] / (matrix[2] @ met)
    u, (large, small), vt = np.linalg.svd(local)
    flip = np.diag([1.0, np.sign(np.linalg.det(u))])
    u, vt = u @ flip, flip @ vt
    cosine = small / large
    sine = np.sqrt(max(1 - cosine**2, 0.0))
    tilt = np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])
    turn = _in_plane(u) @ tilt @ _in_plane(vt)
    return turn, met - turn[2] / large


def _in_plane(turn: Floats) -> Floats:
    """A rotation (2, 2) about the line of sight, as (3, 3)."""
    whole = np.eye(3)
    whole[:2, :2] = turn
    return whole
