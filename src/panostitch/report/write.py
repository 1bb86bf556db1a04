"""Makes the page of a record and writes it: one file that needs no other."""

import base64
import hashlib
import os
from collections.abc import Sequence
from importlib.metadata import version
from importlib.resources import files
from importlib.util import find_spec
from typing import Any

from panostitch.debug.ink import fit, to_bytes
from panostitch.diagnosis import advice
from panostitch.errors import MissingError, PanostitchError
from panostitch.io.atomic import write_bytes
from panostitch.model.score import VISIBLE
from panostitch.options import Options
from panostitch.report import lines
from panostitch.report.album import photos_shown, shown
from panostitch.report.beside import Beside
from panostitch.report.explained import explained
from panostitch.report.facts import camera_rows, histogram, option_rows, photo_rows
from panostitch.report.graph import WIDTH, graph
from panostitch.report.pairs import HEIGHT, pairs_shown
from panostitch.report.record import Record
from panostitch.runtime.memory import in_words

BACKDROP, BACKDROP_QUALITY = 800, 60  # px of the panorama under the links, where it is but faint


def check_installed() -> None:
    """Raise MissingError where the template engine is not there; before any work is done."""
    if find_spec("jinja2") is None:
        raise MissingError(
            "--report: Jinja2, which makes the page, is not installed", hint="pip install 'panostitch[report]'"
        )


def write_report(
    record: Record, path: str, options: Options, *, error: PanostitchError | None = None, beside: Beside | None = None
) -> None:
    """Write the report of a run, or of what became of it until an error. Raises OutputError.

    beside: what other programs made of the same photos
    """
    write_bytes(path, render(content(record, options, error, beside)))


def content(record: Record, options: Options, error: PanostitchError | None, beside: Beside | None) -> dict[str, Any]:
    """All that the template shows."""
    pairs = pairs_shown(record)
    rows = photo_rows(record)
    return {
        "title": os.path.basename(record.path) or "No panorama",
        "error": error,
        "beside": beside,
        "panoramas": [(one, shown(to_bytes(one.picture))) for one in beside.panoramas if one.picture is not None]
        if beside
        else [],
        "record": record,
        "pictures": photos_shown(record.photos),
        "numbers": {name: number for number, name in enumerate(record.photos, start=1)},
        "rows": rows,
        "remarks": any(row.remarks for row in rows),
        "used": sum(row.state in ("used", "partly hidden", "hidden") for row in rows),
        "alignment": record.alignment,
        "advice": advice(record.alignment, record.panorama) if record.alignment else [],
        **_panorama(record),
        "pairs": pairs,
        "sheet": HEIGHT,
        "graph": graph(record, pairs) if record.photos else None,
        "graph_width": WIDTH,
        "explained": explained(record, pairs),
        "cameras": list(camera_rows(record)),
        "seams": sorted(record.seams, key=lambda seam: -(seam.score.total or 0.0)),
        "worst": [(place, shown(place.picture, 90)) for place in record.worst],
        "visible": VISIBLE,
        "histogram": histogram(record.alignment),
        "options": option_rows(options),
        "version": version("panostitch"),
    }


def _panorama(record: Record) -> dict[str, Any]:
    """The panorama with what lies over it, and the same before and after the gains."""
    pictures: dict[str, Any] = {"panorama": None, "outlines": [], "seam_lines": "", "before": None, "after": None}
    if record.before is not None and record.after is not None:
        pictures |= {"before": shown(record.before), "after": shown(record.after)}
    if record.preview is None or record.panorama is None:
        return pictures
    pictures["panorama"] = shown(record.preview)
    pictures["backdrop"] = shown(to_bytes(fit(record.preview, BACKDROP)), BACKDROP_QUALITY)
    pictures["crop"] = record.panorama.plan.crop
    if record.laid_out and record.laid_out[1] == record.panorama.canvas:  # the plan of a cube is another canvas
        alignment, canvas = record.laid_out
        pictures["outlines"] = [
            (photo.name, lines.outline(camera, canvas)[0])
            for photo, camera in zip(alignment.photos, alignment.cameras, strict=True)
        ]
        if record.labels is not None:
            pictures |= {"seam_lines": lines.seams(record.labels), "seam_size": record.labels.shape[::-1]}
    return pictures


def render(data: dict[str, Any]) -> bytes:
    """The page. Every text is escaped, and nothing but the page's own script may run or be loaded."""
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    page = Environment(
        loader=PackageLoader("panostitch.report", "page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page.filters |= {"bytes": in_words, "fixed": fixed, "listed": listed}
    script = _part("page.js")
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    text = page.get_template("page.html").render(
        **data, style=Markup(_part("page.css")), script=Markup(script), script_hash=f"sha256-{digest}"
    )
    # names of files that are no valid Unicode arrive as lone surrogates
    return text.encode("utf-8", "replace")


def _part(name: str) -> str:
    return (files("panostitch.report") / "page" / name).read_text(encoding="utf-8")


def fixed(value: float | None, digits: int = 2) -> str:
    """A number with so many decimal places; a dash where there is none."""
    return "–" if value is None or value != value else f"{value:.{digits}f}"


def listed(names: Sequence[str]) -> str:
    """Names with commas."""
    return ", ".join(names)
