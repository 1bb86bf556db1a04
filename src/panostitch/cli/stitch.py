"""`panostitch PHOTOS -o PANORAMA`: both halves."""

from typing import Any

import click

from panostitch.cli.options import every_stage, inclusion_options, options_of, run_options
from panostitch.cli.writing import check_dry_run, check_report, write, write_options


@click.command("stitch")
@click.argument("photos", nargs=-1, required=True)
@click.option("-o", "--output", required=True, metavar="PANORAMA", help="Where to write: .jpg, .png, .tif or .webp.")
@click.option("--save-project", metavar="FILE.pano.json", default=None, help="Keep the alignment, for `render`.")
@click.option("--pto", metavar="FILE.pto", default=None, help="Write cameras and panorama for Hugin as well.")
@every_stage
@write_options
@inclusion_options()
@run_options
def command(photos: tuple[str, ...], output: str, save_project: str | None, pto: str | None, **given: Any) -> int:
    """Stitch PHOTOS (files, folders, globs, @list.txt, - for a list on standard input) into a panorama."""
    from panostitch import pipeline
    from panostitch.cli import report
    from panostitch.cli.session import check_inclusion_options, executor, listening, open_given
    from panostitch.compositing.view import look
    from panostitch.io import project, writers
    from panostitch.io import pto as hugin

    options, run = options_of(given), executor(given)
    check_inclusion_options(given)
    check_dry_run({**given, "save_project": save_project, "pto": pto})
    writers.check_depth(output, options.output.depth)
    opened, unreadable, inputs = open_given(photos, exclude=given["exclude"], require_all=given["require_all"])
    writers.check_output(output, overwrite=given["overwrite"], inputs=inputs)
    if save_project:
        writers.check_output(save_project, overwrite=given["overwrite"], inputs=inputs, extensions=[project.EXTENSION])
    if pto:
        writers.check_output(pto, overwrite=given["overwrite"], inputs=inputs, extensions=[hugin.EXTENSION])
        hugin.check_photos(opened)
        hugin.check_projection(options.layout.projection)
    check_report(given, inputs)
    with listening(given, options) as trace:
        alignment = pipeline.align(opened, options, unreadable=unreadable, run=run, trace=trace)
        if given["require_all"]:
            pipeline.check_all_in(alignment.left_out)
        if not given["quiet"]:
            report.say_alignment(alignment, verbose=given["verbose"])
        if save_project:
            project.write_project(alignment, save_project)
        panorama = pipeline.render(alignment, options, run=run, trace=trace)
        if pto:
            seen, plan = look(alignment, options.layout), panorama.plan
            exactness = hugin.write_pto(seen, pto, panorama.canvas, crop=plan.crop, light=plan.light)
        write(alignment, panorama, output, options, given=given, run=run, trace=trace)
    if not given["quiet"]:
        if pto and (exactness.poor or given["verbose"]):
            report.say(f"note: {pto}: {exactness}")
        if given["debug_dir"]:
            report.say(f"{given['debug_dir']}: a picture of every stage")
        if given["report"]:
            report.say(f"{given['report']}: what became of the photos, for a browser")
    return report.exit_code(alignment, allow_partial=given["allow_partial"])
