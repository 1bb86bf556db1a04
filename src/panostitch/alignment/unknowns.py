"""What an adjustment of turning cameras may change, and where each unknown stands among all of them."""

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from panostitch.alignment.normal_equations import FIXED
from panostitch.alignment.residuals import CameraArrays
from panostitch.geometry import rotation
from panostitch.model.camera import Camera

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

LENS_STEP_LIMIT = 0.3  # relative change of the focal length in one step
MAX_K1, MAX_K2 = 2.0, 4.0


@dataclass(frozen=True)
class Freedom:
    """What the adjustment may change besides the rotations.

    focals:  for each camera the number of its focal length; cameras of one number share it
    lenses:  for each camera the number of its distortion and of its principal point
    terms:   how many of (k1, k2) are free
    centres: whether the principal point is free; a lens has one for each size of its photos, since it is another
             where the camera was held upright
    """

    focals: tuple[int, ...]
    lenses: tuple[int, ...]
    terms: int = 0
    centres: bool = False

    @property
    def parameters(self) -> int:
        """Number of unknowns, three for each rotation included; photos of one lens are taken to have one size."""
        lens = self.terms + 2 * self.centres
        return 3 * len(self.focals) + max(self.focals) + 1 + lens * (max(self.lenses) + 1)


@dataclass(frozen=True)
class Unknowns:
    """Places of the unknowns of each of n cameras. The first camera does not turn: only relative turns are seen.

    size:  number of unknowns
    turns: (n, 3) FIXED for the first camera
    lens:  (n, c) focal length, then as many of k1 and k2 as are free, then x and y of the centre if it is
    """

    freedom: Freedom
    size: int
    turns: Indices
    lens: Indices

    @property
    def centres(self) -> tuple[Indices, Indices]:
        """Places (groups, 2) of the free principal points, each once, and a camera (groups,) of each."""
        if not self.freedom.centres:
            return np.empty((0, 2), np.intp), np.empty(0, np.intp)
        columns, cameras = np.unique(self.lens[:, -2:], axis=0, return_index=True)
        return columns, cameras


def unknowns(cameras: Sequence[Camera], freedom: Freedom) -> Unknowns:
    """Where the unknowns of these cameras stand: rotations first, lenses last."""
    count = len(cameras)
    turns = np.arange(-3, 3 * count - 3).reshape(count, 3)
    turns[0] = FIXED
    after = 3 * count - 3
    parts = [_numbered(freedom.focals)[:, None]]
    parts += [_numbered(freedom.lenses)[:, None]] * freedom.terms
    if freedom.centres:
        sizes = [camera.size for camera in cameras]
        parts += [_numbered(zip(freedom.lenses, sizes, strict=True))[:, None]] * 2
    columns = []
    for part in parts:
        columns.append(after + part)
        after += int(part.max()) + 1
    return Unknowns(freedom, after, turns, np.hstack(columns))


def _numbered(keys: Iterable[Hashable]) -> Indices:
    """The same number, from 0 on, for the same key."""
    numbers: dict[Hashable, int] = {}
    return np.array([numbers.setdefault(key, len(numbers)) for key in keys], np.intp)


def moved(cameras: CameraArrays, places: Unknowns, step: Floats) -> CameraArrays | None:
    """The cameras after a step; None if a lens would leave what is possible."""
    change = step[places.lens].T
    terms, lenses = places.freedom.terms, cameras.lenses
    k1 = lenses.k1 + change[1] if terms > 0 else lenses.k1
    k2 = lenses.k2 + change[2] if terms > 1 else lenses.k2
    centre = lenses.centre + change[1 + terms :] if places.freedom.centres else lenses.centre
    if max(np.abs(change[0]).max() / LENS_STEP_LIMIT, np.abs(k1).max() / MAX_K1, np.abs(k2).max() / MAX_K2) > 1:
        return None
    vectors = np.append(step, 0.0)[places.turns]  # FIXED is the last entry
    turns = np.matmul(cameras.turns.transpose(2, 0, 1), rotation.exp(vectors)).transpose(1, 2, 0)
    return CameraArrays(
        np.ascontiguousarray(turns), replace(lenses, focal=lenses.focal * (1 + change[0]), centre=centre, k1=k1, k2=k2)
    )
