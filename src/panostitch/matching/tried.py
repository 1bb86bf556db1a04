"""What came of every pair of photos that was compared."""

from collections.abc import Sequence

from panostitch.model.alignment import PairTried
from panostitch.model.features import Features
from panostitch.model.match import Link, VerifiedMatch
from panostitch.model.photo import Photo


def pairs_tried(photos: Sequence[Photo], features: Sequence[Features], links: Sequence[Link]) -> tuple[PairTried, ...]:
    """The links and the refusals in numbers, by the names of the photos."""
    return tuple(
        PairTried(
            first=photos[link.i].name,
            second=photos[link.j].name,
            first_features=len(features[link.i]),
            second_features=len(features[link.j]),
            matches=link.putative,
            inliers=link.inliers,
            needed=0 if isinstance(link, VerifiedMatch) else link.needed,
            overlap=link.overlap,
            error=link.error if isinstance(link, VerifiedMatch) else 0.0,
            verdict="" if isinstance(link, VerifiedMatch) else link.reason,
        )
        for link in links
    )
