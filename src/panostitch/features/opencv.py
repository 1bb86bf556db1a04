"""SIFT, ORB and AKAZE: the one place that knows how OpenCV spells its detectors.

SIFT: Lowe 2004, described as RootSIFT (Arandjelovic & Zisserman 2012). ORB: Rublee et al. 2011. AKAZE: Alcantarilla
et al. 2013. OpenCV 5 moved AKAZE to `cv2.xfeatures2d`.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.features.described import Described

Grey = NDArray[np.uint8]

_cv2: Any = cv2  # the stubs that OpenCV ships do not know its own constructors

# ORB piles its strongest corners on a few bushes: ask for many more than are kept, and spread them.
ORB_SURPLUS = 6
ORB_FAST_THRESHOLD = 7
SIFT_SURPLUS = 1.3
FEWEST_TO_SPREAD = 300  # key points to choose from, however few are kept
SIFT_ENOUGH = 0.4  # of what was asked for; fewer, and weaker ones are sought too
SIFT_CONTRASTS = (0.04, 0.008)  # OpenCV's own; and for dusk and haze, whose key points are all weak, a fifth of it
AKAZE_THRESHOLD = 3e-4  # the default, 1e-3, leaves dark photos without key points


def sift(grey: Grey, count: int) -> Described:
    """SIFT key points with RootSIFT descriptors (n, 128) float32 of unit length."""
    points: Any = []
    descriptors: Any = None
    for contrast in SIFT_CONTRASTS:
        if len(points) < count * SIFT_ENOUGH:
            # without the precise upscale every key point lies 0.25 px too far right and down
            detector = _cv2.SIFT_create(
                nfeatures=max(int(SIFT_SURPLUS * count), FEWEST_TO_SPREAD),
                contrastThreshold=contrast,
                enable_precise_upscale=True,
            )
            points, descriptors = _run(detector, grey)
    if descriptors is None:
        return _described([], np.zeros((0, 128), np.float32))
    roots = np.sqrt(descriptors / np.maximum(descriptors.sum(1, keepdims=True), 1e-7))
    return _described(points, roots.astype(np.float32))


def orb(grey: Grey, count: int) -> Described:
    """ORB key points with descriptors (n, 32) uint8."""
    detector = _cv2.ORB_create(nfeatures=ORB_SURPLUS * count, fastThreshold=ORB_FAST_THRESHOLD)
    points, descriptors = _run(detector, grey)
    return _described(points, np.zeros((0, 32), np.uint8) if descriptors is None else descriptors)


def akaze(grey: Grey, count: int) -> Described:
    """AKAZE key points with MLDB descriptors (n, 61) uint8; it finds what there is, whatever the count."""
    del count
    create = _cv2.AKAZE_create if hasattr(_cv2, "AKAZE_create") else _cv2.xfeatures2d.AKAZE_create
    points, descriptors = _run(create(threshold=AKAZE_THRESHOLD), grey)
    return _described(points, np.zeros((0, 61), np.uint8) if descriptors is None else descriptors)


def _run(detector: Any, grey: Grey) -> tuple[Any, Any]:
    """Key points and descriptors; none for a picture that is too small for the detector's windows."""
    try:
        points, descriptors = detector.detectAndCompute(grey, None)
    except cv2.error:
        if min(grey.shape) < 64:  # ORB raises where others find nothing
            return [], None
        raise
    return points, descriptors


def _described(points: Any, descriptors: Any) -> Described:
    size, angle, response = np.array([(p.size, p.angle, p.response) for p in points], np.float32).reshape(-1, 3).T
    return Described(
        xy=np.array(cv2.KeyPoint.convert(points), np.float32).reshape(-1, 2),
        scale=size / np.float32(2),
        angle=np.deg2rad(angle),
        response=np.ascontiguousarray(response),
        descriptors=descriptors,
    )
