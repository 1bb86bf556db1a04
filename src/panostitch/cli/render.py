"""`panostitch render`: a project file to a panorama."""

from typing import Any

import click

from panostitch.cli.options import inclusion_options, options_of, run_options, stage_options
from panostitch.cli.writing import check_dry_run, check_report, write, write_options
from panostitch.options import CompositingOptions, LayoutOptions, OutputOptions


@click.command("render")
@click.argument("project_file", metavar="FILE.pano.json|FILE.pto")
@click.option("-o", "--output", required=True, metavar="PANORAMA", help="Where to write: .jpg, .png, .tif or .webp.")
@stage_options(LayoutOptions, CompositingOptions, OutputOptions)
@write_options
@inclusion_options(exclude=False)
@run_options
def command(project_file: str, output: str, **given: Any) -> int:
    """Make the panorama of a project file, ours or Hugin's, as often and in as many ways as you like."""
    from panostitch import pipeline
    from panostitch.cli import report
    from panostitch.cli.session import check_inclusion_options, executor, listening
    from panostitch.io import project, writers
    from panostitch.io import pto as hugin

    options, run = options_of(given), executor(given)
    check_inclusion_options(given)
    check_dry_run(given)
    writers.check_depth(output, options.output.depth)
    read = hugin.read_pto if project_file.lower().endswith(hugin.EXTENSION) else project.read_project
    alignment = read(project_file)
    if given["require_all"]:
        pipeline.check_all_in(alignment.left_out)
    inputs = [project_file, *(photo.path for photo in alignment.photos)]
    writers.check_output(output, overwrite=given["overwrite"], inputs=inputs)
    check_report(given, inputs)
    with listening(given, options) as trace:
        panorama = pipeline.render(alignment, options, run=run, trace=trace)
        write(alignment, panorama, output, options, given=given, run=run, trace=trace)
    if given["report"] and not given["quiet"]:
        report.say(f"{given['report']}: what became of the photos, for a browser")
    return report.exit_code(alignment, allow_partial=given["allow_partial"])
