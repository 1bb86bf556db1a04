"""What is said on standard error, and as JSON on standard output."""

import math
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from panostitch.alignment.elastic import FEWEST_JUDGES

# what is said and what says it come from one place
from panostitch.cli.terminal import print_json as print_json
from panostitch.cli.terminal import say as say
from panostitch.cli.terminal import say_table as say_table
from panostitch.diagnosis import advice
from panostitch.errors import EXIT_LEFT_OUT, EXIT_OK
from panostitch.io.forecast import Forecast
from panostitch.model.alignment import Alignment, LeftOut, LinkSummary, LocalWarp
from panostitch.model.inclusion import Inclusion, inclusion
from panostitch.model.panorama import Panorama
from panostitch.model.photo import Photo
from panostitch.runtime.memory import in_words

if TYPE_CHECKING:
    from panostitch.io.writers import Written

INCLUSION_HEAD = ("photo", "state", "area", "best partner", "reason")

NOWHERE_NEAR = 1000.0  # px; from here on the figure says nothing more


def say_alignment(alignment: Alignment, *, verbose: int) -> None:
    """What was found, in a line; and every photo that is not in it."""
    count = len(alignment.photos)
    judged = "" if alignment.held_back_rms is None else f" ({alignment.held_back_rms:.2f} px where held back)"
    links = f"{len(alignment.links)} link{'s' * (len(alignment.links) != 1)}"
    say(
        f"aligned {count} of {count + len(alignment.left_out)} photos, {links}, "
        f"{alignment.rms:.2f} px rms{judged}: {alignment.reason}"
    )
    if alignment.local_warp:
        say(f"local warp: {_gain(alignment.local_warp)}")
    _say_notes(alignment.photos)
    if verbose:
        if alignment.model == "rotation":
            _say_cameras(alignment)
        _say_links(alignment)
        _say_dropped(alignment)
        _say_refuted(alignment)
    for left_out in alignment.left_out:
        _say_left_out(left_out)
    _say_weak(alignment)


def _gain(warp: LocalWarp) -> str:
    figures = f"{warp.rms:.2f} px off, {warp.bent_rms:.2f} px with the photos bent"
    held = f"{warp.matches} matches that were held back are {figures}"
    if warp.used:
        return held
    why = "too few to judge by" if warp.matches < FEWEST_JUDGES else "which is not clearly better"
    return f"none: {held}, {why}" if warp.matches else "none: no matches were found to judge it by"


def _say_cameras(alignment: Alignment) -> None:
    errors = alignment.uncertainties or (None,) * len(alignment.cameras)
    for photo, camera, error in zip(alignment.photos, alignment.cameras, errors, strict=True):
        x, y = (c - (n - 1) / 2 for c, n in zip(camera.centre, camera.size, strict=True))
        centre = f", centre {x:+.1f} {y:+.1f} px off the middle" if x or y else ""
        say(f"  {photo.name}: focal length {camera.focal:.1f} px, k1 {camera.k1:+.4f}, k2 {camera.k2:+.4f}{centre}")
        if error:
            turn = math.degrees(error.turn)
            say(f"    standard errors: focal length {error.focal:.2f} px, direction {turn:.4f} degrees")


def _say_links(alignment: Alignment) -> None:
    for link in alignment.links:
        say(f"  {_names(alignment, link)}: {link.matches} matches, {link.rms:.2f} px rms")


def _say_dropped(alignment: Alignment) -> None:
    for link in alignment.dropped:
        where = f"{link.rms:.0f} px off from" if link.rms < NOWHERE_NEAR else "nowhere near"
        say(
            f"dropped: {_names(alignment, link)}: {link.matches} matches agree with each other, but are "
            f"{where} where all other photos put them"
        )


def _say_refuted(alignment: Alignment) -> None:
    for pair in alignment.pairs:
        if pair.verdict and pair.inliers and not pair.needed:
            say(f"dropped: {pair.first} - {pair.second}: {pair.inliers} matches agree with each other: {pair.verdict}")


def _names(alignment: Alignment, link: LinkSummary) -> str:
    return f"{alignment.photos[link.i].name} - {alignment.photos[link.j].name}"


def _say_notes(photos: Sequence[Photo]) -> None:
    """What is odd about photos, each oddity once."""
    odd: dict[str, list[str]] = {}
    for photo in photos:
        for note in photo.notes:
            odd.setdefault(note, []).append(photo.name)
    for note, names in odd.items():
        others = f" and {len(names) - 1} more" if len(names) > 1 else ""
        say(f"note: {names[0]}{others}: {note}")


def _say_left_out(photo: LeftOut) -> None:
    say(f"left out: {photo.name}: {photo.reason}")
    for line in photo.details:
        say(f"  {line}")
    if photo.hint:
        say(f"  next: {photo.hint}")


def _say_weak(alignment: Alignment) -> None:
    """Links that are all that holds the panorama together somewhere, and rest on little."""
    for finding in alignment.findings:
        if finding.weak:
            say(f"weak link: {finding.photo} - {finding.partner}: {finding.cause}: {finding.evidence}")
            say(f"  next: {finding.next}")


def say_forecast(panorama: Panorama, path: str, expected: Forecast) -> None:
    """What is about to be written, in a line."""
    crop = panorama.plan.crop
    say(
        f"writing {crop.width} x {crop.height} px ({crop.area / 1e6:.1f} megapixels) to {path}, "
        f"in up to {in_words(expected.memory)} of memory"
    )


def say_dry_run(alignment: Alignment, panorama: Panorama, path: str, expected: Forecast, seconds: float) -> None:
    """What would be written, and what it would take, a line each."""
    crop, canvas = panorama.plan.crop, panorama.canvas
    say(f"{path}: would be {crop.width} x {crop.height} px ({crop.area / 1e6:.1f} megapixels); nothing is written")
    say(f"projection: {canvas.projection} ({canvas.reason})")
    field = _field(alignment, panorama)
    if field:
        say(f"field of view: {field[0]:.1f} x {field[1]:.1f} degrees")
    say(f"crop: {panorama.plan.crop_reason}")
    say(f"exposure: {panorama.plan.light.reason}")
    say(f"memory: up to {in_words(expected.memory)}, on {expected.threads} thread{'s' * (expected.threads != 1)}")
    say(f"time: about {seconds:.1f} s for rendering and writing")


def _field(alignment: Alignment, panorama: Panorama) -> list[float] | None:
    """Degrees across and down; None for a flat subject, and where the middle of an edge shows nothing."""
    field = panorama.canvas.field(panorama.plan.crop) if alignment.model == "rotation" else None
    return [math.degrees(angle) for angle in field] if field else None


def say_panorama(panorama: Panorama, path: str, written: "Written") -> None:
    """What was written, what became of the light, and what is to be known of the file, a line each."""
    crop = panorama.plan.crop
    canvas = panorama.canvas
    size = f"{crop.width} x {crop.height} px{', 16 bits' if written.depth == 16 else ''}"
    say(f"{path}: {size}, {canvas.projection} ({canvas.reason}); {panorama.plan.crop_reason}")
    say(f"exposure: {panorama.plan.light.reason}")
    for note in written.notes:
        say(f"note: {path}: {note}")


def say_inclusion(alignment: Alignment, panorama: Panorama | None = None, *, verbose: int) -> None:
    """What became of the photos: a line if all is well, else a row for each that is not simply used (or for all)."""
    rows = inclusion(alignment, panorama)
    odd = [row for row in rows if row.state != "used"]
    counts = Counter(row.state for row in odd)
    rest = "".join(f", {count} {state}" for state, count in counts.items())
    say(f"photos: {len(rows) - len(odd)} of {len(rows)} used{rest}")
    shown = rows if verbose else odd
    if shown:
        say_table(INCLUSION_HEAD, [_inclusion_row(row) for row in shown])
    for line in advice(alignment, panorama):
        say(f"advice: {line}")


def _inclusion_row(row: Inclusion) -> tuple[str, ...]:
    share = "-" if row.share is None else f"{row.share:.1%}"
    partner = f"{row.partner} ({row.inliers} matches agree)" if row.partner else "-"
    return row.name, row.state, share, partner, row.cause or row.reason or "-"


def result(
    alignment: Alignment,
    panorama: Panorama | None = None,
    path: str = "",
    written: "Written | None" = None,
    *,
    allow_partial: bool = False,
) -> dict[str, Any]:
    """The result of a run for `--json`."""
    data = alignment.to_json()
    if panorama:
        crop, light = panorama.plan.crop, panorama.plan.light
        data["panorama"] = {
            "path": path,
            "size": [crop.width, crop.height],
            "depth": written.depth if written else None,
            "notes": list(written.notes) if written else [],
            "projection": panorama.canvas.projection,
            "projection_reason": panorama.canvas.reason,
            "field_of_view": _field(alignment, panorama),
            "crop": panorama.plan.crop_reason,
            "gains": light.brightness.tolist(),
            "channel_gains": light.gains.tolist(),
            "fall_off": light.fall_off.tolist(),
            "exposure": light.reason,
        }
    data["inclusion"] = [_as_json(row) for row in inclusion(alignment, panorama)]
    data["advice"] = advice(alignment, panorama)
    data["exit_code"] = exit_code(alignment, allow_partial=allow_partial)
    return data


def _as_json(row: Inclusion) -> dict[str, Any]:
    return {
        "name": row.name,
        "included": row.included,
        "state": row.state,
        "reason": row.reason,
        "cause": row.cause,
        "best_partner": row.partner,
        "best_partner_inliers": row.inliers,
        "share": row.share,
    }


def exit_code(alignment: Alignment, *, allow_partial: bool = False) -> int:
    """0 where every photo is in, or need not be; 3 where some are not."""
    return EXIT_LEFT_OUT if alignment.left_out and not allow_partial else EXIT_OK
