"""`panostitch doctor`: whether everything works here, and how to repair what does not."""

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from panostitch.jobs.doctor import Check


@click.command("doctor")
@click.option("--json", "as_json", is_flag=True, help="Every check as JSON instead of the table.")
def command(as_json: bool) -> int:
    """Look at the installation: packages, formats, detectors, the machine; and stitch a small known scene.

    Everything is tried, and what does not work is told with the way to repair it. The exit code is 11 if something that
    is needed does not work; what is optional may be missing. Takes about ten seconds.
    """
    import dataclasses

    from panostitch.cli.terminal import print_json, show
    from panostitch.errors import EXIT_DAMAGED, EXIT_OK
    from panostitch.jobs.doctor import examine
    from panostitch.runtime.executor import Executor
    from panostitch.runtime.machine import threads

    checks: list[Check] = []
    for check in examine(run=Executor(threads())):
        if not as_json:
            show_check(check, first=not checks or checks[-1].part != check.part)
        checks.append(check)
    failed = [check for check in checks if check.verdict == "failed"]
    code = EXIT_DAMAGED if failed else EXIT_OK
    if as_json:
        print_json({"checks": [dataclasses.asdict(check) for check in checks], "exit_code": code})
    else:
        names = ", ".join(check.name for check in failed)
        show("")
        show(f"{names}: not working; the lines `next:` say what to do" if failed else "everything that is needed works")
    return code


def show_check(check: "Check", *, first: bool) -> None:
    """A line for a check, and one for its remedy; above it the name of its part, if it is the `first` of it."""
    from panostitch.cli.terminal import show

    if first:
        show("")
        show(check.part)
    mark = "FAILED" if check.verdict == "failed" else check.verdict
    show(f"  {mark:9}  {check.name:30}  {check.found}")
    if check.remedy:
        show(f"  {'':9}  {'':30}  next: {check.remedy}")
