"""Why a photo is not in the panorama: the evidence, and what to try next."""

from collections.abc import Sequence

from panostitch.matching.verify import BASE_INLIERS
from panostitch.model.alignment import LeftOut
from panostitch.model.features import Attempt
from panostitch.model.match import Groups, Link, Rejection
from panostitch.model.photo import Photo

NAMES_SHOWN = 3


def explain_left_out(
    photos: Sequence[Photo],
    links: Sequence[Link],
    groups: Groups,
    kept: Sequence[int],
    attempts: Sequence[Sequence[Attempt]] = (),
) -> list[LeftOut]:
    """A LeftOut for each photo (in order) that is not among the kept ones; `attempts` are those made on each photo."""
    kept_set = set(kept)
    left_out = []
    for n in range(len(photos)):
        if n in kept_set:
            continue
        others = next((group for group in groups.panoramas if n in group), ())
        tried = attempts[n] if attempts else ()
        left_out.append(_in_other_group(photos, n, others) if others else _single(photos, links, n, tried))
    return left_out


def _in_other_group(photos: Sequence[Photo], n: int, group: Sequence[int]) -> LeftOut:
    names = [photos[k].name for k in group if k != n]
    shown = ", ".join(names[:NAMES_SHOWN]) + (f" and {len(names) - NAMES_SHOWN} more" if names[NAMES_SHOWN:] else "")
    return LeftOut(
        photos[n].name,
        f"belongs to another panorama, with {shown}",
        hint="`panostitch batch` makes a panorama of each group in a folder",
    )


def _single(photos: Sequence[Photo], links: Sequence[Link], n: int, attempts: Sequence[Attempt]) -> LeftOut:
    tried = (f"tried: {', '.join(map(str, attempts))}",) if attempts else ()
    refused = [link for link in links if isinstance(link, Rejection) and n in (link.i, link.j)]
    if not refused:
        return LeftOut(photos[n].name, "overlaps no other photo", details=tried)
    best = max(refused, key=lambda link: (link.inliers, link.putative))
    partner = photos[best.j if best.i == n else best.i].name
    numbers = f"{best.putative} matches, {best.inliers} agree" + (f" ({best.needed} needed)" if best.needed else "")
    if best.overlap and best.inliers > BASE_INLIERS:  # fewer agree by chance, and anywhere
        numbers += f", overlap about {best.overlap:.0%}"
    return LeftOut(
        photos[n].name,
        "overlaps no other photo",
        details=(f"best partner: {partner}, {numbers}: {best.reason}", *tried),
        hint="take a photo between the two, or leave it out",
    )
