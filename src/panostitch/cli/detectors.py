"""`panostitch detectors`: every detector with every matcher on the user's own photos, side by side."""

from typing import TYPE_CHECKING, Any

import click

from panostitch.cli.options import options_of, run_options, stage_options
from panostitch.options import AlignmentOptions, FeatureOptions, MatchingOptions

if TYPE_CHECKING:
    from panostitch.jobs.detectors import Contest, Trial

HEAD = (
    "detector", "matcher", "key points", "ms/photo", "kB/photo", "ms/pair", "raw", "kept", "verified", "links",
    "right", "error px", "licence",
)  # fmt: skip
NOTHING = "-"


@click.command("detectors")
@click.argument("photos", nargs=-1, required=True)
@click.option("-o", "--output", default=None, metavar="PICTURE", help="Key points and matches of every detector.")
@stage_options(FeatureOptions, MatchingOptions, AlignmentOptions)
@run_options
def command(photos: tuple[str, ...], output: str | None, **given: Any) -> int:
    """Try all detectors and matchers on PHOTOS, and tell what each finds and costs and how much of it is right.

    The judge is the refined alignment of the photos, which begins with --detector and --matcher. Times are of the
    processor, one photo or pair at a time.
    """
    from panostitch.cli import report
    from panostitch.cli.session import debug_trace, executor, open_given
    from panostitch.errors import EXIT_OK
    from panostitch.io import writers
    from panostitch.jobs import detectors

    options = options_of(given)
    opened, _, _ = open_given(photos, require_all=True)  # what cannot be read says nothing about detectors
    if output:
        writers.check_output(output, overwrite=given["overwrite"], inputs=[photo.path for photo in opened])
    with debug_trace(given) as trace:
        contest = detectors.hold(opened, options, run=executor(given), trace=trace)
    if output:
        writers.write_picture(output, detectors.picture(contest))
    code = report.exit_code(contest.reference) if contest.reference else EXIT_OK
    code = contest.failure.exit_code if contest.failure else code
    if given["as_json"]:
        report.print_json(contest.to_json() | {"path": output, "exit_code": code})
    if not given["quiet"]:
        say_contest(contest)
        if output:
            report.say(f"{output}: a row for each detector")
    if contest.failure:
        raise contest.failure
    return code


def say_contest(contest: "Contest") -> None:
    """A row for each trial, then what judged them."""
    from panostitch.cli import report

    pairs = len(contest.pairs)
    report.say_table(HEAD, [_row(trial, pairs) for trial in contest.trials])
    report.say(f"means of {len(contest.photos)} photos and {pairs} {'pair' if pairs == 1 else 'pairs'}, times medians")
    if not contest.reference:
        return
    report.say(
        "right: share of the kept matches; error: median distance of the homographies' places from those of the "
        f"refined alignment, which is {contest.reference.rms:.2f} px rms off its own points"
    )
    for photo in contest.reference.left_out:
        report.say(f"left out: {photo.name}: {photo.reason}")


def _row(trial: "Trial", pairs: int) -> tuple[str, ...]:
    figures = trial.to_json()
    return (
        trial.detector,
        trial.matcher,
        f"{figures['key_points']:.0f}",
        f"{figures['detect_ms']:.1f}",
        f"{figures['descriptor_bytes'] / 1000:.0f}",
        f"{figures['match_ms']:.1f}",
        *(f"{figures[name]:.0f}" for name in ("raw", "kept", "verified")),
        f"{trial.linked} of {pairs}",
        NOTHING if trial.right_share is None else f"{100 * trial.right_share:.1f} %",
        NOTHING if trial.error is None else f"{trial.error:.2f}",
        figures["licence"],
    )
