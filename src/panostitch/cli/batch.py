"""`panostitch batch`: a panorama of every sub-folder."""

import dataclasses
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from panostitch.cli.options import every_stage, inclusion_options, options_of, run_options

if TYPE_CHECKING:
    from panostitch.jobs.batch import Outcome
    from panostitch.runtime.trace import Trace


@click.command("batch")
@click.argument("folder")
@click.option("-o", "--output", required=True, metavar="FOLDER", help="Where the panoramas go; made if need be.")
@click.option(
    "--format", "file_format", type=click.Choice(["jpg", "png", "tif", "webp"]), default="jpg", show_default=True
)
@every_stage
@inclusion_options(exclude=False)
@run_options
def command(folder: str, output: str, file_format: str, **given: Any) -> int:
    """Make a panorama of every sub-folder of FOLDER, and of the photos in FOLDER itself.

    A sub-folder with several panoramas becomes NAME.jpg, NAME-2.jpg, ... What fails is reported at the end; the rest
    is made all the same.
    """
    from panostitch.cli import report
    from panostitch.cli.session import check_inclusion_options, debug_trace, executor
    from panostitch.errors import OutputError
    from panostitch.io.writers import check_depth
    from panostitch.jobs.batch import Setting, batch_exit_code, find_tasks, run_batch

    options = options_of(given)
    check_inclusion_options(given)
    check_depth(f"panoramas.{file_format}", options.output.depth)
    tasks = find_tasks(folder)
    try:
        os.makedirs(output, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{output}: cannot be made: {error.strerror}") from None

    @contextmanager
    def tracer(name: str) -> "Iterator[Trace]":
        own = given["debug_dir"] and os.path.join(given["debug_dir"], name)
        with debug_trace({**given, "debug_dir": own}) as trace:
            yield trace

    def tell(outcome: "Outcome") -> None:
        if not given["quiet"]:
            report.say(f"{outcome.name}: {outcome.message or outcome.path} ({outcome.seconds:.1f} s)")
            for photo in outcome.left_out:
                cause = f" ({photo.cause})" if photo.cause else ""
                report.say(f"  left out: {photo.name}: {photo.reason}{cause}")
            for note in outcome.notes:
                report.say(f"  note: {note}")

    setting = Setting(
        output, f".{file_format}", given["overwrite"], options, executor(given), tracer, given["require_all"]
    )
    outcomes = run_batch(tasks, setting, tell)
    if not given["quiet"]:
        report.say_table(
            ("panorama", "photos", "size", "seconds", "code", "result"), [_row(outcome) for outcome in outcomes]
        )
    if given["as_json"]:
        report.print_json([dataclasses.asdict(outcome) for outcome in outcomes])
    return batch_exit_code(outcomes, allow_partial=given["allow_partial"])


def _row(outcome: "Outcome") -> tuple[str, ...]:
    size = f"{outcome.size[0]} x {outcome.size[1]}" if outcome.path else "-"
    return (
        outcome.name,
        f"{outcome.photos} of {outcome.given}",
        size,
        f"{outcome.seconds:.1f}",
        str(outcome.exit_code),
        outcome.message or outcome.path,
    )
