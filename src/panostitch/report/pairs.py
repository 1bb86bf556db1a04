"""Two photos side by side with their matches, and how far the cameras leave them apart."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from panostitch.debug.draw import GAP
from panostitch.geometry.sampling import rescale
from panostitch.model.alignment import Alignment
from panostitch.model.match import ControlPoints, Link, Rejection
from panostitch.model.photo import Photo
from panostitch.report import lines
from panostitch.report.record import Compared, Names, Record

Floats = NDArray[np.float64]
Size = tuple[int, int]
Kind = Literal["link", "weak link", "dropped", "refused"]

HEIGHT = 600.0  # units of the drawing, of both photos
MOST_LINES = 100  # that agree, and as many that do not; more hide the photos
MOST_LINKS, MOST_REFUSED = 150, 20  # pairs that are shown
CLEAR = 0.03  # of a photo's diagonal: as long the residuals are drawn
STEPS = (1, 2, 5)


@dataclass(frozen=True)
class Residuals:
    """Where the cameras put points of the first photo in the second one: `strokes` are drawn `times` as long."""

    size: Size
    strokes: str
    dots: str
    times: int


@dataclass(frozen=True)
class Figure:
    """A pair of photos (names) on a sheet `width` x HEIGHT; the right one begins at `right`.

    agree, agree_dots, disagree: path data
    """

    photos: Names
    width: float
    left_width: float
    right: float
    agree: str
    agree_dots: str
    disagree: str
    residuals: Residuals | None = None


@dataclass(frozen=True)
class Pair:
    """A pair that the page shows: `number` is its place, `words` what is to be said.

    matches: how many agree; control points where that is not known any more
    """

    number: int
    photos: Names
    kind: Kind
    matches: int
    words: str
    figure: Figure | None


def figure(photos: Mapping[str, Photo], compared: Compared, residuals: Residuals | None = None) -> Figure:
    """The matches of two photos; of many, some that are evenly spread over the list."""
    (left_width, left), (right_width, right) = (_scaled(photos[name].size) for name in compared.photos)
    shift = left_width + GAP
    here, there = rescale(compared.xy_i, left), rescale(compared.xy_j, right) + np.array([shift, 0.0])
    agree, disagree = (_some(np.flatnonzero(chosen)) for chosen in (compared.agree, ~compared.agree))
    return Figure(
        compared.photos,
        shift + right_width,
        left_width,
        shift,
        lines.strokes(here[agree], there[agree]),
        lines.dots(np.vstack([here[agree], there[agree]])),
        lines.strokes(here[disagree], there[disagree]),
        residuals,
    )


def _scaled(size: Size) -> tuple[float, Floats]:
    """The width of a photo on the sheet, and its factor."""
    factor = HEIGHT / size[1]
    return size[0] * factor, np.array([factor, factor])


def _some(index: NDArray[np.intp]) -> NDArray[np.intp]:
    places = np.linspace(0, len(index) - 1, min(MOST_LINES, len(index)))
    return np.asarray(index[np.unique(places.astype(int))])


def residual_vectors(alignment: Alignment, points: ControlPoints) -> Floats:
    """From each point of photo j to where the cameras, without meshes, put its partner: (n, 2) px of photo j."""
    camera_i, camera_j = (replace(alignment.cameras[n], mesh=None) for n in (points.i, points.j))
    return camera_j.project(camera_i.rays(points.xy_i)) - points.xy_j


def pairs_shown(record: Record) -> list[Pair]:
    """The links, those with most matches if they are many, then what came near to one."""
    found = [*_links(record)][:MOST_LINKS]
    known = {pair.photos for pair in found}
    refused = [pair for pair in _refused(record) if pair.photos not in known][:MOST_REFUSED]
    return [replace(pair, number=number) for number, pair in enumerate([*found, *refused], start=1)]


def _links(record: Record) -> Iterator[Pair]:
    alignment = record.alignment
    if alignment is None:
        yield from _bare_links(record, ())
        return
    points = {(one.i, one.j): one for one in alignment.control_points}
    weak = {frozenset((f.photo, f.partner)) for f in alignment.findings or [f for f, _ in record.findings] if f.weak}
    for link in sorted(alignment.links, key=lambda link: (-link.matches, link.i, link.j)):
        names = alignment.photos[link.i].name, alignment.photos[link.j].name
        one = points.get((link.i, link.j))
        drawn = figure(record.photos, _control(record, names, one), _residuals(alignment, one)) if one else None
        kind: Kind = "weak link" if frozenset(names) in weak else "link"
        verified = record.links.get(names)
        strength = verified.inliers if verified else link.matches
        yield Pair(0, names, kind, strength, f"{link.matches} control points, {link.rms:.2f} px rms", drawn)
    yield from _bare_links(record, {photo.name for photo in alignment.photos})


def _bare_links(record: Record, aligned: Collection[str]) -> Iterator[Pair]:
    """Links of photos that no cameras were found for, or that belong to another panorama."""
    linked = [(names, link) for names, link in record.links.items() if link and names[0] not in aligned]
    for names, link in sorted(linked, key=lambda one: (-one[1].inliers, one[0])):
        words = f"{link.inliers} of {link.putative} matches agree, overlap {link.overlap:.0%}"
        yield Pair(0, names, "link", link.inliers, words, _drawn(record, names))


def _control(record: Record, names: Names, points: ControlPoints) -> Compared:
    """The control points of a pair, with the matches that did not agree where these are known."""
    other = record.compared.get(names)
    xy_i, xy_j = points.xy_i, points.xy_j
    if other is not None:
        xy_i, xy_j = (np.vstack([a, b[~other.agree]]) for a, b in ((xy_i, other.xy_i), (xy_j, other.xy_j)))
    return Compared(names, xy_i, xy_j, np.arange(len(xy_i)) < len(points))


def _residuals(alignment: Alignment, points: ControlPoints) -> Residuals | None:
    off = residual_vectors(alignment, points)
    sound = np.isfinite(off).all(axis=1)
    if not sound.any():
        return None
    size = alignment.photos[points.j].size
    chosen = _some(np.flatnonzero(sound))
    times = _round(CLEAR * float(np.hypot(*size)) / max(1e-6, float(np.quantile(np.hypot(*off[chosen].T), 0.95))))
    at = points.xy_j[chosen]
    return Residuals(size, lines.strokes(at, at + times * off[chosen]), lines.dots(at), times)


def _round(number: float) -> int:
    """The largest of 1, 2, 5, 10, ... that is no larger."""
    steps = [step * 10**power for power in range(4) for step in STEPS]
    return max([step for step in steps if step <= number], default=1)


def _refused(record: Record) -> list[Pair]:
    """Pairs with at least half of what a link takes, and those that other photos contradict."""
    given_up = {
        (record.alignment.photos[k.i].name, record.alignment.photos[k.j].name) for k in record.alignment.dropped
    } if record.alignment else set()  # fmt: skip
    rows = []
    for names, link in record.links.items():
        if isinstance(link, Rejection) and link.inliers and link.needed <= 2 * link.inliers:
            rows.append(Pair(0, names, "refused", link.inliers, _refusal(link), _drawn(record, names)))
        elif names in given_up:
            words = f"{link.inliers} matches agree, but contradict where all other photos put them"
            rows.append(Pair(0, names, "dropped", link.inliers, words, _drawn(record, names)))
    return sorted(rows, key=lambda pair: (-pair.matches, pair.photos))


def _refusal(link: Link) -> str:
    assert isinstance(link, Rejection)
    needed = f" ({link.needed} needed)" if link.needed else ""
    return f"{link.inliers} of {link.putative} matches agree{needed}: {link.reason}"


def _drawn(record: Record, names: Names) -> Figure | None:
    compared = record.compared.get(names)
    return figure(record.photos, compared) if compared is not None else None
