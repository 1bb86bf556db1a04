"""Stage 1: pixels to key points with descriptors."""

from collections.abc import Callable, Sequence
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.errors import InputError
from panostitch.features import opencv, surf
from panostitch.features.described import Described
from panostitch.features.ladder import brings_more, rungs
from panostitch.features.spread import spread
from panostitch.geometry.sampling import rescale
from panostitch.model.features import Attempt, Features
from panostitch.model.photo import Photo
from panostitch.options import FeatureOptions
from panostitch.runtime.executor import Executor, serial
from panostitch.runtime.trace import Trace, silent

__all__ = ["DETECTORS", "MASK_MARGIN", "attempt_of", "brings_more", "detect", "detect_one", "read_scale", "rungs"]

# From a grey picture (h, w) and a number to at least that many key points where there are so many, in its pixels.
DETECTORS: dict[str, Callable[[NDArray[np.uint8], int], Described]] = {
    "sift": opencv.sift,
    "surf": surf.surf,
    "orb": opencv.orb,
    "akaze": opencv.akaze,
}

# Small photos are enlarged, at most twice and up to so many megapixels: more key points, and better placed ones. SIFT
# needs it least, since it doubles every picture itself.
MAX_ENLARGEMENT = 2.0
ENLARGED_UP_TO = {"sift": 0.4, "surf": 1.0, "orb": 1.0, "akaze": 1.0}

CLAHE_CLIP, CLAHE_TILES = 4.0, 8

MASK_MARGIN = 8  # working px next to transparency where a corner would be the mask's own


def detect(
    photos: Sequence[Photo], options: FeatureOptions, *, run: Executor = serial, trace: Trace = silent
) -> list[Features | InputError]:
    """Key points of each photo, spread over it, in full-resolution pixels; an InputError for unreadable pixels."""
    found: list[Features | InputError] = []
    for photo, features in zip(
        photos, run.map(partial(_try_one, options=options), photos, label="Finding key points"), strict=True
    ):
        if isinstance(features, Features):
            trace("features.detected", index=len(found), photo=photo, features=features)
        found.append(features)
    return found


def _try_one(photo: Photo, options: FeatureOptions) -> Features | InputError:
    try:
        return detect_one(photo, options)
    except InputError as error:
        return error


def detect_one(photo: Photo, options: FeatureOptions) -> Features:
    """Key points of one photo. Raises InputError."""
    grey, mask = _working_picture(photo, options)
    described = DETECTORS[options.detector](grey, options.count)
    if mask is not None:
        described = described.take(np.flatnonzero(_sample(mask, described.xy)))
    chosen = spread(described.xy, described.response, (grey.shape[1], grey.shape[0]), options.count)
    described = described.take(chosen)
    factor = np.array(photo.size) / (grey.shape[1], grey.shape[0])
    pixel_size = float(np.sqrt(factor[0] * factor[1]))
    return Features(
        xy=rescale(described.xy, factor).astype(np.float32),
        scale=described.scale * np.float32(pixel_size),
        angle=described.angle,
        response=described.response,
        descriptors=described.descriptors,
        pixel_size=pixel_size,
    )


def attempt_of(photo: Photo, options: FeatureOptions) -> Attempt:
    """What `detect_one` would do with the photo, its true working size included."""
    enlarged = min(photo.megapixels * MAX_ENLARGEMENT**2, ENLARGED_UP_TO[options.detector])
    megapixels = min(options.megapixels, max(photo.megapixels, enlarged))
    return Attempt(options.detector, round(megapixels, 3), options.contrast)


def read_scale(photo: Photo, options: FeatureOptions) -> float:
    """The scale <= 1 at which `detect_one` reads the photo."""
    return min(float(np.sqrt(options.megapixels / photo.megapixels)), 1.0)


def _working_picture(photo: Photo, options: FeatureOptions) -> tuple[NDArray[np.uint8], NDArray[np.uint8] | None]:
    """The photo in grey at its working size, and where it may be used."""
    grey, mask = photo.read_grey(read_scale(photo, options))
    if mask is not None:
        kernel = np.ones((2 * MASK_MARGIN + 1, 2 * MASK_MARGIN + 1), np.uint8)
        mask = np.asarray(cv2.erode(mask, kernel), np.uint8)
    wanted = min(options.megapixels, ENLARGED_UP_TO[options.detector])
    enlargement = min(float(np.sqrt(wanted / photo.megapixels)), MAX_ENLARGEMENT)
    if enlargement > 1:
        size = round(photo.size[0] * enlargement), round(photo.size[1] * enlargement)
        grey = np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_CUBIC), np.uint8)
        mask = None if mask is None else np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST), np.uint8)
    return _evened(grey) if options.contrast == "local" else grey, mask


def _evened(grey: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The picture with the contrast of each part stretched (CLAHE, Zuiderveld 1994): fog and dusk keep their points."""
    return np.asarray(cv2.createCLAHE(CLAHE_CLIP, (CLAHE_TILES, CLAHE_TILES)).apply(grey), np.uint8)


def _sample(mask: NDArray[np.uint8], xy: NDArray[np.float32]) -> NDArray[np.bool_]:
    column, row = np.rint(xy).astype(int).T
    return np.asarray(mask[row.clip(0, mask.shape[0] - 1), column.clip(0, mask.shape[1] - 1)] > 0)
