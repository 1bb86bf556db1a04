"""What can be said of a photo by itself: light, sharpness, structure, and whether it repeats itself."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.matching.brute_force import floats
from panostitch.model.features import Features
from panostitch.model.photo import Photo

Grey = NDArray[np.float32]

MEGAPIXELS = 0.25  # at which photos are looked at: blur that is not seen here keeps no features from matching
GAMMA = 2.2
BURNT, BLACK = 250, 5  # grey levels from which on nothing is to be told
STEPS = (1, 4, 12)  # px, over which grey values are compared
STRONGEST = 98.0  # per cent of the pixels are weaker than the edges that sharpness is measured on
CELLS = 8  # a photo is this many cells wide and high
DETAIL = (1.5, 6.0)  # px, deviations of the band in which key points are found
PLAIN = 2.0  # grey levels, deviation in the band; a cell below it shows noise
TWIN = 0.45  # of the median distance of descriptors; key points as alike as that show the same thing
APART = 0.02  # of the photo's extent; nearer key points are the same thing, described twice
FEWEST = 20  # key points of which shares can be told


@dataclass(frozen=True)
class Look:
    """A photo in numbers.

    key_points: how many were found
    light:      EV, of the mean light; white is 0
    burnt:      share of the pixels that are white
    black:      share of the pixels that are black
    fine, coarse: how strong edges are over 1 px beside 4 px, and over 4 px beside 12 px, in the direction in which
                they are weakest: sharp photos keep much of the strength
    texture:    share of the photo that has structure beyond noise
    twins:      share of its key points that look like others of the same photo
    """

    key_points: int
    light: float
    burnt: float
    black: float
    fine: float
    coarse: float
    texture: float
    twins: float


def look_at(photo: Photo, features: Features) -> Look:
    """The look of a photo. Raises InputError where it cannot be read."""
    pixels, mask = photo.read_grey(min(1.0, (MEGAPIXELS / photo.megapixels) ** 0.5))
    grey = pixels.astype(np.float32)
    seen = grey[mask > 0] if mask is not None and mask.any() else grey.ravel()
    if mask is not None:
        grey = np.where(mask > 0, grey, seen.mean(dtype=np.float32))
    fine, coarse = _sharpness(grey)
    return Look(
        key_points=len(features),
        light=float(np.log2(np.mean((seen / 255) ** GAMMA) + 1e-6)),
        burnt=float(np.mean(seen >= BURNT)),
        black=float(np.mean(seen <= BLACK)),
        fine=fine,
        coarse=coarse,
        texture=_texture(grey),
        twins=_twins(features),
    )


def _sharpness(grey: Grey) -> tuple[float, float]:
    """How much of the strength of edges is left over shorter distances, in the worst of four directions.

    All of it where there are no edges: what is plain is not blurred.
    """
    margin = STEPS[-1]
    if min(grey.shape) <= 2 * margin + 1:
        return 1.0, 1.0
    middle = grey[margin:-margin, margin:-margin]
    strength = np.empty((4, len(STEPS)))
    for row, (down, across) in enumerate(((0, 1), (1, 0), (1, 1), (1, -1))):
        for column, step in enumerate(STEPS):
            move = step * down, step * across
            there, back = (np.roll(grey, (s * move[0], s * move[1]), (0, 1)) for s in (1, -1))
            bend = np.abs(2 * middle - (there + back)[margin:-margin, margin:-margin])
            strength[row, column] = np.percentile(bend, STRONGEST)
    kept = np.where(strength[:, 1:] < 1, 1.0, strength[:, :-1] / np.maximum(strength[:, 1:], 1.0))
    return float(kept[:, 0].min()), float(kept[:, 1].min())


def _texture(grey: Grey) -> float:
    band = cv2.GaussianBlur(grey, (0, 0), DETAIL[0]) - cv2.GaussianBlur(grey, (0, 0), DETAIL[1])
    cells = [cell for rows in np.array_split(band, CELLS) for cell in np.array_split(rows, CELLS, axis=1)]
    return float(np.mean([cell.size > 0 and cell.std() > PLAIN for cell in cells]))


def _twins(features: Features) -> float:
    if len(features) < FEWEST:
        return 0.0
    rows = floats(features.descriptors)
    squares = (rows**2).sum(1)
    distance = np.sqrt(np.maximum(squares[:, None] + squares - 2 * rows @ rows.T, 0))
    xy = features.xy @ np.array([1, 1j], np.complex64)
    near = np.abs(xy[:, None] - xy) < APART * np.ptp(features.xy, axis=0).max()
    nearest = np.where(near, np.inf, distance).min(1)
    return float(np.mean(nearest < TWIN * np.median(distance)))
