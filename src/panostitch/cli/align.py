"""`panostitch align`: photos to a project file."""

from typing import Any

import click

from panostitch.cli.options import inclusion_options, options_of, run_options, stage_options
from panostitch.options import AlignmentOptions, FeatureOptions, LayoutOptions, MatchingOptions


@click.command("align")
@click.argument("photos", nargs=-1, required=True)
@click.option("-o", "--output", required=True, metavar="FILE.pano.json", help="The project file to write.")
@click.option("--pto", metavar="FILE.pto", default=None, help="Write the cameras for Hugin as well.")
@stage_options(FeatureOptions, MatchingOptions, AlignmentOptions)
@inclusion_options()
@run_options
def command(photos: tuple[str, ...], output: str, pto: str | None, **given: Any) -> int:
    """Find the cameras of PHOTOS and keep them in a project file, for `panostitch render`."""
    from panostitch import pipeline
    from panostitch.cli import report
    from panostitch.cli.session import check_inclusion_options, debug_trace, executor, open_given
    from panostitch.compositing import lay_out
    from panostitch.io import project, writers
    from panostitch.io import pto as hugin

    check_inclusion_options(given)
    opened, unreadable, inputs = open_given(photos, exclude=given["exclude"], require_all=given["require_all"])
    writers.check_output(output, overwrite=given["overwrite"], inputs=inputs, extensions=[project.EXTENSION])
    if pto:
        writers.check_output(pto, overwrite=given["overwrite"], inputs=inputs, extensions=[hugin.EXTENSION])
        hugin.check_photos(opened)
    with debug_trace(given) as trace:
        options, run = options_of(given), executor(given)
        alignment = pipeline.align(opened, options, unreadable=unreadable, run=run, trace=trace)
        if given["require_all"]:
            pipeline.check_all_in(alignment.left_out)
    project.write_project(alignment, output)
    if not given["quiet"]:
        report.say_alignment(alignment, verbose=given["verbose"])
        report.say_inclusion(alignment, verbose=given["verbose"])
        report.say(f"{output}: written; next: panostitch render {output} -o panorama.jpg")
    if pto:
        exactness = hugin.write_pto(alignment, pto, lay_out(alignment, LayoutOptions()))
        if given["verbose"] or (exactness.poor and not given["quiet"]):
            report.say(f"note: {pto}: {exactness}")
    if given["as_json"]:
        report.print_json(report.result(alignment, allow_partial=given["allow_partial"]))
    return report.exit_code(alignment, allow_partial=given["allow_partial"])
