"""What became of every photo: in the panorama or not, how much of it is seen, and why."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from panostitch.model.alignment import UNREADABLE, Alignment, LeftOut, PairTried
from panostitch.model.panorama import Panorama
from panostitch.model.photo import natural_key

State = Literal["used", "partly hidden", "hidden", "left out", "unreadable"]

LITTLE = 0.1  # of what each photo would show if all showed as much; a photo that shows less is called partly hidden


@dataclass(frozen=True)
class Inclusion:
    """One photo.

    reason:  why it is not in the panorama; empty if it is
    cause:   of that, in a word or two; empty where none was found
    partner: the photo with which it has most matches that agree, and how many; None where it was compared with none
    share:   of the area that is written, 0 to 1; None where nothing is written
    """

    name: str
    state: State
    reason: str = ""
    cause: str = ""
    partner: str | None = None
    inliers: int = 0
    share: float | None = None

    @property
    def included(self) -> bool:
        """Whether it is one of the panorama's photos, seen or hidden."""
        return self.state not in ("left out", "unreadable")


def inclusion(alignment: Alignment, panorama: Panorama | None = None) -> list[Inclusion]:
    """Every photo that was given, in the natural order of their names."""
    shares = _shares(alignment, panorama) if panorama else [None] * len(alignment.photos)
    rows = [
        Inclusion(photo.name, _state(share, len(shares)), "", "", *_partner(alignment.pairs, photo.name), share)
        for photo, share in zip(alignment.photos, shares, strict=True)
    ]
    rows += excluded(alignment.left_out, alignment.pairs, share=None if panorama is None else 0.0)
    return sorted(rows, key=lambda row: natural_key(row.name))


def excluded(left_out: Sequence[LeftOut], pairs: Sequence[PairTried], *, share: float | None = None) -> list[Inclusion]:
    """Photos that are not in a panorama, whether or not there is one."""
    rows = []
    for photo in left_out:
        state: State = "unreadable" if photo.cause == UNREADABLE else "left out"
        cause = "" if photo.cause == UNREADABLE else photo.cause
        rows.append(Inclusion(photo.name, state, photo.reason, cause, *_partner(pairs, photo.name), share))
    return rows


def _shares(alignment: Alignment, panorama: Panorama) -> list[float]:
    """What each photo owns of the pixels in the crop that any photo owns."""
    plan, canvas = panorama.plan, panorama.canvas
    crop, (height, width) = plan.crop, plan.labels.shape
    columns = np.arange(crop.x // plan.factor, -(-crop.right // plan.factor))
    columns = columns % width if canvas.wraps else columns.clip(0, width - 1)
    rows = np.arange(crop.y // plan.factor, -(-crop.bottom // plan.factor)).clip(0, height - 1)
    labels = plan.labels[np.ix_(rows, columns)]
    counts = np.bincount(labels[labels >= 0].astype(np.intp), minlength=len(alignment.photos))
    return [float(count) / max(1, int(counts.sum())) for count in counts]


def _state(share: float | None, photos: int) -> State:
    if share is None or share >= LITTLE / photos:
        return "used"
    return "partly hidden" if share else "hidden"


def _partner(pairs: Sequence[PairTried], name: str) -> tuple[str | None, int]:
    own = [pair for pair in pairs if name in (pair.first, pair.second)]
    best = max(own, key=lambda pair: (pair.inliers, pair.matches), default=None)
    if best is None:
        return None, 0
    return (best.second if best.first == name else best.first), best.inliers
