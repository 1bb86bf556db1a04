"""What is said on standard error, and as JSON on standard output."""

import json
import sys
from collections.abc import Sequence
from typing import Any

import click

from panostitch.errors import EXIT_LEFT_OUT, EXIT_OK, PanostitchError
from panostitch.model.alignment import Alignment, LeftOut, LinkSummary
from panostitch.model.panorama import Panorama


def printable(text: str) -> str:
    """Text of files and metadata without control characters, which could rewrite the terminal."""
    return "".join(c if c.isprintable() else "?" for c in text)


def say(text: str) -> None:
    """A line on standard error."""
    click.echo(printable(text), err=True)


def say_error(error: PanostitchError) -> None:
    """One line that says what, which file and why; below it the evidence and the next thing to try."""
    say(f"error: {error.message}")
    for line in error.details:
        say(f"  {line}")
    if error.hint:
        say(f"  next: {error.hint}")


def say_alignment(alignment: Alignment, *, verbose: int) -> None:
    """What was found, in a line; and every photo that is not in it."""
    count = len(alignment.photos)
    say(
        f"aligned {count} of {count + len(alignment.left_out)} photos, {len(alignment.links)} links, "
        f"{alignment.rms:.2f} px rms: {alignment.reason}"
    )
    for photo in alignment.photos:
        for note in photo.notes:
            say(f"note: {photo.name}: {note}")
    if verbose:
        _say_cameras(alignment)
        _say_dropped(alignment)
    for left_out in alignment.left_out:
        _say_left_out(left_out)


def _say_cameras(alignment: Alignment) -> None:
    for photo, camera in zip(alignment.photos, alignment.cameras, strict=True):
        say(f"  {photo.name}: focal length {camera.focal:.1f} px, k1 {camera.k1:+.4f}, k2 {camera.k2:+.4f}")
    for link in alignment.links:
        say(f"  {_names(alignment, link)}: {link.matches} matches, {link.rms:.2f} px rms")


def _say_dropped(alignment: Alignment) -> None:
    for link in alignment.dropped:
        say(
            f"dropped: {_names(alignment, link)}: {link.matches} matches agree with each other, but are "
            f"{link.rms:.0f} px off from where all other photos put them"
        )


def _names(alignment: Alignment, link: LinkSummary) -> str:
    return f"{alignment.photos[link.i].name} - {alignment.photos[link.j].name}"


def _say_left_out(photo: LeftOut) -> None:
    say(f"left out: {photo.name}: {photo.reason}")
    for line in photo.details:
        say(f"  {line}")
    if photo.hint:
        say(f"  next: {photo.hint}")


def say_panorama(panorama: Panorama, path: str) -> None:
    """What was written, in a line."""
    crop = panorama.plan.crop
    say(f"{path}: {crop.width} x {crop.height} px, {panorama.canvas.projection}; {panorama.plan.crop_reason}")


def say_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Rows in aligned columns under a head; columns of numbers stand to the right."""
    columns = list(zip(head, *rows, strict=True))
    widths = [max(map(len, column)) for column in columns]
    numeric = [all(cell[:1].isdigit() or cell in ("-", "inf") for cell in column[1:]) for column in columns]
    for row in (head, *rows):
        cells = (
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(row, widths, numeric, strict=True)
        )
        say("  ".join(cells).rstrip())


def result(alignment: Alignment, panorama: Panorama | None = None, path: str = "") -> dict[str, Any]:
    """The result of a run for `--json`."""
    data = alignment.to_json()
    if panorama:
        crop = panorama.plan.crop
        data["panorama"] = {
            "path": path,
            "size": [crop.width, crop.height],
            "projection": panorama.canvas.projection,
            "crop": panorama.plan.crop_reason,
            "gains": panorama.plan.gains.tolist(),
        }
    data["exit_code"] = exit_code(alignment)
    return data


def print_json(data: Any) -> None:
    """JSON on standard output."""
    json.dump(data, sys.stdout, indent=1)
    sys.stdout.write("\n")


def exit_code(alignment: Alignment) -> int:
    """0 where every photo is in, 3 where some are not."""
    return EXIT_LEFT_OUT if alignment.left_out else EXIT_OK
