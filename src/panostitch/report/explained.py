"""The failures, each with its cause, its evidence, its picture, and what to try next."""

from collections.abc import Sequence
from dataclasses import dataclass

from panostitch.model.alignment import LeftOut
from panostitch.model.finding import Finding
from panostitch.report.pairs import Figure, Pair, figure
from panostitch.report.record import Compared, Record


@dataclass(frozen=True)
class Explained:
    """One failure. `left_out` is the photo that it cost, None for a weak link and for groups that stay apart."""

    title: str
    finding: Finding | None
    left_out: LeftOut | None
    figure: Figure | None
    agree: int = 0
    matches: int = 0


def explained(record: Record, pairs: Sequence[Pair]) -> list[Explained]:
    """Photos that are left out, then weak links, then groups that stay apart."""
    left_out = {one.name: one for one in (record.alignment.left_out if record.alignment else record.left_out)}
    known = record.alignment.findings if record.alignment else ()
    found: Sequence[tuple[Finding, Compared | None]] = record.findings or [(finding, None) for finding in known]
    drawn = {frozenset(pair.photos): pair.figure for pair in pairs}
    rows: list[Explained] = []
    told = set()
    for finding, compared in found:
        cost = None if finding.weak else left_out.get(finding.photo)
        if cost:
            told.add(finding.photo)
        names = f"{finding.photo} – {finding.partner}"
        title = f"Weak link: {names}" if finding.weak else f"Left out: {finding.photo}" if cost else f"Apart: {names}"
        if compared is None:
            rows.append(Explained(title, finding, cost, drawn.get(frozenset((finding.photo, finding.partner)))))
            continue
        drawing = figure(record.photos, compared)
        rows.append(Explained(title, finding, cost, drawing, int(compared.agree.sum()), len(compared.agree)))
    rows += [Explained(f"Left out: {name}", None, one, None) for name, one in left_out.items() if name not in told]
    return sorted(rows, key=lambda row: (row.left_out is None, row.finding is None or not row.finding.weak))
