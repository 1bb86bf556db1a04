"""READ FIRST: the whole program in two functions. `align` looks at small copies of the photos and ends in cameras;
`render` turns cameras into a panorama, a function from a region to its pixels.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from panostitch.alignment import align_group
from panostitch.compositing import lay_out, make_panorama, make_plan
from panostitch.errors import InputError, NoOverlapError
from panostitch.features import detect
from panostitch.matching import choose_pairs, explain_left_out, find_groups, match, verify
from panostitch.model.alignment import Alignment, LeftOut
from panostitch.model.features import Features
from panostitch.model.match import Groups, Link, VerifiedMatch
from panostitch.model.panorama import Panorama
from panostitch.model.photo import Photo
from panostitch.options import Options
from panostitch.runtime.executor import Executor, serial
from panostitch.runtime.trace import Trace, silent


@dataclass(frozen=True)
class Recognition:
    """What the matches say of a heap of photos: which belong together, which are linked, which cannot be read."""

    photos: tuple[Photo, ...]
    features: tuple[Features, ...]
    links: tuple[Link, ...]
    groups: Groups
    unreadable: tuple[LeftOut, ...]


def align(photos: Sequence[Photo], options: Options, *, run: Executor = serial, trace: Trace = silent) -> Alignment:
    """Cameras of the largest panorama among the photos, and why the other photos are not in it.

    Raises NoOverlapError where no two photos overlap, AlignmentError where no cameras explain the matches.
    """
    recognition = recognise(photos, options, run=run, trace=trace)
    if not recognition.groups.panoramas:
        raise no_overlap(recognition)
    return align_panorama(recognition, 0, options, trace=trace)


def recognise(
    photos: Sequence[Photo], options: Options, *, run: Executor = serial, trace: Trace = silent
) -> Recognition:
    """Features, matches, links, groups. Raises InputError where fewer than two photos can be read."""
    trace("photos.read", photos=photos)
    found = detect(photos, options.features, run=run, trace=trace)
    failures = [(p, f) for p, f in zip(photos, found, strict=True) if isinstance(f, InputError)]
    if failures and len(photos) - len(failures) < 2:
        raise _unreadable(failures)
    unreadable = [LeftOut(p.name, f.message.removeprefix(f"{p.path}: "), hint=f.hint) for p, f in failures]
    photos = [p for p, f in zip(photos, found, strict=True) if isinstance(f, Features)]
    features = [f for f in found if isinstance(f, Features)]
    matches = match(features, choose_pairs(len(photos)), options.matching, run=run)
    links = verify(photos, features, matches, options.matching, run=run, trace=trace)
    groups = find_groups(len(photos), links)
    trace("matching.grouped", photos=photos, links=links, groups=groups)
    return Recognition(tuple(photos), tuple(features), tuple(links), groups, tuple(unreadable))


def align_panorama(recognition: Recognition, number: int, options: Options, *, trace: Trace = silent) -> Alignment:
    """Cameras of one group of photos that belong together."""
    members = recognition.groups.panoramas[number]
    place = {photo: n for n, photo in enumerate(members)}
    links = [
        link.renumbered(place[link.i], place[link.j])
        for link in recognition.links
        if isinstance(link, VerifiedMatch) and link.i in place
    ]
    return align_group(
        [recognition.photos[n] for n in members],
        links,
        options.alignment,
        pixel_size=max(recognition.features[n].pixel_size for n in members),
        left_out=left_out(recognition, members),
        trace=trace,
    )


def render(alignment: Alignment, options: Options, *, run: Executor = serial, trace: Trace = silent) -> Panorama:
    """The panorama of an alignment; its pixels are made when a region is read."""
    canvas = lay_out(alignment, options.layout, trace=trace)
    plan = make_plan(alignment, canvas, options.compositing, options.layout.crop, run=run, trace=trace)
    return make_panorama(alignment, canvas, plan, options.compositing)


def _unreadable(failures: Sequence[tuple[Photo, InputError]]) -> InputError:
    """The error for too few photos that can be read."""
    first = failures[0][1]
    return InputError(first.message, details=tuple(error.message for _, error in failures[1:]), hint=first.hint)


def left_out(recognition: Recognition, kept: Sequence[int]) -> list[LeftOut]:
    """Why each photo that is not among the kept ones (indices) is not in a panorama."""
    lonely = explain_left_out(recognition.photos, recognition.links, recognition.groups, kept)
    return [*recognition.unreadable, *lonely]


def no_overlap(recognition: Recognition) -> NoOverlapError:
    """The error that says of every photo why it overlaps no other."""
    return NoOverlapError(
        "no two photos overlap",
        details=tuple(f"{p.name}: {'; '.join(p.details) or p.reason}" for p in left_out(recognition, kept=())),
        hint="photos need about a third of their width in common; see the matches with --debug-dir",
    )
