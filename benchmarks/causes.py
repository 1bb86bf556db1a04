"""Is the stated cause the true one? Photos that were made to fail, each for a known cause.

    python benchmarks/causes.py [--output docs/reference/causes.md] [--causes blur,parallax]

A photo that is linked all the same has not failed, and counts neither as right nor as wrong.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path

from panostitch import pipeline
from panostitch.diagnosis import CAUSES
from panostitch.options import Options
from panostitch.runtime.executor import Executor
from panostitch.synthetic.failures import CASES, FAILURES, plant

LINKED = "linked"


@dataclass(frozen=True)
class Outcome:
    """What was said of one case: the cause, or that the photos were linked; and whether that link was called weak."""

    planted: str
    stated: str
    weak: bool


def main() -> None:
    """Print the table, and write the page if asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, help="Markdown file to write")
    parser.add_argument("--causes", default=",".join(FAILURES), help="those to plant, with commas between")
    given = parser.parse_args()
    outcomes = []
    for cause in given.causes.split(","):
        for case in range(CASES):
            outcomes.append(look_into(cause, case))
            print(f"{cause} {case}: {outcomes[-1].stated}", flush=True)
    text = page(outcomes)
    print(text)
    if given.output:
        given.output.write_text(text + "\n")


def look_into(cause: str, case: int) -> Outcome:
    """What is said of the photo that was made to fail."""
    planted = plant(cause, case)
    found = pipeline.recognise(planted.photos, Options(), run=Executor(threads=2))
    kept = found.groups.panoramas[0] if found.groups.panoramas else ()
    stated = {photo.name: photo.cause for photo in pipeline.left_out(found, kept)}
    weak = any(finding.weak and finding.cause == cause for finding in found.findings)
    return Outcome(cause, stated.get(planted.failing, LINKED), weak)


def page(outcomes: list[Outcome]) -> str:
    """The reference page."""
    failed = [one for one in outcomes if one.stated != LINKED]
    right = sum(one.stated == one.planted for one in failed)
    rows = [_row(cause, [one for one in outcomes if one.planted == cause]) for cause in FAILURES]
    return "\n".join([HEAD, *rows, "", TOTAL.format(failed=len(failed), right=right, share=right / max(1, len(failed))),
                      "", NEXT, *(f"| {name} | {_advice(name)} |" for name in CAUSES)])  # fmt: skip


def _row(cause: str, mine: list[Outcome]) -> str:
    failed = [one for one in mine if one.stated != LINKED]
    right = sum(one.stated == cause for one in failed)
    others = sorted({one.stated for one in failed} - {cause})
    linked = [one for one in mine if one.stated == LINKED]
    words = f"{len(linked)}, {sum(one.weak for one in linked)} of them called weak for this cause" if linked else "0"
    how = str(FAILURES[cause].__doc__).rstrip(".")
    return f"| {cause} | {how} | {right} of {len(failed)} | {', '.join(others)} | {words} |"


def _advice(name: str) -> str:
    return CAUSES[name].next.format(photo="PHOTO", first="A", second="B")


HEAD = f"""# Causes

Why photos are left out, or linked only weakly: what is said, and how often it is true. Made by
`python benchmarks/causes.py` from photographs of computed scenes, {CASES} sets for each cause. The thresholds were
chosen on the first {CASES // 2} of them; the others are photographs of other scenes, spoiled as much.
Each fails for one plain cause; photos with several at once are not measured.

| planted cause | how | stated | else | linked all the same |
|---|---|---|---|---|"""

TOTAL = "Of {failed} photos that failed, {right} were given the planted cause ({share:.0%})."

NEXT = """## What to try

The first cause in this order that the evidence speaks for is stated. `unknown` says that nothing stands out.

| cause | next |
|---|---|"""


if __name__ == "__main__":
    main()
