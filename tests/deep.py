"""Photos of 16 bits that exist in memory only."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.io.deep import to_bytes
from panostitch.model.photo import Photo
from panostitch.synthetic.render import ArraySource


@dataclass(frozen=True)
class DeepArray:
    """Pixels (h, w, 3) of 16 bits."""

    pixels: NDArray[np.uint16]

    def read(self, scale=1.0):
        """The pixels at `scale` <= 1, area averaged; opaque."""
        size = [max(1, round(n * scale)) for n in self.pixels.shape[1::-1]]
        return self.pixels if scale == 1 else cv2.resize(self.pixels, size, interpolation=cv2.INTER_AREA), None


def deep_photo(name, pixels):
    """A photo of these pixels (h, w, 3) of 16 bits."""
    pixels = np.ascontiguousarray(pixels)
    return Photo(name, pixels.shape[1::-1], ArraySource(to_bytes(pixels)), deep=DeepArray(pixels))
