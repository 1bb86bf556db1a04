"""Keeps what a report needs of the events of a run; pictures are reduced as they come, and none is drawn yet."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from panostitch.debug.ink import Picture, fit, to_bytes
from panostitch.debug.pairs import agreeing
from panostitch.errors import PanostitchError
from panostitch.model.alignment import Alignment, LeftOut, PairTried
from panostitch.model.canvas import Canvas, Region
from panostitch.model.features import Features
from panostitch.model.finding import Finding
from panostitch.model.light import Light
from panostitch.model.match import Groups, Link, PutativeMatch, VerifiedMatch
from panostitch.model.panorama import Panorama
from panostitch.model.photo import Photo
from panostitch.model.score import SeamScore, Worst
from panostitch.report.stages import Stages
from panostitch.runtime import memory

Floats = NDArray[np.float64]
Names = tuple[str, str]

REDUCED = 1200  # px, longest side of what is kept of the reduced canvas
MOST_REFUSED = 200  # pairs without a link whose matches are kept, those with most inliers
WORST = 10  # places along all seams
WORST_SIDE = 192  # px of the panorama about each of them
WORST_APART = 128  # px


@dataclass(frozen=True)
class Compared:
    """Two photos (names) with matches (n, 2) px of each; `agree` (n,) says which of them agree."""

    photos: Names
    xy_i: Floats
    xy_j: Floats
    agree: NDArray[np.bool_]


@dataclass(frozen=True)
class Place:
    """One of the worst places along the seams: the two photos, what is wrong, and the pixels about it."""

    photos: Names
    worst: Worst
    picture: Picture


class Record:
    """A `Trace` that remembers; a method for each event, named like it. All that has not happened is None or empty."""

    def __init__(
        self, *, clock: Callable[[], float] = time.perf_counter, resident: Callable[[], int] = memory.resident
    ) -> None:
        """clock and resident: seconds and bytes, the only things that differ from run to run."""
        self.stages = Stages(clock, resident)
        self.photos: dict[str, Photo] = {}
        self.key_points: dict[str, int] = {}
        self.links: dict[Names, Link] = {}
        self.compared: dict[Names, Compared] = {}
        self.findings: list[tuple[Finding, Compared]] = []
        self.left_out: Sequence[LeftOut] = ()
        self.pairs: Sequence[PairTried] = ()
        self.alignment: Alignment | None = None
        self.laid_out: tuple[Alignment, Canvas] | None = None
        self.light: Light | None = None
        self.before: Picture | None = None
        self.after: Picture | None = None
        self.labels: NDArray[np.int16] | None = None
        self.panorama: Panorama | None = None
        self.seams: Sequence[SeamScore] = ()
        self.worst: list[Place] = []
        self.preview: Picture | None = None
        self.path = ""

    def __call__(self, event: str, /, **data: Any) -> None:
        """Take an event of a stage; events that are not known only count as time of their stage."""
        with self.stages.told(event.partition(".")[0]):
            method = getattr(self, event.replace(".", "_"), None)
            if method is not None:
                method(**data)

    def photos_read(self, photos: Sequence[Photo], **_: Any) -> None:
        """All photos, in their order."""
        self.photos = {photo.name: photo for photo in photos}

    def features_detected(self, photo: Photo, features: Features, **_: Any) -> None:
        """How many key points there are; they themselves come again with the matches."""
        self.key_points[photo.name] = len(features)

    def matching_linked(
        self, photos: Sequence[Photo], features: Sequence[Features], match: PutativeMatch, link: Link, **_: Any
    ) -> None:
        """The matches of a pair; a pair may be tried again with other key points."""
        names = photos[match.i].name, photos[match.j].name
        self.links[names] = link
        if not link.inliers:
            return
        two = features[match.i], features[match.j]
        agree = (
            agreeing(two, match.pairs, link) if isinstance(link, VerifiedMatch) else np.zeros(len(match.pairs), bool)
        )
        self.compared[names] = _compared(names, two, match.pairs, agree)
        refused = [pair for pair in self.compared if not self.links[pair]]
        if len(refused) > MOST_REFUSED:
            del self.compared[min(refused, key=lambda pair: (self.links[pair].inliers, pair))]

    def matching_grouped(self, photos: Sequence[Photo], links: Sequence[Link], groups: Groups, **_: Any) -> None:
        """What finally became of the pairs."""
        del groups
        self.links |= {(photos[link.i].name, photos[link.j].name): link for link in links}

    def diagnosis_explained(
        self,
        photos: tuple[Photo, Photo],
        features: tuple[Features, Features],
        matches: NDArray[np.int32],
        agree: NDArray[np.bool_],
        finding: Finding,
        **_: Any,
    ) -> None:
        """Why two photos are not linked, or weakly, with the matches that say so."""
        names = photos[0].name, photos[1].name
        self.findings.append((finding, _compared(names, features, matches, agree)))

    def diagnosis_left_out(self, left_out: Sequence[LeftOut], pairs: Sequence[PairTried], **_: Any) -> None:
        """Who is not in the largest panorama; kept for runs that end here."""
        self.left_out, self.pairs = left_out, pairs

    def alignment_solved(self, alignment: Alignment, **_: Any) -> None:
        """The cameras."""
        self.alignment = alignment

    def alignment_bent(self, alignment: Alignment, **_: Any) -> None:
        """The cameras with their meshes."""
        self.alignment = alignment

    def layout_chosen(self, alignment: Alignment, canvas: Canvas, **_: Any) -> None:
        """The cameras in the axes of the canvas."""
        self.laid_out = alignment, canvas

    def compositing_exposed(self, light: Light, before: Floats, after: Floats, **_: Any) -> None:
        """The reduced canvas without and with gains; it is cropped when the crop is known."""
        self.light = light
        self.before, self.after = to_bytes(before), to_bytes(after)

    def compositing_seamed(self, labels: NDArray[np.int16], **_: Any) -> None:
        """Who owns what of the reduced canvas."""
        self.labels = labels

    def compositing_cropped(self, crop: Region, **_: Any) -> None:
        """What is written of the reduced canvas."""
        if self.before is not None and self.after is not None and self.labels is not None:
            self.before, self.after = (to_bytes(fit(_cut(p, crop), REDUCED)) for p in (self.before, self.after))
            self.labels = np.asarray(fit(_cut(self.labels, crop), REDUCED, exact=True))

    def panorama_planned(self, alignment: Alignment, panorama: Panorama, **_: Any) -> None:
        """All that is known before the pixels are made. A run that begins here has photos nobody has told of."""
        self.alignment, self.panorama = alignment, panorama
        for photo in alignment.photos:
            self.photos.setdefault(photo.name, photo)

    def panorama_written(self, path: str, preview: Picture, **_: Any) -> None:
        """The panorama, small."""
        self.path, self.preview = path, to_bytes(fit(preview))

    def scoring_judged(self, seams: Sequence[SeamScore], **_: Any) -> None:
        """The scores, and the pixels of the worst places. Photos that cannot be read any more show none."""
        self.seams = seams
        if self.panorama is None:
            return
        for photos, worst in worst_places(seams):
            try:
                layer = self.panorama.read(_about(worst, self.panorama.plan.crop))
            except PanostitchError:
                continue
            self.worst.append(Place(photos, worst, to_bytes(layer.pixels)))


def worst_places(seams: Sequence[SeamScore]) -> list[tuple[Names, Worst]]:
    """The worst places along all seams, apart from each other, the worst first."""
    every = [((seam.first, seam.second), worst) for seam in seams for worst in seam.score.worst]
    chosen: list[tuple[Names, Worst]] = []
    for names, worst in sorted(every, key=lambda one: (-one[1].fault, one[1].x, one[1].y)):
        if len(chosen) == WORST:
            break
        if all(np.hypot(worst.x - other.x, worst.y - other.y) >= WORST_APART for _, other in chosen):
            chosen.append((names, worst))
    return chosen


def _about(worst: Worst, crop: Region) -> Region:
    """The square about a place, moved so that it lies in the crop."""
    width, height = min(WORST_SIDE, crop.width), min(WORST_SIDE, crop.height)
    x = min(max(round(worst.x) - width // 2, crop.x), crop.right - width)
    y = min(max(round(worst.y) - height // 2, crop.y), crop.bottom - height)
    return Region(x, y, width, height)


def _compared(
    names: Names, features: tuple[Features, Features], pairs: NDArray[np.int32], agree: NDArray[np.bool_]
) -> Compared:
    xy_i, xy_j = (one.xy[pairs[:, side]].astype(np.float64) for side, one in enumerate(features))
    return Compared(names, xy_i, xy_j, agree)


def _cut(pixels: NDArray[Any], crop: Region) -> NDArray[Any]:
    """What a crop shows of an array (h, w[, 3]); on a closed turn it may run over the right edge."""
    columns = np.arange(crop.x, crop.right) % pixels.shape[1]
    return np.asarray(pixels[crop.y : crop.bottom][:, columns])
