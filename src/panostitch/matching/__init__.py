"""Stage 2: features to groups of photos that belong together."""

from collections.abc import Sequence
from functools import partial

from panostitch.matching import brute_force, flann
from panostitch.matching.groups import find_groups
from panostitch.matching.left_out import explain_left_out
from panostitch.matching.neighbours import Matcher
from panostitch.matching.pairs import choose_pairs
from panostitch.matching.ratio import match_pair
from panostitch.matching.verify import verify_pair
from panostitch.model.features import Features
from panostitch.model.match import Link, PutativeMatch
from panostitch.model.photo import Photo
from panostitch.options import MatchingOptions
from panostitch.runtime.executor import Executor, serial
from panostitch.runtime.trace import Trace, silent

__all__ = ["FLANN_PAYS_FROM", "MATCHERS", "choose_pairs", "explain_left_out", "find_groups", "match", "verify"]

MATCHERS: dict[str, Matcher] = {"brute": brute_force.nearest, "flann": flann.nearest}

FLANN_PAYS_FROM = 6000  # float descriptors in a photo; below, the exact matrix product is quicker


def match(
    features: Sequence[Features],
    pairs: Sequence[tuple[int, int]],
    options: MatchingOptions,
    *,
    run: Executor = serial,
) -> list[PutativeMatch]:
    """Putative matches of each pair (i, j), i < j, by descriptors alone."""
    matcher = MATCHERS[_matcher_name(features, options)]
    work = partial(match_pair, features, matcher=matcher, ratio=options.ratio, seed=options.seed)
    return list(run.map(work, pairs, label="Matching photos"))


def _matcher_name(features: Sequence[Features], options: MatchingOptions) -> str:
    if options.matcher != "auto":
        return options.matcher
    most = max((len(f) for f in features if f.descriptors.dtype != "uint8"), default=0)
    return "flann" if most > FLANN_PAYS_FROM else "brute"


def verify(
    photos: Sequence[Photo],
    features: Sequence[Features],
    matches: Sequence[PutativeMatch],
    options: MatchingOptions,
    *,
    run: Executor = serial,
    trace: Trace = silent,
) -> list[Link]:
    """A VerifiedMatch or a Rejection for each putative match."""
    work = partial(verify_pair, photos, features, options=options)
    links = []
    for putative, link in zip(matches, run.map(work, matches, label="Verifying matches"), strict=True):
        trace("matching.matched", photos=photos, features=features, match=putative)
        trace("matching.linked", photos=photos, features=features, match=putative, link=link)
        links.append(link)
    return links
