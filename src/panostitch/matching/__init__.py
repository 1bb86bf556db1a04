"""Stage 2: features to groups of photos that belong together."""

from collections.abc import Sequence
from functools import partial

from panostitch.matching import brute_force, flann
from panostitch.matching.cycles import drop_contradictions
from panostitch.matching.groups import find_groups
from panostitch.matching.neighbours import Matcher
from panostitch.matching.pairs import NO_FIRST_LOOK_UP_TO, choose_pairs, promising
from panostitch.matching.preliminary import count_matches
from panostitch.matching.propagate import second_neighbours
from panostitch.matching.ratio import match_pair
from panostitch.matching.retry import improved, pairs_to_retry
from panostitch.matching.tried import pairs_tried
from panostitch.matching.verify import unpromising, verify_pair
from panostitch.model.features import Features
from panostitch.model.match import Link, PutativeMatch
from panostitch.model.photo import Photo
from panostitch.options import MatchingOptions
from panostitch.runtime.executor import Executor, serial
from panostitch.runtime.trace import Trace, silent

__all__ = [
    "FLANN_PAYS_FROM",
    "MATCHERS",
    "drop_contradictions",
    "find_groups",
    "improved",
    "link_photos",
    "match",
    "pairs_to_retry",
    "pairs_tried",
    "verify",
]

MATCHERS: dict[str, Matcher] = {"brute": brute_force.nearest, "flann": flann.nearest}

FLANN_PAYS_FROM = 32_000  # float descriptors in a photo: with 16,000 the exact matrix product is still the quicker


def link_photos(
    photos: Sequence[Photo],
    features: Sequence[Features],
    options: MatchingOptions,
    *,
    run: Executor = serial,
    trace: Trace = silent,
) -> list[Link]:
    """Links and rejections, sorted, of all pairs of photos that deserve to be looked at."""
    pairs = choose_pairs(photos, features, seed=options.seed)
    skipped: list[Link] = []
    if len(photos) > NO_FIRST_LOOK_UP_TO:
        counts = count_matches(features, pairs, ratio=options.ratio, run=run)
        pairs = promising(photos, counts)
        skipped = [unpromising(pair, counts[pair]) for pair in counts.keys() - set(pairs)]
    links = _link_pairs(photos, features, pairs, options, run=run, trace=trace)
    more = second_neighbours(photos, links)
    links += _link_pairs(photos, features, more, options, run=run, trace=trace)
    return sorted([*links, *(link for link in skipped if (link.i, link.j) not in set(more))], key=_pair_of)


def _link_pairs(
    photos: Sequence[Photo],
    features: Sequence[Features],
    pairs: Sequence[tuple[int, int]],
    options: MatchingOptions,
    *,
    run: Executor = serial,
    trace: Trace = silent,
) -> list[Link]:
    """A link or a rejection for each of these pairs (i, j), i < j, by all their features."""
    return verify(photos, features, match(features, pairs, options, run=run), options, run=run, trace=trace)


def _pair_of(link: Link) -> tuple[int, int]:
    return link.i, link.j


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
