"""What a project file holds, ours or Hugin's, and what panorama would come of it; how good a finished picture is."""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from panostitch.compositing import lay_out
from panostitch.errors import PanostitchError
from panostitch.io import project
from panostitch.io import pto as hugin
from panostitch.model.alignment import Alignment
from panostitch.model.photo import Photo
from panostitch.model.score import Score
from panostitch.options import LayoutOptions
from panostitch.runtime.executor import Executor, serial
from panostitch.scoring import judge, summary


@dataclass(frozen=True)
class Project:
    """A project file.

    bytes:  of the file
    canvas: (width, height) px of the whole canvas with default options, before the crop; None where it has none
    field_of_view: degrees across and down of that canvas; None for a flat subject, and where an edge shows nothing
    projection, reason: of that canvas; or no projection, and the reason why there is no canvas
    missing: what is wrong with its photos, a line each
    """

    path: str
    format: str
    bytes: int
    alignment: Alignment
    canvas: tuple[int, int] | None
    field_of_view: tuple[float, float] | None
    projection: str
    reason: str
    missing: tuple[str, ...]


def score_picture(picture: Photo, photos: Sequence[Photo], *, run: Executor = serial) -> Score:
    """How well a finished picture shows what its photos do, whoever made it. Raises InputError."""
    pixels, mask = picture.source.read()
    return summary(judge(pixels if mask is None else np.dstack([pixels, mask]), photos, run=run))


def inspect_project(path: str) -> Project:
    """Look at a project. Photos of ours may be missing; Hugin's is not understood without them. Raises InputError."""
    kind = "Hugin project" if path.lower().endswith(hugin.EXTENSION) else "panostitch project"
    alignment, missing = (hugin.read_pto(path), ()) if kind == "Hugin project" else project.peek_project(path)
    size, field, projection = None, None, ""
    try:
        canvas = lay_out(alignment, LayoutOptions())
        size, projection, reason = canvas.size, canvas.projection, canvas.reason
        seen = canvas.field(canvas.region) if alignment.model == "rotation" else None
        field = (math.degrees(seen[0]), math.degrees(seen[1])) if seen else None
    except PanostitchError as error:
        reason = error.message
    return Project(path, kind, os.path.getsize(path), alignment, size, field, projection, reason, missing)
