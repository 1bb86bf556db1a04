"""Key points of one photo with their descriptors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Attempt:
    """A way in which key points of a photo were sought.

    megapixels: the size at which it was searched
    contrast:   as it is in the photo (own), or evened out (local)
    """

    detector: str
    megapixels: float
    contrast: str = "own"

    def __str__(self) -> str:
        evened = " with evened contrast" if self.contrast == "local" else ""
        return f"{self.detector} at {self.megapixels:.2g} MP{evened}"


@dataclass(frozen=True)
class Features:
    """Key points in full-resolution pixels of the upright photo.

    xy:          (n, 2) float32 px
    scale:       (n,) float32 px, radius of what was described
    angle:       (n,) float32 radians
    response:    (n,) float32, strength; comparable within one photo
    descriptors: (n, d) float32 of unit length (Euclidean distance) or uint8 (Hamming distance)
    pixel_size:  full-resolution px in a pixel of the picture that was searched: the unit of their precision
    """

    xy: NDArray[np.float32]
    scale: NDArray[np.float32]
    angle: NDArray[np.float32]
    response: NDArray[np.float32]
    descriptors: NDArray[np.float32] | NDArray[np.uint8]
    pixel_size: float

    def __len__(self) -> int:
        return len(self.xy)

    def take(self, index: NDArray[np.integer]) -> "Features":
        """The features with these indices, in this order."""
        return Features(
            self.xy[index],
            self.scale[index],
            self.angle[index],
            self.response[index],
            self.descriptors[index],
            self.pixel_size,
        )
