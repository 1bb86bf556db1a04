"""`panostitch align`: photos to a project file."""

from typing import Any

import click

from panostitch.cli.options import options_of, run_options, stage_options
from panostitch.options import AlignmentOptions, FeatureOptions, MatchingOptions


@click.command("align")
@click.argument("photos", nargs=-1, required=True)
@click.option("-o", "--output", required=True, metavar="FILE.pano.json", help="The project file to write.")
@stage_options(FeatureOptions, MatchingOptions, AlignmentOptions)
@run_options
def command(photos: tuple[str, ...], output: str, **given: Any) -> int:
    """Find the cameras of PHOTOS and keep them in a project file, for `panostitch render`."""
    from panostitch import pipeline
    from panostitch.cli import report
    from panostitch.cli.session import debug_trace, executor, open_given
    from panostitch.io import project, writers

    opened = open_given(photos)
    writers.check_output(
        output,
        overwrite=given["overwrite"],
        inputs=[photo.path for photo in opened],
        extensions=[project.EXTENSION],
    )
    with debug_trace(given) as trace:
        alignment = pipeline.align(opened, options_of(given), run=executor(given), trace=trace)
    project.write_project(alignment, output)
    if not given["quiet"]:
        report.say_alignment(alignment, verbose=given["verbose"])
        report.say(f"{output}: written; next: panostitch render {output} -o panorama.jpg")
    if given["as_json"]:
        report.print_json(report.result(alignment))
    return report.exit_code(alignment)
