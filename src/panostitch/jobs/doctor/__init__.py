"""An examination of the installation: whatever is broken, the rest is looked at all the same.

Nothing at the top of these modules needs a package that may be broken, but `trials`, which is loaded when all can be.
"""

from collections.abc import Callable, Iterator

from panostitch.jobs.doctor import machine, packages
from panostitch.jobs.doctor.check import Check as Check
from panostitch.runtime.executor import Executor

# Parts that need every package, by the names of their checks.
PARTS = ("formats", "detectors", "self-check")


def examine(*, run: Executor) -> Iterator[Check]:
    """Every check, as it is made."""
    broken = []
    for check in packages.packages():
        broken += [check.name] if check.verdict == "failed" else []
        yield check
    yield from machine.system()
    if broken:
        why = f"needs {', '.join(broken)}"
        yield from (Check(part, part, "not tried", why) for part in PARTS)
    else:
        yield from _loaded("machine", machine.vision)
        yield from _loaded("trials", lambda: _trials(run))
    yield from packages.extras()
    if not broken:
        yield from packages.programs()


def _trials(run: Executor) -> Iterator[Check]:
    from panostitch.jobs.doctor import trials

    yield from trials.formats()
    yield from trials.detectors()
    yield from trials.scene(run)


def _loaded(part: str, checks: Callable[[], Iterator[Check]]) -> Iterator[Check]:
    """The checks of a part; what breaks between them is one more that failed."""
    try:
        yield from checks()
    except Exception as error:  # as in `tried`
        yield Check(part, part, "failed", f"{type(error).__name__}: {error}", packages.this_program())
