"""`panostitch selftest`: the true error on photographs of known scenes, beside that of other programs."""

import dataclasses
import math
from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

import click

from panostitch.cli.options import options_of, run_options, stage_options
from panostitch.options import AlignmentOptions, FeatureOptions, MatchingOptions

if TYPE_CHECKING:
    from panostitch.jobs.selftest import Finding


@click.command("selftest")
@click.option("--full", is_flag=True, help="All plans of cameras, with and without EXIF, and Hugin; takes long.")
@click.option("--plan", "plans", multiple=True, metavar="NAME", help="Only this plan of cameras; may be repeated.")
@click.option("--alone", is_flag=True, help="Without the other programs.")
@stage_options(FeatureOptions, MatchingOptions, AlignmentOptions)
@run_options
def command(full: bool, plans: tuple[str, ...], alone: bool, **given: Any) -> int:
    """Photograph scenes with known cameras, align the photos, and state how far that is from the truth.

    Beside it stands the error of cv2.Stitcher and, with --full and where its tools are installed, of Hugin.
    """
    from panostitch.cli import report
    from panostitch.cli.session import executor
    from panostitch.errors import EXIT_BUG, EXIT_OK, UsageError
    from panostitch.jobs.contender import OURS, RIVAL
    from panostitch.jobs.selftest import PROGRAMS, QUICK, QUICK_SIZE, run_selftest
    from panostitch.synthetic.plans import PLANS

    if unknown := [plan for plan in plans if plan not in PLANS]:
        raise UsageError(f"there is no plan {unknown[0]}", hint=f"plans: {', '.join(PLANS)}")
    programs = [OURS] if alone else [OURS, RIVAL] if not full else list(PROGRAMS)
    findings = []
    for finding in run_selftest(
        plans or (list(PLANS) if full else QUICK),
        options_of(given),
        run=executor(given),
        programs=programs,
        exif=(False, True) if full else (False,),
        size=None if full else QUICK_SIZE,
    ):
        findings.append(finding)
        if not given["quiet"]:
            report.say(line(finding))
    if not given["quiet"]:
        report.say_table(*table(findings))
    if given["as_json"]:
        report.print_json([as_json(f) for f in findings])
    return EXIT_OK if all(f.passed for f in findings if f.program == OURS) else EXIT_BUG


def line(finding: "Finding") -> str:
    """A finding while others are still to come."""
    exif = " with EXIF" if finding.exif else ""
    error = f"{finding.rms:.3f} px rms" if finding.photos else "failed"
    return f"{finding.plan}{exif}: {finding.program}: {error}" + (f" ({finding.message})" if finding.message else "")


def table(findings: Sequence["Finding"]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Head and rows: a row for each plan, in it ours with all numbers and of the others what they are to ours."""
    from panostitch.jobs.contender import OURS
    from panostitch.jobs.selftest import PROGRAMS

    rivals = [p for p in PROGRAMS if p != OURS]
    head = ("plan", "EXIF", "photos", "rms px", "95 % px", "seconds", "verdict", *(f"{name} px" for name in rivals))
    rows = []
    for (plan, exif), group in groupby(findings, key=lambda f: (f.plan, f.exif)):
        by_program = {f.program: f for f in group}
        ours = by_program[OURS]
        own = (f"{ours.rms:.3f}", f"{ours.p95:.3f}", f"{ours.seconds:.1f}", "passed" if ours.passed else "FAILED")
        count = f"{ours.photos} of {ours.given}"
        rows.append((plan, "yes" if exif else "no", count, *own, *(cell(by_program.get(name)) for name in rivals)))
    return head, rows


def cell(finding: "Finding | None") -> str:
    """The error of another program; a dash where it is not installed, the photos where some are missing."""
    if finding is None:
        return "-"
    if not finding.photos:
        return "failed"
    missing = f" ({finding.photos} of {finding.given})" if finding.photos < finding.given else ""
    return f"{finding.rms:.3f}{missing}"


def as_json(finding: "Finding") -> dict[str, Any]:
    """A finding; JSON has no infinity."""
    values = {**dataclasses.asdict(finding), "passed": finding.passed}
    return {k: None if isinstance(v, float) and math.isinf(v) else v for k, v in values.items()}
