"""Why a photo is not in the panorama: the cause, the evidence, and what to try next."""

from collections.abc import Sequence

from panostitch.model.alignment import LeftOut
from panostitch.model.features import Attempt
from panostitch.model.finding import Finding
from panostitch.model.match import BASE_INLIERS, Groups, Link, Rejection
from panostitch.model.photo import Photo

NAMES_SHOWN = 3


def explain_left_out(
    photos: Sequence[Photo],
    links: Sequence[Link],
    groups: Groups,
    kept: Sequence[int],
    attempts: Sequence[Sequence[Attempt]] = (),
    findings: Sequence[Finding] = (),
) -> list[LeftOut]:
    """A LeftOut for each photo (in order) that is not among the kept ones; `attempts` are those made on each photo."""
    kept_set = set(kept)
    causes = {finding.photo: finding for finding in findings if not finding.weak}
    left_out = []
    for n in range(len(photos)):
        if n in kept_set:
            continue
        others = next((group for group in groups.panoramas if n in group), ())
        if others:
            left_out.append(_in_other_group(photos, n, others, causes))
        else:
            tried = attempts[n] if attempts else ()
            left_out.append(_single(photos, links, n, tried, causes.get(photos[n].name)))
    return left_out


def _in_other_group(photos: Sequence[Photo], n: int, group: Sequence[int], causes: dict[str, Finding]) -> LeftOut:
    names = [photos[k].name for k in group if k != n]
    shown = ", ".join(names[:NAMES_SHOWN]) + (f" and {len(names) - NAMES_SHOWN} more" if names[NAMES_SHOWN:] else "")
    apart = next((causes[photos[k].name] for k in group if photos[k].name in causes), None)
    return LeftOut(
        photos[n].name,
        f"belongs to another panorama, with {shown}",
        (f"what keeps them apart: {apart.photo} - {apart.partner}: {apart.cause}: {apart.evidence}",) if apart else (),
        apart.next if apart else "`panostitch batch` makes a panorama of each group in a folder",
        cause=apart.cause if apart else "",
    )


def _single(
    photos: Sequence[Photo], links: Sequence[Link], n: int, attempts: Sequence[Attempt], finding: Finding | None
) -> LeftOut:
    name = photos[n].name
    details = [f"cause: {finding.cause}: {finding.evidence}"] if finding else []
    best = _best(photos, links, n, finding.partner if finding else "")
    if best is not None:
        details.append(_best_partner(photos[best.j if best.i == n else best.i].name, best, finding))
    if attempts:
        details.append(f"tried: {', '.join(map(str, attempts))}")
    advice = f"take a photo between the two, or leave it out with --exclude {name}" if best is not None else ""
    return LeftOut(
        name,
        "overlaps no other photo"
        if finding is None or finding.cause == "different scene"
        else "is linked to no other photo",
        tuple(details),
        finding.next if finding else advice,
        cause=finding.cause if finding else "",
    )


def _best(photos: Sequence[Photo], links: Sequence[Link], n: int, partner: str) -> Rejection | None:
    """The refused link with the partner that was found to tell most, else the one with most inliers."""
    refused = [link for link in links if isinstance(link, Rejection) and n in (link.i, link.j)]
    told = [link for link in refused if photos[link.i + link.j - n].name == partner]
    return max(told or refused, key=lambda link: (link.inliers, link.putative), default=None)


def _best_partner(partner: str, best: Rejection, finding: Finding | None) -> str:
    numbers = f"{best.putative} matches, {best.inliers} agree" + (f" ({best.needed} needed)" if best.needed else "")
    overlap = finding.overlap if finding else best.overlap if best.inliers > BASE_INLIERS else None
    if overlap:  # fewer agree by chance, and anywhere
        numbers += f", overlap about {overlap:.0%}"
    return f"best partner: {partner}, {numbers}: {best.reason}"
