"""What is known of a pair of photos: putative matches, verified matches, or why there is no link."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int32]
Floats = NDArray[np.float64]

BASE_INLIERS = 8.0  # Brown & Lowe 2007, alpha and beta
INLIERS_PER_MATCH = 0.3


def needed_inliers(matches: int) -> int:
    """Inliers that make a link, of so many matches in the overlap."""
    return int(BASE_INLIERS + INLIERS_PER_MATCH * matches) + 1


@dataclass(frozen=True)
class PutativeMatch:
    """Matches of photos i < j by descriptors alone.

    raw:   (n, 2) indices of features in i and j: the nearest neighbour in j of each feature of i
    pairs: (m, 2) those of them that pass the ratio test and are mutual
    """

    i: int
    j: int
    raw: Indices
    pairs: Indices


@dataclass(frozen=True)
class VerifiedMatch:
    """Matches of photos i < j that one homography explains.

    xy_i, xy_j: (k, 2) px, the inliers in each photo
    j_from_i:   (3, 3) homography from pixels of i to pixels of j
    putative:   number of matches it was estimated from
    overlap:    share of the smaller photo that the other one covers, 0 to 1
    error:      rms distance px of the inliers under the homography
    in_overlap: number of features, matched or not, that lie in the overlap, of the photo with fewer of them there
    """

    i: int
    j: int
    xy_i: Floats
    xy_j: Floats
    j_from_i: Floats
    putative: int
    overlap: float
    error: float
    in_overlap: int

    @property
    def inliers(self) -> int:
        """Number of matches that the homography explains."""
        return len(self.xy_i)

    @property
    def strength(self) -> float:
        """How much speaks for the link by itself: inliers by what their number would have to be (Brown & Lowe 2007).

        Here all features in the overlap count, not the matched ones alone: photos that show the same pattern at two
        places agree in the pattern, and in nothing around it.
        """
        return self.inliers / needed_inliers(max(self.putative, self.in_overlap))

    def renumbered(self, i: int, j: int) -> "VerifiedMatch":
        """The same link between photos that have other numbers, i < j."""
        return replace(self, i=i, j=j)


@dataclass(frozen=True)
class ControlPoints:
    """Points (n, 2) px of photos i and j that show the same thing."""

    i: int
    j: int
    xy_i: Floats
    xy_j: Floats

    def __len__(self) -> int:
        return len(self.xy_i)

    def swapped(self) -> "ControlPoints":
        """The same points seen from the other photo."""
        return ControlPoints(self.j, self.i, self.xy_j, self.xy_i)

    def joined(self, more: "ControlPoints") -> "ControlPoints":
        """These and more of the same pair."""
        return ControlPoints(self.i, self.j, np.vstack([self.xy_i, more.xy_i]), np.vstack([self.xy_j, more.xy_j]))

    def take(self, index: NDArray[np.integer] | NDArray[np.bool_]) -> "ControlPoints":
        """Those with these indices."""
        return ControlPoints(self.i, self.j, self.xy_i[index], self.xy_j[index])


@dataclass(frozen=True)
class Rejection:
    """Why photos i < j are not linked; falsy, so that `if link` reads well.

    inliers, needed: matches that agreed, and how many it would have taken
    overlap:         rough share of overlap where one can be told, else 0
    """

    i: int
    j: int
    reason: str
    putative: int = 0
    inliers: int = 0
    needed: int = 0
    overlap: float = 0.0

    def __bool__(self) -> bool:
        return False


Link = VerifiedMatch | Rejection


@dataclass(frozen=True)
class Groups:
    """Photos that belong together, largest group first, and those that belong to none (indices)."""

    panoramas: tuple[tuple[int, ...], ...]
    singles: tuple[int, ...]
