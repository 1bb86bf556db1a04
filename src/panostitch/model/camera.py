"""A camera: which ray of the world each pixel of a photo sees.

The lens is Brown-Conrady as in OpenCV: `x' = x (1 + k1 r^2 + k2 r^4)` with x in focal lengths. For a flat subject the
same class serves: `cam_from_world` is then any homography from the plane's coordinates (x, y, 1), focal length 1.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from panostitch.geometry.sampling import rescale

Floats = NDArray[np.float64]

NEWTON_STEPS = 12


@dataclass(frozen=True)
class Camera:
    """Intrinsics and pose of one photo.

    size:           (width, height) px
    focal:          px
    centre:         (x, y) px of the principal point
    cam_from_world: (3, 3)
    k1, k2:         radial distortion
    """

    size: tuple[int, int]
    focal: float
    centre: tuple[float, float]
    cam_from_world: Floats
    k1: float = 0.0
    k2: float = 0.0

    def project(self, rays: Floats) -> Floats:
        """Rays of the world (n, 3) to pixels (n, 2); NaN for rays behind the camera or beyond the lens's fold."""
        local = rays @ self.cam_from_world.T
        depth = np.where(local[:, 2:] > 1e-9, local[:, 2:], np.nan)
        xy = local[:, :2] / depth
        if self.k1 or self.k2:
            square = (xy**2).sum(1, keepdims=True)
            square = np.where(square < self._fold(), square, np.nan)
            xy = xy * (1 + square * (self.k1 + square * self.k2))
        return np.asarray(xy * self.focal + self.centre)

    def rays(self, xy: Floats) -> Floats:
        """Pixels (n, 2) to rays of the world (n, 3), not of unit length."""
        plane = self.undistort((np.asarray(xy, np.float64) - self.centre) / self.focal)
        return np.asarray(np.column_stack([plane, np.ones(len(plane))]) @ np.linalg.inv(self.cam_from_world).T)

    def undistort(self, xy: Floats) -> Floats:
        """Undo the lens: distorted to ideal coordinates (n, 2), in focal lengths. Newton's method on the radius."""
        if not (self.k1 or self.k2):
            return xy
        distorted = np.hypot(xy[:, 0], xy[:, 1])
        limit = np.sqrt(min(self._fold(), 1e6))
        radius = np.minimum(distorted, limit)
        for _ in range(NEWTON_STEPS):
            square = radius**2
            value = radius * (1 + square * (self.k1 + square * self.k2)) - distorted
            slope = 1 + square * (3 * self.k1 + square * 5 * self.k2)
            step = value / np.maximum(slope, 1e-3)
            radius = np.clip(radius - step, 0, limit)
            if np.abs(step).max(initial=0.0) < 1e-13:
                break
        return np.asarray(xy * (radius / np.maximum(distorted, 1e-12))[:, None])

    def _fold(self) -> float:
        """Square of the radius at which the lens polynomial turns back; rays beyond it are not in the picture."""
        a, b = 5 * self.k2, 3 * self.k1  # 1 + b s + a s^2 = 0, for the square s of the radius
        if a == 0:
            return -1 / b if b < 0 else np.inf
        under = b * b - 4 * a
        if under < 0:
            return np.inf
        roots = ((-b - np.sqrt(under)) / (2 * a), (-b + np.sqrt(under)) / (2 * a))
        return float(min((r for r in roots if r > 0), default=np.inf))

    def scaled(self, size: tuple[int, int]) -> "Camera":
        """The camera of the same photo at another size (width, height) px; the aspect may be off by a rounding."""
        if size == self.size:
            return self
        factor = np.array(size) / self.size
        x, y = rescale(np.array(self.centre), factor)
        mean = float(np.sqrt(factor[0] * factor[1]))
        return replace(self, size=size, focal=self.focal * mean, centre=(float(x), float(y)))

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
