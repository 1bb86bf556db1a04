"""Grey photos at whole fractions of their size, read when they are needed and kept as far as the memory allows."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.model.photo import Photo
from panostitch.runtime.cache import LastUsed

Grey = NDArray[np.uint8]

CACHE_BYTES = 512 << 20  # grey photos kept for the next pairs


@dataclass(frozen=True)
class Pictures:
    """Grey photos, by their index."""

    photos: Sequence[Photo]
    cache: LastUsed[Grey]

    def read(self, index: int, factor: int) -> Grey:
        """Photo (h, w) at 1 / factor of its size; sizes are rounded. Raises InputError where it cannot be read."""
        return self.cache.get((index, factor), partial(self._make, index, factor))

    def _make(self, index: int, factor: int) -> Grey:
        if factor == 1:
            return self.photos[index].read_grey()[0]
        full = self.read(index, 1)
        size = (max(1, round(full.shape[1] / factor)), max(1, round(full.shape[0] / factor)))
        return np.asarray(cv2.resize(full, size, interpolation=cv2.INTER_AREA), np.uint8)


def pictures_of(photos: Sequence[Photo]) -> Pictures:
    """The grey photos of these, none of them read yet."""
    return Pictures(photos, LastUsed(CACHE_BYTES, lambda grey: grey.nbytes))
