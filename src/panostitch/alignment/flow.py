"""Dense optical flow between two small photos, the second resampled to where the cameras see it in the first.

A patch is found only near where it is sought. What is near the camera may lie a tenth of the photo's length off, all of
it, and sheared: flow from coarse to fine takes it along with its surroundings. It is believed where the way there and
back ends where it began, and where what it brings together is alike. Kroeger et al., "Fast optical flow using dense
inverse search", 2016.
"""

from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.geometry.sampling import rescale
from panostitch.model.camera import Camera

Floats = NDArray[np.float64]
Grey = NDArray[np.uint8]
Levels = NDArray[np.float32]
Booleans = NDArray[np.bool_]
Indices = NDArray[np.intp]
Picture = TypeVar("Picture", Grey, Levels)

STEP = 8  # px between exact coordinates where photo j is resampled
NOWHERE = -1e4  # px: far from any photo
HOME = 0.7  # px from its beginning, that the way there and back may end
WINDOW = 9  # px, side of the patches that must be alike
ALIKE = 0.8  # correlation
SMALLEST = 12  # px of a photo's longer side: in less nobody sees flow
MARGIN = 2  # px of photo j that must be around a point
PATCH_STRIDE = 4  # px: half of a patch, half as many of them as at three


def followed(xy: Indices, camera_i: Camera, camera_j: Camera, grey_i: Grey, grey_j: Grey) -> tuple[Floats, Floats]:
    """Those of the pixels (n, 2) of photo i that flow leads to photo j, and where it leads them: px.

    grey_i, grey_j: the photos (h, w) at the sizes of the cameras
    """
    place = _map(camera_i, camera_j)
    seen = np.asarray(((place >= MARGIN) & (place <= np.array(camera_j.size) - 1 - MARGIN)).all(2))
    if not seen.any() or max(grey_i.shape) < SMALLEST:
        return np.zeros((0, 2)), np.zeros((0, 2))
    # where photo j does not see, photo i is compared with itself: nothing pulls from there
    other = np.where(seen, _sampled(grey_j, place), grey_i)
    there, back = _flow(grey_i, other), _flow(other, grey_i)
    y, x = np.indices(grey_i.shape, np.float32)
    target = np.dstack([x, y]) + there
    home = np.linalg.norm(there + _sampled(back, target), axis=2) < HOME
    within = seen & (_sampled(seen.astype(np.float32), target) == 1)
    good = home & within & _alike(grey_i, _sampled(other, target))
    column, row = xy[good[xy[:, 1], xy[:, 0]]].T
    found = _sampled(place, target[row, column][None])[0] if len(row) else np.zeros((0, 2))
    return np.column_stack([column, row]).astype(np.float64), np.asarray(found, np.float64)


def _map(camera_i: Camera, camera_j: Camera) -> Levels:
    """Where (h, w, 2) px in photo j the cameras see each pixel of photo i; NOWHERE what they do not see."""
    columns, rows = (-(-n // STEP) for n in camera_i.size)
    nodes = rescale(np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1), STEP).reshape(-1, 2)
    exact = np.nan_to_num(camera_j.project(camera_i.rays(nodes)), nan=NOWHERE)
    place = cv2.resize(exact.reshape(rows, columns, 2).astype(np.float32), (columns * STEP, rows * STEP))
    return np.ascontiguousarray(place[: camera_i.size[1], : camera_i.size[0]])


def _sampled(picture: Picture, place: Levels) -> Picture:
    """A picture at places (h, w, 2) px, its edge beyond it."""
    at = cv2.remap(picture, place[..., 0], place[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(at, picture.dtype)


def _flow(one: Grey, other: Grey) -> Levels:
    """Px (h, w, 2) from each pixel of one photo to where the other one shows the same."""
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    search.setFinestScale(0)
    search.setPatchStride(PATCH_STRIDE)
    search.setVariationalRefinementIterations(0)  # half of the time: matches that are believed are no better for it
    return np.asarray(search.calc(one, other, np.zeros((*one.shape, 2), np.float32)), np.float32)


def _alike(one: Grey, other: Grey) -> Booleans:
    """Whether the surroundings of each pixel correlate; those of one grey do not."""
    a, b = one.astype(np.float32), other.astype(np.float32)
    return np.asarray(_covariance(a, b) > ALIKE * np.sqrt(np.abs(_covariance(a, a) * _covariance(b, b))))


def _covariance(one: Levels, other: Levels) -> Levels:
    """Of the surroundings (h, w) of each pixel."""
    window = (WINDOW, WINDOW)
    return np.asarray(cv2.blur(one * other, window) - cv2.blur(one, window) * cv2.blur(other, window), np.float32)
