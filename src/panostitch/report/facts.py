"""What the page says in tables."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import degrees
from typing import Any

import numpy as np
from numpy.typing import NDArray

from panostitch.debug.metrics import angles
from panostitch.model.alignment import Alignment, LeftOut
from panostitch.model.inclusion import Inclusion, excluded, inclusion
from panostitch.model.photo import Photo
from panostitch.options import Options
from panostitch.report.pairs import residual_vectors
from panostitch.report.record import Record

Floats = NDArray[np.float64]

BARS = 24
TAIL = 0.99  # of the residuals: what is beyond is in the last bar
NICE = (1.0, 2.0, 2.5, 5.0, 10.0)  # steps of an axis


@dataclass(frozen=True)
class PhotoRow:
    """One photo that was given: its number in the page (0 for one that was never opened) and what became of it."""

    number: int
    name: str
    photo: Photo | None
    key_points: int | None
    state: str
    remarks: tuple[str, ...]
    partner: str | None
    inliers: int
    share: float | None
    left_out: LeftOut | None


def photo_rows(record: Record) -> list[PhotoRow]:
    """Every photo that is known of, in the order in which they were given."""
    alignment = record.alignment
    became = inclusion(alignment, record.panorama) if alignment else excluded(record.left_out, record.pairs)
    by_name = {row.name: row for row in became}
    why = {one.name: one for one in (alignment.left_out if alignment else record.left_out)}
    numbers = {name: number for number, name in enumerate(record.photos, start=1)}
    return [
        _photo_row(record, name, numbers.get(name, 0), by_name.get(name), why.get(name))
        for name in dict.fromkeys((*record.photos, *by_name))
    ]


def _photo_row(record: Record, name: str, number: int, row: Inclusion | None, why: LeftOut | None) -> PhotoRow:
    row = row or Inclusion(name, "left out", "there is no panorama")
    linked = record.alignment is None and any(link for pair, link in record.links.items() if name in pair)
    photo = record.photos.get(name)
    return PhotoRow(
        number,
        name,
        photo,
        record.key_points.get(name),
        "linked" if linked and why is None else row.state,
        tuple(words for words in (row.cause, row.reason, *(photo.notes if photo else ())) if words),
        row.partner,
        row.inliers,
        row.share,
        why,
    )


@dataclass(frozen=True)
class CameraRow:
    """One camera for people; angles in degrees, None where there are none."""

    name: str
    focal: float
    turn: tuple[float, float, float] | None
    k1: float
    k2: float
    gain: float | None
    direction_error: float | None
    focal_error: float | None
    bent: float | None


def camera_rows(record: Record) -> Iterator[CameraRow]:
    """The cameras in the axes of the canvas, where there is one."""
    alignment = record.laid_out[0] if record.laid_out else record.alignment
    if alignment is None:
        return
    errors = alignment.uncertainties or (None,) * len(alignment.cameras)
    light = record.light.brightness.tolist() if record.light else [None] * len(alignment.cameras)
    for photo, camera, error, gain in zip(alignment.photos, alignment.cameras, errors, light, strict=True):
        yield CameraRow(
            photo.name,
            camera.focal,
            angles(camera.cam_from_world) if alignment.model == "rotation" else None,
            camera.k1,
            camera.k2,
            gain,
            degrees(error.turn) if error else None,
            error.focal if error else None,
            camera.mesh.largest if camera.mesh else None,
        )


@dataclass(frozen=True)
class Bar:
    """How many residuals lie between two px; the last bar has all beyond it as well."""

    start: float
    end: float
    count: int
    share: float  # of the highest bar


@dataclass(frozen=True)
class Histogram:
    """Residuals of all control points, px."""

    bars: Sequence[Bar]
    count: int
    rms: float
    median: float
    p95: float


def histogram(alignment: Alignment | None) -> Histogram | None:
    """How far the cameras, without meshes, leave control points apart; None where there are none."""
    if alignment is None:
        return None
    off = [np.hypot(*residual_vectors(alignment, points).T) for points in alignment.control_points]
    errors = np.concatenate([np.zeros(0), *off])
    errors = errors[np.isfinite(errors)]
    if not len(errors):
        return None
    end = _nice(float(np.quantile(errors, TAIL)))
    counts, edges = np.histogram(np.minimum(errors, end), bins=BARS, range=(0.0, end))
    bars = [
        Bar(start, stop, count, count / max(1, counts.max()))
        for start, stop, count in zip(edges[:-1].tolist(), edges[1:].tolist(), counts.tolist(), strict=True)
    ]
    rms, median, p95 = np.sqrt((errors**2).mean()), np.median(errors), np.quantile(errors, 0.95)
    return Histogram(bars, len(errors), float(rms), float(median), float(p95))


def _nice(number: float) -> float:
    """The next larger number of an axis that people like to read."""
    power = 10.0 ** np.floor(np.log10(max(number, 1e-3)))
    return float(next(step * power for step in NICE if step * power >= number * (1 - 1e-9)))


@dataclass(frozen=True)
class OptionRow:
    """One option of a run."""

    stage: str
    name: str
    value: Any
    default: Any
    help: str

    @property
    def changed(self) -> bool:
        """Whether it is not the default."""
        return bool(self.value != self.default)


def option_rows(options: Options) -> list[OptionRow]:
    """All options, in their order."""
    stages: Mapping[str, Any] = {part.name: getattr(options, part.name) for part in dataclasses.fields(options)}
    return [
        OptionRow(name, "--" + field.name.replace("_", "-"), getattr(stage, field.name), field.default,
                  field.metadata["help"])
        for name, stage in stages.items()
        for field in dataclasses.fields(stage)
    ]  # fmt: skip
