"""`panostitch selftest`: the true error on photographs of known scenes."""

import dataclasses
from typing import Any

import click

from panostitch.cli.options import options_of, run_options, stage_options
from panostitch.options import AlignmentOptions, FeatureOptions, MatchingOptions


@click.command("selftest")
@click.option("--full", is_flag=True, help="All plans of cameras, not just the quick ones; takes a few minutes.")
@stage_options(FeatureOptions, MatchingOptions, AlignmentOptions)
@run_options
def command(full: bool, **given: Any) -> int:
    """Photograph scenes with known cameras, align the photos, and state how far that is from the truth."""
    from panostitch.cli import report
    from panostitch.cli.session import executor
    from panostitch.errors import EXIT_BUG, EXIT_OK
    from panostitch.jobs.selftest import QUICK, run_selftest
    from panostitch.synthetic.scene import PLANS

    findings = []
    for finding in run_selftest(list(PLANS) if full else QUICK, options_of(given), run=executor(given)):
        findings.append(finding)
        if not given["quiet"]:
            report.say(f"{finding.plan}: {finding.message or f'{finding.rms:.3f} px rms'}")
    if not given["quiet"]:
        report.say_table(
            ("plan", "photos", "rms px", "95 % px", "seconds", "verdict"),
            [
                (
                    f.plan,
                    f"{f.photos} of {f.given}",
                    f"{f.rms:.3f}",
                    f"{f.p95:.3f}",
                    f"{f.seconds:.1f}",
                    "passed" if f.passed else "FAILED",
                )
                for f in findings
            ],
        )
    if given["as_json"]:
        report.print_json([dataclasses.asdict(f) for f in findings])
    return EXIT_OK if all(f.passed for f in findings) else EXIT_BUG
