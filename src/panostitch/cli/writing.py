"""What `stitch` and `render` share: what is about to be written, `--dry-run`, `--resume`, and the writing itself."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from panostitch.cli.options import report_option
from panostitch.errors import UsageError

if TYPE_CHECKING:
    from panostitch.cli.options import Command
    from panostitch.model.alignment import Alignment
    from panostitch.model.panorama import Panorama
    from panostitch.options import Options
    from panostitch.runtime.executor import Executor
    from panostitch.runtime.trace import Trace

BESIDES = ("debug_dir", "save_project", "pto", "report")  # options that write something else than the panorama


def write_options(command: "Command") -> "Command":
    """Options of every command that writes one panorama."""
    for decorate in (
        click.option(
            "--resume", is_flag=True, help="Go on from the tiles that a killed run left in PANORAMA.partial; keep them."
        ),
        report_option,
        click.option(
            "--dry-run", is_flag=True, help="Say how large the panorama will be and what it takes, then stop."
        ),
    ):
        command = decorate(command)
    return command


def check_dry_run(given: dict[str, Any]) -> None:
    """Raise UsageError where a dry run would have to write something."""
    wrong = [f"--{name.replace('_', '-')}" for name in BESIDES if given.get(name)]
    if given["dry_run"] and (wrong or given["resume"]):
        other = wrong[0] if wrong else "--resume"
        raise UsageError(f"--dry-run writes nothing, {other} would", hint="leave one of them out")


def check_report(given: dict[str, Any], inputs: Sequence[str]) -> None:
    """Raise what speaks against the report that was asked for, before any work is done: MissingError, OutputError."""
    if given["report"] is None:
        return
    from panostitch.io import writers
    from panostitch.report import check_installed

    check_installed()
    writers.check_output(given["report"], overwrite=given["overwrite"], inputs=inputs, extensions=[".html", ".htm"])


def write(
    alignment: "Alignment",
    panorama: "Panorama",
    output: str,
    options: "Options",
    *,
    given: dict[str, Any],
    run: "Executor",
    trace: "Trace",
) -> None:
    """Say what comes, and write it, unless the user only wants to know. Prints the result as JSON where asked for."""
    from panostitch.cli import report
    from panostitch.io import forecast, writers
    from panostitch.io.limits import depth_for
    from panostitch.io.partial import EXTENSION, fingerprint, finished_tiles

    expected = forecast.forecast(panorama, output, options.output, run=run)
    if given["dry_run"]:
        seconds = forecast.expected_seconds(panorama, output, options.output, threads=expected.threads)
        if not given["quiet"]:
            report.say_dry_run(alignment, panorama, output, expected, seconds)
            report.say_inclusion(alignment, panorama, verbose=given["verbose"])
        if given["as_json"]:
            foreseen = {"memory": expected.memory, "threads": expected.threads, "seconds": seconds}
            report.print_json(
                report.result(alignment, panorama, allow_partial=given["allow_partial"]) | {"forecast": foreseen}
            )
        return
    if not given["quiet"]:
        report.say_forecast(panorama, output, expected)
    if given["resume"]:
        depth, _ = depth_for(panorama, output, options.output.depth)
        with finished_tiles(output, fingerprint(alignment, options), panorama, depth) as finished:
            if finished.note and not given["quiet"]:
                report.say(f"{output}{EXTENSION}: {finished.note}")
            try:
                written = writers.write_panorama(
                    panorama, output, options.output, run=run, trace=trace, finished=finished
                )
            except KeyboardInterrupt:
                report.say(f"{output}{EXTENSION}: the same command goes on from the tiles that are finished")
                raise
    else:
        written = writers.write_panorama(panorama, output, options.output, run=run, trace=trace)
    # the judge of seams needs a projection of the whole view; the faces of a cube have one each
    if (given["debug_dir"] or given["report"]) and not options.layout.cube:
        from panostitch.scoring import score_seams

        score_seams(panorama, options.compositing, run=run, trace=trace)
    if not given["quiet"]:
        report.say_panorama(panorama, output, written)
        report.say_inclusion(alignment, panorama, verbose=given["verbose"])
    if given["as_json"]:
        report.print_json(report.result(alignment, panorama, output, written, allow_partial=given["allow_partial"]))
