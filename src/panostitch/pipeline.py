"""READ FIRST: the whole program in two functions. `align` looks at small copies of the photos and ends in cameras;
`render` turns cameras into a panorama, a function from a region to its pixels.
"""

from collections.abc import Sequence
from dataclasses import replace

from panostitch.alignment import align_group
from panostitch.compositing import decoding_bytes, frame, make_cube, make_panorama, make_plan
from panostitch.compositing.view import look
from panostitch.diagnosis import diagnose, explain_left_out
from panostitch.errors import InputError, NoOverlapError
from panostitch.io.colour import in_one_profile
from panostitch.matching import pairs_tried
from panostitch.model.alignment import UNREADABLE, Alignment, LeftOut
from panostitch.model.match import VerifiedMatch
from panostitch.model.panorama import Panorama
from panostitch.model.photo import Photo
from panostitch.options import Options
from panostitch.recognition import Recognition
from panostitch.recognition import recognise as see_what_belongs_together
from panostitch.runtime.executor import Executor, serial
from panostitch.runtime.memory import give_back, within
from panostitch.runtime.trace import Trace, silent

__all__ = ["Recognition", "align", "align_panorama", "check_all_in", "left_out", "no_overlap", "recognise", "render"]


def align(
    photos: Sequence[Photo],
    options: Options,
    *,
    unreadable: Sequence[LeftOut] = (),
    run: Executor = serial,
    trace: Trace = silent,
) -> Alignment:
    """Cameras of the largest panorama among the photos, and why the other photos are not in it.

    `unreadable` are photos that were given as well, for the record.
    Raises NoOverlapError where no two photos overlap, AlignmentError where no cameras explain the matches.
    """
    recognition = recognise(photos, options, unreadable=unreadable, run=run, trace=trace)
    if not recognition.groups.panoramas:
        raise no_overlap(recognition)
    return align_panorama(recognition, 0, options, run=run, trace=trace)


def recognise(
    photos: Sequence[Photo],
    options: Options,
    *,
    unreadable: Sequence[LeftOut] = (),
    run: Executor = serial,
    trace: Trace = silent,
) -> Recognition:
    """Which photos belong together, and why the others do not. Raises InputError where fewer than two can be read."""
    found = see_what_belongs_together(photos, options, run=run, trace=trace)
    found = replace(found, unreadable=(*unreadable, *found.unreadable))
    found = replace(found, findings=diagnose(found, options, run=run, trace=trace))
    if trace is not silent:
        largest = found.groups.panoramas[0] if found.groups.panoramas else ()
        tried = pairs_tried(found.photos, found.features, found.links)
        trace("diagnosis.left_out", left_out=left_out(found, largest), pairs=tried)
    return found


def align_panorama(
    recognition: Recognition, number: int, options: Options, *, run: Executor = serial, trace: Trace = silent
) -> Alignment:
    """Cameras of one group of photos that belong together."""
    members = recognition.groups.panoramas[number]
    place = {photo: n for n, photo in enumerate(members)}
    links = [
        link.renumbered(place[link.i], place[link.j])
        for link in recognition.links
        if isinstance(link, VerifiedMatch) and link.i in place
    ]
    names = {recognition.photos[n].name for n in members}
    aligned = align_group(
        [recognition.photos[n] for n in members],
        links,
        options.alignment,
        pixel_size=max(recognition.features[n].pixel_size for n in members),
        left_out=left_out(recognition, members),
        pairs=pairs_tried(recognition.photos, recognition.features, recognition.links),
        run=run,
        trace=trace,
    )
    # weak links of other panoramas are no concern of this one
    return replace(aligned, findings=tuple(f for f in recognition.findings if not f.weak or f.photo in names))


def render(alignment: Alignment, options: Options, *, run: Executor = serial, trace: Trace = silent) -> Panorama:
    """The panorama of an alignment; its pixels are made when a region is read, in one colour profile.

    Raises LimitError where --max-memory does not suffice.
    """
    give_back()
    alignment = replace(look(alignment, options.layout), photos=in_one_profile(alignment.photos))
    limit = options.output.memory
    run = within(run, limit, each=decoding_bytes(alignment.photos))
    if options.layout.cube:
        cube = make_cube(alignment, options.layout, options.compositing, memory=limit, run=run, trace=trace)
        trace("panorama.planned", alignment=alignment, panorama=cube)
        return cube
    canvas, crop = frame(alignment, options.layout, run=run, trace=trace)
    plan = make_plan(alignment, canvas, options.compositing, crop, run=run, trace=trace)
    give_back()
    panorama = make_panorama(alignment, canvas, plan, options.compositing, memory=limit)
    trace("panorama.planned", alignment=alignment, panorama=panorama)
    return panorama


def left_out(recognition: Recognition, kept: Sequence[int]) -> list[LeftOut]:
    """Why each photo that is not among the kept ones (indices) is not in a panorama."""
    r = recognition
    lonely = explain_left_out(r.photos, r.links, r.groups, kept, r.attempts, r.findings)
    return [*recognition.unreadable, *lonely]


def check_all_in(photos: Sequence[LeftOut]) -> None:
    """What --require-all asks of the photos that were left out: that there are none.

    Raises InputError where one cannot be read, NoOverlapError for others.
    """
    if not photos:
        return
    first, *others = sorted(photos, key=lambda photo: photo.cause != UNREADABLE)
    raise (InputError if first.cause == UNREADABLE else NoOverlapError)(
        f"{first.name}: {first.reason}",
        details=(*first.details, *(f"{photo.name}: {photo.reason}" for photo in others)),
        hint=first.hint or "without --require-all the panorama is made of the other photos",
    )


def no_overlap(recognition: Recognition) -> NoOverlapError:
    """The error that says of every photo why it overlaps no other."""
    names: dict[tuple[str, ...], list[str]] = {}
    everybody = left_out(recognition, kept=())
    for photo in everybody:
        names.setdefault(photo.details or (photo.reason,), []).append(photo.name)
    hints = {photo.hint for photo in everybody}
    return NoOverlapError(
        "no two photos overlap",
        details=tuple(f"{', '.join(who)}: {'; '.join(what)}" for what, who in names.items()),
        hint=hints.pop() if len(hints) == 1 else "photos need about a third of their width in common",
    )
