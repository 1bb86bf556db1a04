"""A camera: which ray of the world each pixel of a photo sees.

The lens is that of geometry.lens. For a flat subject the same class serves: `cam_from_world` is then any homography
from the plane's coordinates (x, y, 1), focal length 1.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from panostitch.geometry import lens
from panostitch.geometry.sampling import rescale
from panostitch.model.mesh import Mesh

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Camera:
    """Intrinsics and pose of one photo.

    size:           (width, height) px
    focal:          px
    centre:         (x, y) px of the principal point
    cam_from_world: (3, 3)
    k1, k2:         radial distortion
    mesh:           where the photo departs from all that; None where it does not
    """

    size: tuple[int, int]
    focal: float
    centre: tuple[float, float]
    cam_from_world: Floats
    k1: float = 0.0
    k2: float = 0.0
    mesh: Mesh | None = None

    def project(self, rays: Floats) -> Floats:
        """Rays of the world (n, 3) to pixels (n, 2); NaN for rays behind the camera or beyond the lens's fold."""
        local = rays @ self.cam_from_world.T
        depth = np.where(local[:, 2:] > 1e-9, local[:, 2:], np.nan)
        xy = np.asarray(lens.distort(local[:, :2] / depth, self.k1, self.k2) * self.focal + self.centre)
        return xy if self.mesh is None else self.mesh.bent(xy)

    def rays(self, xy: Floats) -> Floats:
        """Pixels (n, 2) to rays of the world (n, 3), not of unit length."""
        xy = np.asarray(xy, np.float64)
        seen = xy if self.mesh is None else self.mesh.straightened(xy)
        plane = lens.undistort((seen - self.centre) / self.focal, self.k1, self.k2)
        return np.asarray(np.column_stack([plane, np.ones(len(plane))]) @ np.linalg.inv(self.cam_from_world).T)

    def scaled(self, size: tuple[int, int]) -> "Camera":
        """The camera of the same photo at another size (width, height) px; the aspect may be off by a rounding."""
        if size == self.size:
            return self
        factor = np.array(size) / self.size
        x, y = rescale(np.array(self.centre), factor)
        mean = float(np.sqrt(factor[0] * factor[1]))
        mesh = self.mesh and self.mesh.scaled(size)
        return replace(self, size=size, focal=self.focal * mean, centre=(float(x), float(y)), mesh=mesh)

    def turned(self, old_from_new: Floats) -> "Camera":
        """The same camera in a world with other axes; `old_from_new` is (3, 3)."""
        return replace(self, cam_from_world=self.cam_from_world @ old_from_new)

    @property
    def corners(self) -> Floats:
        """Centres (4, 2) px of the corner pixels, clockwise from the top left."""
        right, bottom = self.size[0] - 1.0, self.size[1] - 1.0
        return np.array([[0, 0], [right, 0], [right, bottom], [0, bottom]])

    def outline(self, points_per_side: int = 16) -> Floats:
        """Pixels (4 n, 2) along the outer edge of the photo."""
        right, bottom = self.size[0] - 0.5, self.size[1] - 0.5
        corners = np.array([[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]])
        steps = np.arange(points_per_side)[:, None] / points_per_side
        sides = [a + steps * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
        return np.vstack(sides)
