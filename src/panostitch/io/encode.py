"""OpenCV's encoders, which tell of a failure in two ways."""

from collections.abc import Mapping, Sequence

import cv2
import numpy as np

from panostitch.errors import OutputError
from panostitch.io.rendering import Pixels


def encoded(
    path: str, extension: str, picture: Pixels, settings: Sequence[int], metadata: Mapping[int, bytes] | None = None
) -> Pixels:
    """The bytes (n,) of a picture (h, w, channels), BGR or BGRA, in the format of an extension. Raises OutputError.

    settings, metadata: by OpenCV's `IMWRITE_...` and `IMAGE_METADATA_...`
    """
    chunks = {kind: np.frombuffer(data, np.uint8) for kind, data in (metadata or {}).items() if data}
    try:
        written, data = cv2.imencodeWithMetadata(extension, picture, list(chunks), list(chunks.values()), settings)
    except cv2.error:
        written = False
    if not written:
        raise OutputError(f"{path}: could not be encoded")
    return np.asarray(data, np.uint8)
