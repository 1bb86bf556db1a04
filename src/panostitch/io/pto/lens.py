"""Our lens as Hugin's and back, each by least squares in px over the radii inside the photo.

Hugin's polynomial `r' = n rho (a rho^3 + b rho^2 + c rho + d)`, d = 1 - a - b - c, with rho the ideal radius in units
of n, half the photo's shorter side, goes from ideal to photo as ours does. It leaves the radius n where it is.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from panostitch.errors import UsageError
from panostitch.geometry import lens
from panostitch.model.camera import Camera

Floats = NDArray[np.float64]

SAMPLES = 200  # radii
SEEN = 1e-6  # px by which a radius may be missed that the lens reaches
FARTHEST = 4.0  # half shorter sides: where the search for a photo's corner ends


@dataclass(frozen=True)
class HuginLens:
    """focal: px, what `v` stands for; a, b, c: the polynomial; error: px at most, of the fit that made it."""

    focal: float
    a: float = 0.0
    b: float = 0.0
    c: float = 0.0
    error: float = 0.0


@dataclass(frozen=True)
class OurLens:
    """focal: px; k1, k2: as in geometry.lens; error: px at most, of the fit that made it."""

    focal: float
    k1: float = 0.0
    k2: float = 0.0
    error: float = 0.0


def to_hugin(camera: Camera) -> HuginLens:
    """Hugin's lens for a camera. Raises UsageError where the lens folds inside the photo."""
    if camera.k1 == camera.k2 == 0:
        return HuginLens(camera.focal)
    radii = _radii(reach(camera.size, camera.centre))
    ideal = _ideal(radii, camera)
    seen = np.abs(ideal * lens.factor(ideal**2, camera.k1, camera.k2) * camera.focal - radii) < SEEN
    unit, half = float(ideal.max()), min(camera.size) / 2
    if radii[seen].max() < half:
        raise UsageError("the lens distorts too much for Hugin's polynomial", hint="keep it as a .pano.json project")
    terms = np.arange(1, 5)
    found, error = _fit((ideal[seen, None] / unit) ** terms, radii[seen])
    # the ideal radius, in focal lengths, that the polynomial leaves where it is
    from scipy.optimize import brentq  # long to load

    fixed = unit * float(brentq(lambda t: float(found @ t**terms) - half, 0.0, 1.0))
    _, c, b, a = found * (fixed / unit) ** terms / half
    return HuginLens(half / fixed, float(a), float(b), float(c), error)


def from_hugin(given: HuginLens, size: tuple[int, int], centre: tuple[float, float]) -> OurLens:
    """Our lens for Hugin's, of a photo of this size with this principal point, both px."""
    if given.a == given.b == given.c == 0:
        return OurLens(given.focal)
    half, corner = min(size) / 2, reach(size, centre)
    rho = np.linspace(0, FARTHEST * corner / half, 8 * SAMPLES)
    radius = half * _polynomial(given, rho)
    # outwards as far as it goes outwards, and as the photo goes
    end = min(int(np.argmax(np.append(np.diff(radius) <= 0, True))), int(np.argmax(np.append(radius > corner, True))))
    rho = _radii(float(rho[min(max(end, 1), len(rho) - 1)]))
    ideal, radius = rho * half / given.focal, half * _polynomial(given, rho)
    unit = float(ideal.max())
    found, error = _fit((ideal[:, None] / unit) ** np.array([1, 3, 5]), radius)
    focal, k1, k2 = found / unit ** np.array([1, 3, 5])
    if not focal > 0:
        raise ValueError("its lens cannot be told as k1 and k2")
    return OurLens(float(focal), float(k1 / focal), float(k2 / focal), error)


def reach(size: tuple[int, int], centre: tuple[float, float]) -> float:
    """Distance px of the farthest corner of a photo from its principal point."""
    x, y = (max(middle + 0.5, n - 0.5 - middle) for n, middle in zip(size, centre, strict=True))
    return float(np.hypot(x, y))


def _radii(last: float) -> Floats:
    """Radii (SAMPLES,) in 0..last at the nodes of Chebyshev: least squares there keep the largest error small."""
    return np.asarray(last * np.sin((np.arange(SAMPLES) + 0.5) / SAMPLES * np.pi / 2))


def _ideal(radii: Floats, camera: Camera) -> Floats:
    """Ideal radii (n,) in focal lengths of radii (n,) px in the photo."""
    along = np.column_stack([radii / camera.focal, np.zeros(len(radii))])
    return np.asarray(lens.undistort(along, camera.k1, camera.k2)[:, 0])


def _polynomial(given: HuginLens, rho: Floats) -> Floats:
    a, b, c = given.a, given.b, given.c
    return rho * (((a * rho + b) * rho + c) * rho + 1 - a - b - c)


def _fit(columns: Floats, target: Floats) -> tuple[Floats, float]:
    """Coefficients (m,) of columns (n, m) that make a target (n,), and the largest error."""
    found = np.linalg.lstsq(columns, target, rcond=None)[0]
    return np.asarray(found), float(np.abs(columns @ found - target).max())
