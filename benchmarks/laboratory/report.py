"""What an experiment hands over, and the page that is made of it."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

MADE_BY = "<!-- made by benchmarks/laboratory/run.py; change the experiment, not this page -->"
VERDICT = "**In short:** "


@dataclass(frozen=True)
class Claim:
    """What textbooks say, and where."""

    text: str
    source: str


@dataclass(frozen=True)
class Finding:
    """One thing that was measured, beside one thing that was claimed."""

    verdict: Literal["holds", "holds in part", "does not hold"]
    text: str


@dataclass(frozen=True)
class Series:
    """A line of a plot; theory is drawn dashed, and without marks."""

    label: str
    x: Sequence[float]
    y: Sequence[float]
    theory: bool = False


@dataclass(frozen=True)
class Plot:
    """Lines over a common axis; `name` is that of the file."""

    name: str
    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    log_x: bool = False
    log_y: bool = False


@dataclass(frozen=True)
class Table:
    """Cells as they are to be read."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Report:
    """The outcome of an experiment; pictures (h, w, 3) RGB by the name of their file, with a caption."""

    title: str
    claim: Claim
    method: str
    findings: tuple[Finding, ...]
    tables: tuple[Table, ...] = ()
    plots: tuple[Plot, ...] = ()
    pictures: dict[str, tuple[str, NDArray[np.uint8]]] = field(default_factory=dict)

    @property
    def verdict(self) -> str:
        """All findings in a few words."""
        return ", ".join(dict.fromkeys(finding.verdict for finding in self.findings))


def cells(*values: float | str, digits: int = 2) -> tuple[str, ...]:
    """Numbers and words as the cells of a row."""
    return tuple(value if isinstance(value, str) else f"{value:.{digits}f}" for value in values)


def percent(share: float) -> str:
    """A share of 0..1 as a cell."""
    return "-" if np.isnan(share) else f"{100 * share:.1f} %"


def page(name: str, report: Report, versions: str) -> str:
    """The page of an experiment, in Markdown."""
    lines = [f"# {report.title}", "", MADE_BY, "", f"**The claim.** {report.claim.text} ({report.claim.source})", ""]
    lines += [f"{VERDICT}{report.verdict}", "", f"**How it was measured.** {report.method}", ""]
    lines += ["```", f"python benchmarks/laboratory/run.py --only {name}", "```", "", "## What came out", ""]
    lines += [f"- {finding.verdict.capitalize()}: {finding.text}" for finding in report.findings]
    for plot in report.plots:
        lines += ["", f"![{plot.title}]({plot.name}.svg)"]
    for file, (caption, _) in report.pictures.items():
        lines += ["", f"![{caption}]({file}.jpg)", "", caption]
    for table in report.tables:
        lines += ["", f"{table.title}:", "", f"| {' | '.join(table.head)} |", f"|{'---|' * len(table.head)}"]
        lines += [f"| {' | '.join(row)} |" for row in table.rows]
    return "\n".join([*lines, "", f"Made with {versions}.", ""])


def index(entries: Sequence[tuple[str, str, Claim, str]]) -> str:
    """The front page, from names, titles, claims and verdicts."""
    lines = ["# The laboratory", "", MADE_BY, ""]
    lines += [
        "What textbooks say of the methods that stitching is made of, and what comes out when it is measured with"
    ]
    lines += [
        "the code of this program, on scenes whose truth is known. Times are ratios: they say which is quicker on"
    ]
    lines += ["the same machine, not how long it takes on yours. `make laboratory` measures all of it again."]
    lines += ["", "| experiment | the claim | measured |", "|---|---|---|"]
    lines += [f"| [{title}]({name}.md) | {claim.text} | {verdict} |" for name, title, claim, verdict in entries]
    return "\n".join([*lines, ""])


def verdict_on(text: str) -> str:
    """The verdict that a page states; empty where there is none."""
    found = [line.removeprefix(VERDICT) for line in text.splitlines() if line.startswith(VERDICT)]
    return found[0] if found else ""
