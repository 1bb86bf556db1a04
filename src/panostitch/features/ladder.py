"""What to try on photos that stayed alone: a few other ways to see them, each costlier than the one before."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from panostitch.model.features import Attempt
from panostitch.options import FeatureOptions

MORE = 1.0  # megapixels of the first try; small photos are enlarged up to twice
MOST = 2.5  # megapixels of the last one
MANY = 2000  # key points of these tries; twice as many of the last one
# of all four it differs most from the default one: other points, other descriptors
SECOND_DETECTOR: Literal["akaze"] = "akaze"
BIGGER = 1.2  # times as many megapixels as before, or it is no new try


def rungs(options: FeatureOptions) -> tuple[FeatureOptions, ...]:
    """The ways to detect that follow the given one, which has failed."""
    other: Literal["akaze", "sift"] = SECOND_DETECTOR if options.detector != SECOND_DETECTOR else "sift"
    more, most = (max(options.megapixels, size) for size in (MORE, MOST))
    many = max(options.count, MANY)
    return (
        replace(options, work_megapixels=more, max_features=many, contrast="local"),
        replace(options, detector=other, work_megapixels=more, max_features=many, contrast="local"),
        replace(options, work_megapixels=most, max_features=2 * many, contrast="local"),
    )


def brings_more(attempt: Attempt, before: Sequence[Attempt]) -> bool:
    """Whether an attempt sees more than those before it: small photos have no more pixels to show."""
    same = [other for other in before if (other.detector, other.contrast) == (attempt.detector, attempt.contrast)]
    return attempt.megapixels > BIGGER * max((other.megapixels for other in same), default=0.0)
