"""Patch registration: where the surroundings of a point of one photo lie in another, to a hundredth of a pixel.

A square patch of photo i is registered with photo j, which is resampled in the shape that the estimated cameras say
the patch has there. Inverse compositional Gauss-Newton (Baker & Matthews 2004) over the shift together with a gain and
an offset that may slope across the patch: exposure and vignetting move plain registration by a quarter of a pixel.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints

Floats = NDArray[np.float64]
Grey = NDArray[np.uint8]
Levels = NDArray[np.float32]

HALF = 15  # px from the centre of a patch to its edge
SIDE = 2 * HALF + 1
BORDER = 4  # px of photo that gradient and interpolation need beyond the patch
STEPS = 8
LONGEST_STEP = 3.0  # px
WANDERING = int(STEPS * LONGEST_STEP) + 4  # px from its beginning that a patch can get, and its interpolation looks
NEARLY = 0.02  # px, steps below this leave the rest to the exact interpolation
ARRIVED = 0.1  # px, a last step above this has not settled
MIN_CORRELATION = 0.8  # between the patches, after gain and offset
MAX_DEVIATION = 0.15  # px, expected error of a point; a patch of straight edges slides along them

# gain, shift across and down, offset, slope of the offset across and down, slope of the gain across and down
PARAMETERS = 8
SHIFT = slice(1, 3)
U = np.linspace(-1.0, 1.0, SIDE)  # of the pixels of a patch, in halves of its width
# the resampled patch goes through nine points of the cameras' map: second order in each direction
NODES = np.array([-1.0, 0.0, 1.0]) * HALF
BASIS = np.column_stack([U * (U - 1) / 2, 1 - U**2, U * (U + 1) / 2])


@dataclass(frozen=True)
class Measured:
    """What could be measured of the points.

    index:     (n,) of the points that could be
    xy_i:      (n, 2) px, whole pixels of photo i near the points
    xy_j:      (n, 2) px, where they are in photo j
    deviation: (n,) px, standard error expected from the noise of the patch
    way:       (n,) px from where the search began
    """

    index: NDArray[np.intp]
    xy_i: Floats
    xy_j: Floats
    deviation: Floats
    way: Floats


@dataclass(frozen=True)
class Patches:
    """n patches of photo i, centred on whole pixels.

    design: (n, SIDE^2, PARAMETERS) derivative of the patch by the parameters
    solver: (n, PARAMETERS, PARAMETERS) inverse of the normal equations
    """

    design: Levels
    solver: Floats

    def take(self, index: NDArray[np.intp]) -> "Patches":
        """The patches with these indices."""
        return Patches(self.design[index], self.solver[index])


def measured_again(points: ControlPoints, camera_i: Camera, camera_j: Camera, grey_i: Grey, grey_j: Grey) -> Measured:
    """Measure the points (n, 2) px of photo i anew in photo j, near where they are said to be.

    grey_i, grey_j: the photos (h, w) at the sizes of the cameras
    """
    index = np.flatnonzero(_inside(points.xy_i, grey_i))
    points = points.take(index)
    centre = np.rint(points.xy_i)
    at = _map(camera_i, camera_j, centre)
    at += (points.xy_j - camera_j.project(camera_i.rays(points.xy_i)))[:, None, None]
    possible = np.isfinite(at).all((1, 2, 3))
    index, centre, at = index[possible], centre[possible], at[possible]
    if not len(index):
        return Measured(index, centre, centre, np.zeros(0), np.zeros(0))
    patches, shape, begin = _patches(grey_i, centre), _local_shape(at), at[:, 1, 1].copy()
    levels, first = _looked_at(grey_j, at)
    active = np.arange(len(at))
    for _ in range(STEPS):
        step = _step(patches.take(active), _resampled(levels, at[active] - first, cv2.INTER_CUBIC))
        at[active] += np.einsum("nab,nb->na", shape[active], step)[:, None, None]
        active = active[np.abs(step).max(1) > NEARLY]
        if not len(active):
            break
    # the exact but slow interpolation has the last word
    seen = _resampled(levels, at - first, cv2.INTER_LANCZOS4)
    step = _step(patches, seen)
    at += np.einsum("nab,nb->na", shape, step)[:, None, None]
    correlation, deviation = _quality(patches, seen)
    there = at[:, 1, 1]
    good = (np.hypot(*step.T) < ARRIVED) & (correlation > MIN_CORRELATION) & (deviation < MAX_DEVIATION)
    good &= _inside(there, grey_j)
    way = np.hypot(*(there - begin).T)
    return Measured(index[good], centre[good], there[good], deviation[good], way[good])


def _inside(xy: Floats, grey: Grey) -> NDArray[np.bool_]:
    margin = HALF + BORDER
    return np.asarray((xy >= margin).all(1) & (xy <= np.array(grey.shape[::-1]) - 1 - margin).all(1))


def _map(camera_i: Camera, camera_j: Camera, centre: Floats) -> Floats:
    """Where (n, 3, 3, 2) px in photo j the cameras see nine points of each patch."""
    down, across = np.meshgrid(NODES, NODES, indexing="ij")
    nodes = centre[:, None, None] + np.stack([across, down], axis=-1)
    return camera_j.project(camera_i.rays(nodes.reshape(-1, 2))).reshape(len(centre), 3, 3, 2)


def _local_shape(at: Floats) -> Floats:
    """Derivative (n, 2, 2) of the place in photo j by the place in photo i, at the centres."""
    across, down = (at[:, 1, 2] - at[:, 1, 0]) / (2 * HALF), (at[:, 2, 1] - at[:, 0, 1]) / (2 * HALF)
    return np.stack([across, down], axis=-1)


def _patches(grey: Grey, centre: Floats) -> Patches:
    reach = np.arange(-HALF - 1, HALF + 2)
    column, row = centre.astype(int).T
    block = grey[row[:, None, None] + reach[:, None], column[:, None, None] + reach].astype(np.float32)
    patch = block[:, 1:-1, 1:-1]
    across = (block[:, 1:-1, 2:] - block[:, 1:-1, :-2]) / 2
    down = (block[:, 2:, 1:-1] - block[:, :-2, 1:-1]) / 2
    u, v = (np.broadcast_to(a, patch.shape) for a in (U, U[:, None]))
    level = patch - patch.mean((1, 2), keepdims=True)
    columns = (patch, across, down, np.ones_like(patch), u, v, level * u, level * v)
    design = np.stack(columns, axis=-1).reshape(len(centre), SIDE**2, PARAMETERS).astype(np.float32)
    normal = (design.transpose(0, 2, 1) @ design).astype(np.float64)
    scale = np.sqrt(np.maximum(np.einsum("npp->np", normal), 1e-9))
    product = scale[:, :, None] * scale[:, None, :]
    return Patches(design, np.linalg.inv(normal / product + 1e-9 * np.eye(PARAMETERS)) / product)


def _looked_at(grey: Grey, at: Floats) -> tuple[Levels, NDArray[np.intp]]:
    """The part of a photo that patches at these places (n, 3, 3, 2) may look at, and its first pixel (x, y)."""
    last = np.array(grey.shape[::-1]) - 1
    low = (np.floor(at.min((0, 1, 2))).astype(int) - WANDERING).clip(0, last)
    high = (np.ceil(at.max((0, 1, 2))).astype(int) + WANDERING).clip(0, last)
    return grey[low[1] : high[1] + 1, low[0] : high[0] + 1].astype(np.float32), low


def _resampled(grey: Levels, at: Floats, interpolation: int) -> Levels:
    """Patches (n, SIDE^2) of photo j through nine points each."""
    x, y = (np.asarray(BASIS @ at[..., axis] @ BASIS.T, np.float32).reshape(-1, SIDE) for axis in (0, 1))
    seen = cv2.remap(grey, x, y, interpolation, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(seen.reshape(len(at), SIDE**2), np.float32)


def _parameters(patches: Patches, seen: Levels) -> Floats:
    """The parameters (n, PARAMETERS) that explain best what is seen."""
    gradient = (patches.design.transpose(0, 2, 1) @ seen[..., None]).astype(np.float64)
    return np.asarray((patches.solver @ gradient)[..., 0])


def _step(patches: Patches, seen: Levels) -> Floats:
    """How far (n, 2) px of photo i the patches still are from what is seen."""
    theta = _parameters(patches, seen)
    with np.errstate(all="ignore"):
        step = -theta[:, SHIFT] / theta[:, :1]
    # a patch that is lost stops where it is, and is refused for its correlation
    return np.where(np.isfinite(step).all(1, keepdims=True), np.clip(step, -LONGEST_STEP, LONGEST_STEP), 0.0)


def _quality(patches: Patches, seen: Levels) -> tuple[Floats, Floats]:
    """Correlation (n,) of the patches after gain and offset, and expected error (n,) px of the shift."""
    theta = _parameters(patches, seen)
    gain = theta[:, 0]
    rest = seen - (patches.design @ theta[..., None].astype(np.float32))[..., 0]
    noise = (rest**2).sum(1) / (SIDE**2 - PARAMETERS)
    explained = np.where(gain > 0, 1 - noise / np.maximum(seen.var(1), 1e-9), 0.0)
    with np.errstate(all="ignore"):
        return np.sqrt(np.maximum(explained, 0)), _deviation(patches, noise / gain**2)


def _deviation(patches: Patches, noise: Floats) -> Floats:
    """Expected error (n,) px of the shift, from the variance (n,) of what the parameters leave unexplained."""
    known = np.linalg.inv(patches.solver[:, SHIFT, SHIFT])  # what the patch says of its shift
    # half of the noise is in photo i, and noise has gradients too, in which nothing can be seen
    grain = SIDE**2 * noise / 2 / 2
    middle, difference = (known[:, 0, 0] + known[:, 1, 1]) / 2, (known[:, 0, 0] - known[:, 1, 1]) / 2
    radius = np.hypot(difference, known[:, 0, 1])
    least, most = middle - radius - grain, middle + radius - grain
    return np.where(least > 0, np.sqrt(noise * (1 / least + 1 / most)), np.inf)
