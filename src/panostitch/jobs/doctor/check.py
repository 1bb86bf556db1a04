"""What one look at the installation found."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

Verdict = Literal["ok", "note", "missing", "not tried", "failed"]


@dataclass(frozen=True)
class Check:
    """One thing that was looked at.

    part:    to which part of the examination it belongs
    verdict: ok; note: works, but worth knowing; missing: optional and not there; not tried: what it needs is broken;
             failed: needed, and does not work
    found:   in words
    remedy:  what to do about it; empty where there is nothing to do
    value:   the same as `found` for programs, where it is a number (its unit is said where it is made) or a version
    """

    part: str
    name: str
    verdict: Verdict
    found: str
    remedy: str = ""
    value: float | int | str | None = None


def tried(part: str, name: str, trial: Callable[[], Check], *, remedy: str) -> Check:
    """What a trial finds; a trial that breaks in whatever way has failed."""
    try:
        return trial()
    except Exception as error:  # a broken installation breaks in ways that nobody foresees
        return Check(part, name, "failed", str(error).strip() or type(error).__name__, remedy)
