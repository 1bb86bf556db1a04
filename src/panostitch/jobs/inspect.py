"""What a project file holds, ours or Hugin's, and what panorama would come of it."""

import math
import os
from dataclasses import dataclass

from panostitch.compositing import lay_out
from panostitch.errors import PanostitchError
from panostitch.io import project
from panostitch.io import pto as hugin
from panostitch.model.alignment import Alignment
from panostitch.options import LayoutOptions


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
