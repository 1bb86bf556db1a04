"""What every detector returns: key points in the pixels of the picture it was given."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Described:
    """Key points of a picture; see model.features.Features for the meaning of the fields."""

    xy: NDArray[np.float32]
    scale: NDArray[np.float32]
    angle: NDArray[np.float32]
    response: NDArray[np.float32]
    descriptors: NDArray[np.float32] | NDArray[np.uint8]

    def take(self, index: NDArray[np.integer]) -> "Described":
        """The key points with these indices, in this order."""
        return Described(
            self.xy[index], self.scale[index], self.angle[index], self.response[index], self.descriptors[index]
        )
