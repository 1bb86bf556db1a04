"""What every matcher returns: nearest and second nearest descriptors."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Descriptors = NDArray[np.float32] | NDArray[np.uint8]


@dataclass(frozen=True)
class Neighbours:
    """Nearest neighbours between two sets a (n, d) and b (m, d) of descriptors.

    index:  (n,) nearest in b of each of a; -1 where none was found
    best:   (n,) distance to it
    second: (n,) distance to the second nearest; infinite where there is none
    mutual: (n,) whether that nearest one has this one for its nearest in turn
    """

    index: NDArray[np.int32]
    best: NDArray[np.float32]
    second: NDArray[np.float32]
    mutual: NDArray[np.bool_]


class Matcher(Protocol):
    """Finds nearest neighbours; Euclidean for float32, Hamming for uint8. Neither set is empty."""

    def __call__(self, a: Descriptors, b: Descriptors, /, *, seed: int) -> Neighbours: ...
