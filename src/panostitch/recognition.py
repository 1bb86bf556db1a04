"""The first half of aligning: which of a heap of photos show the same thing, and which belong together."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from panostitch.errors import InputError
from panostitch.features import attempt_of, brings_more, detect, rungs
from panostitch.matching import drop_contradictions, find_groups, improved, link_photos, match, pairs_to_retry, verify
from panostitch.model.alignment import LeftOut
from panostitch.model.features import Attempt, Features
from panostitch.model.finding import Finding
from panostitch.model.match import Groups, Link
from panostitch.model.photo import Photo
from panostitch.options import FeatureOptions, Options
from panostitch.runtime.executor import Executor, serial
from panostitch.runtime.trace import Trace, silent


@dataclass(frozen=True)
class Recognition:
    """What the matches say of a heap of photos: which belong together, which are linked, which cannot be read.

    features: of the first attempt; links may rest on those of a later one
    links:    the outcome of every pair that was looked at, sorted; of pairs tried again the best outcome
    attempts: how the key points of each photo were sought, the first attempt first
    findings: why photos stayed alone, and links are weak
    """

    photos: tuple[Photo, ...]
    features: tuple[Features, ...]
    links: tuple[Link, ...]
    groups: Groups
    unreadable: tuple[LeftOut, ...]
    attempts: tuple[tuple[Attempt, ...], ...] = ()
    findings: tuple[Finding, ...] = ()


def recognise(
    photos: Sequence[Photo], options: Options, *, run: Executor = serial, trace: Trace = silent
) -> Recognition:
    """Features, matches, links, groups. Raises InputError where fewer than two photos can be read."""
    check_enough(photos)
    trace("photos.read", photos=photos)
    found = detect(photos, options.features, run=run, trace=trace)
    failures = [(p, f) for p, f in zip(photos, found, strict=True) if isinstance(f, InputError)]
    if failures and len(photos) - len(failures) < 2:
        raise _unreadable(failures)
    unreadable = [LeftOut.unreadable(f, p.name) for p, f in failures]
    photos = [p for p, f in zip(photos, found, strict=True) if isinstance(f, Features)]
    features = [f for f in found if isinstance(f, Features)]
    links = drop_contradictions(photos, link_photos(photos, features, options.matching, run=run, trace=trace))
    attempts = [(attempt_of(photo, options.features),) for photo in photos]
    first = Recognition(
        tuple(photos),
        tuple(features),
        tuple(links),
        find_groups(len(photos), links),
        tuple(unreadable),
        tuple(attempts),
    )
    done = _with_retries(first, options, run, trace) if options.matching.retries == "auto" else first
    trace("matching.grouped", photos=done.photos, links=done.links, groups=done.groups)
    return done


def check_enough(photos: Sequence[Photo]) -> None:
    """Raise InputError for fewer than two photos."""
    if len(photos) < 2:
        what = f"{photos[0].name} is the only photo" if photos else "no photos"
        raise InputError(f"{what}: a panorama needs two or more", hint="name the other photos too, or their folder")


def _with_retries(found: Recognition, options: Options, run: Executor, trace: Trace) -> Recognition:
    """The recognition after all further ways to see what has stayed apart, or as many as it takes to join it."""
    for rung in rungs(options.features):
        pairs = pairs_to_retry(found.photos, found.links, found.groups)
        if pairs:
            found = _retried(found, pairs, replace(options, features=rung), run, trace)
    return found


def _retried(
    found: Recognition, pairs: Sequence[tuple[int, int]], options: Options, run: Executor, trace: Trace
) -> Recognition:
    """The recognition after these pairs were tried again; for a link it takes as much as ever."""
    ways = {n: attempt_of(found.photos[n], options.features) for n in sorted({n for pair in pairs for n in pair})}
    new = {n for n, way in ways.items() if brings_more(way, found.attempts[n])}
    pairs = [pair for pair in pairs if new & set(pair)]
    if not pairs:
        return found
    again = _detected_again(found.photos, sorted({n for pair in pairs for n in pair}), options.features, run)
    pairs = [(i, j) for i, j in pairs if i in again and j in again]
    features = [again.get(n, one) for n, one in enumerate(found.features)]
    matches = match(features, pairs, options.matching, run=run)
    retried = verify(found.photos, features, matches, options.matching, run=run)
    links = drop_contradictions(found.photos, improved(found.links, retried))
    kept = set(map(id, links))
    for putative, link in zip(matches, retried, strict=True):
        if id(link) in kept:
            trace("matching.linked", photos=found.photos, features=features, match=putative, link=link)
    trace("matching.retried", photos=found.photos, options=options.features, links=retried)
    attempts = tuple((*before, ways[n]) if n in again else before for n, before in enumerate(found.attempts))
    return replace(found, links=tuple(links), groups=find_groups(len(features), links), attempts=attempts)


def _detected_again(
    photos: Sequence[Photo], members: Sequence[int], options: FeatureOptions, run: Executor
) -> dict[int, Features]:
    """Features of these photos, sought in another way."""
    found = detect([photos[n] for n in members], options, run=run)
    return {n: one for n, one in zip(members, found, strict=True) if isinstance(one, Features)}


def _unreadable(failures: Sequence[tuple[Photo, InputError]]) -> InputError:
    """The error for too few photos that can be read."""
    first = failures[0][1]
    return InputError(first.message, details=tuple(error.message for _, error in failures[1:]), hint=first.hint)
