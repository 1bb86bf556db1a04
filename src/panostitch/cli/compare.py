"""`panostitch compare`: cv2.Stitcher or Hugin, and panostitch, on the same photos."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from panostitch.cli.options import every_stage, options_of, report_option, run_options

if TYPE_CHECKING:
    from panostitch.jobs.compare import Comparison, Misfit
    from panostitch.jobs.contender import Outcome
    from panostitch.model.photo import Photo
    from panostitch.model.score import Score
    from panostitch.options import Options

HEAD = ("", "photos", "panorama", "seconds", "CPU s", "memory MB", "median px", "rms px", "95 % px")
SCORE_HEAD = ("", "score", "shift px", "95 % px", "colour dE", "structure", "ghost", "blur", "worst at")
NOTHING = "-"
WORST_SHOWN = 3


@click.command("compare")
@click.argument("photos", nargs=-1, required=True)
@click.option("-o", "--output", required=True, metavar="PICTURE", help="Both panoramas, one above the other.")
@click.option(
    "--with",
    "rival",
    type=click.Choice(["cv2", "hugin"]),
    default="cv2",
    show_default=True,
    help="The other program: OpenCV's cv2.Stitcher, or Hugin's tools, which have to be installed.",
)
@report_option
@every_stage
@run_options
def command(photos: tuple[str, ...], output: str, rival: str, **given: Any) -> int:
    """Stitch PHOTOS by another program and by panostitch, and put both side by side.

    Each runs in a process of its own. The first table says what each includes and costs, and how far (in pixels of the
    full photos) its cameras leave points apart that another detector has matched. The second one judges the finished
    pictures, 0 is perfect. The exit code is panostitch's.
    """
    import tempfile

    from panostitch.cli import report
    from panostitch.cli.session import executor, open_given
    from panostitch.cli.writing import check_report
    from panostitch.errors import EXIT_BUG, PanostitchError
    from panostitch.io import writers
    from panostitch.jobs import compare

    compare.check_rival(rival)
    opened, _, _ = open_given(photos, require_all=True)  # other programs would stumble over what cannot be read
    writers.check_output(output, overwrite=given["overwrite"], inputs=[photo.path for photo in opened])
    check_report(given, [photo.path for photo in opened])
    settings = {name: given[name] for name in ("threads", "debug_dir", "overwrite")}
    with tempfile.TemporaryDirectory(prefix="panostitch-compare-") as folder:
        options, run = options_of(given), executor(given)
        comparison = compare.compare(opened, options, folder, rival=rival, run=run, **settings)
        failure = compare.failure(comparison)
        if not failure:
            writers.write_picture(output, compare.side_by_side(comparison), quality=given["quality"])
        if given["report"]:
            write_page(comparison, failure, opened, options, output, given["report"])
    if failure or not comparison.ours.alignment:
        code = failure.exit_code if isinstance(failure, PanostitchError) else EXIT_BUG
    else:
        code = report.exit_code(comparison.ours.alignment)
    if given["as_json"]:
        report.print_json(comparison.to_json() | {"path": "" if failure else output, "exit_code": code})
    if not given["quiet"]:
        say_comparison(comparison)
    if failure:
        raise failure
    if not given["quiet"]:
        report.say(f"{output}: both panoramas, one above the other")
        if given["report"]:
            report.say(f"{given['report']}: both of them, for a browser")
    return code


def write_page(
    comparison: "Comparison",
    failure: Exception | None,
    photos: "Sequence[Photo]",
    options: "Options",
    output: str,
    path: str,
) -> None:
    """Both programs on one page, with the cameras of ours. Raises OutputError."""
    from panostitch.errors import PanostitchError
    from panostitch.jobs.compare import reduced
    from panostitch.report import Beside, Panorama, Record, Table, write_report

    record = Record()
    record.photos = {photo.name: photo for photo in photos}
    record.alignment = comparison.ours.alignment
    record.path = "" if failure else output
    misfits = zip(comparison.outcomes, comparison.misfits, strict=True)
    scores = zip(comparison.outcomes, comparison.scores, strict=True)
    tables = (
        Table(HEAD, [_row(comparison, outcome, misfit) for outcome, misfit in misfits]),
        Table(SCORE_HEAD, [_score_row(outcome, score) for outcome, score in scores if score]),
    )
    panoramas = [
        Panorama(outcome.program, reduced(outcome) if outcome.picture else None, _words(comparison, outcome))
        for outcome in comparison.outcomes
    ]
    error = failure if isinstance(failure, PanostitchError) else None
    write_report(record, path, options, error=error, beside=Beside(tables, panoramas))
    if error:
        error.details = (*error.details, f"report: {path}")


def _words(comparison: "Comparison", outcome: "Outcome") -> str:
    """What a program made, or why it made nothing."""
    if not outcome.size:
        return outcome.status
    left_out = comparison.left_out(outcome)
    size = f"{outcome.size[0]} x {outcome.size[1]} px"
    return f"{size}, without {', '.join(left_out)}" if left_out else f"{size}, all photos"


def say_comparison(comparison: "Comparison") -> None:
    """A row for each program, then what does not fit into a row."""
    from panostitch.cli import report

    pairs = zip(comparison.outcomes, comparison.misfits, strict=True)
    report.say_table(HEAD, [_row(comparison, outcome, misfit) for outcome, misfit in pairs])
    scored = zip(comparison.outcomes, comparison.scores, strict=True)
    report.say_table(SCORE_HEAD, [_score_row(outcome, score) for outcome, score in scored if score])
    for outcome in comparison.outcomes:
        left_out = comparison.left_out(outcome)
        if not outcome.size:
            report.say(f"{outcome.program}: {outcome.status}")
        elif left_out:
            report.say(f"{outcome.program} leaves out {', '.join(left_out)}")
    if comparison.points:
        report.say(
            f"px: distance in the full photos between {comparison.points} matched points of {comparison.detector}, "
            f"in {comparison.pairs} overlapping {'pair' if comparison.pairs == 1 else 'pairs'} of photos"
        )


def _row(comparison: "Comparison", outcome: "Outcome", misfit: "Misfit | None") -> tuple[str, ...]:
    return (
        f"{outcome.program} {outcome.version}",
        f"{len(comparison.included(outcome))} of {len(comparison.photos)}",
        f"{outcome.size[0]} x {outcome.size[1]}" if outcome.size else NOTHING,
        _number(outcome.seconds, 2),
        _number(outcome.cpu_seconds, 2),
        _number(outcome.peak_megabytes, 0),
        *(_number(value, 2) for value in ((misfit.median, misfit.rms, misfit.p95) if misfit else (None,) * 3)),
    )


def _score_row(outcome: "Outcome", score: "Score") -> tuple[str, ...]:
    measures = (score.total, score.displacement, score.displacement_p95, score.colour, score.structure, score.ghost)
    return (
        outcome.program,
        *(_number(value, 2) for value in (*measures, score.blur)),
        ", ".join(f"{worst.x:.0f}/{worst.y:.0f}" for worst in score.worst[:WORST_SHOWN]) or NOTHING,
    )


def _number(value: float | None, digits: int) -> str:
    return NOTHING if value is None else f"{value:.{digits}f}"
