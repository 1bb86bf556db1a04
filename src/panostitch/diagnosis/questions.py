"""Which links to explain: of photos that stay alone, of groups that stay apart, and weak ones that nothing backs."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from panostitch.matching import find_groups
from panostitch.matching.pairs import in_succession
from panostitch.model.match import Groups, Link, Rejection, VerifiedMatch, needed_inliers
from panostitch.model.photo import Photo

Pair = tuple[int, int]

MOST_QUESTIONS = 24  # photos and groups that are looked at more closely
PARTNERS = 3  # refused pairs that are looked at for each, those with most inliers, besides its neighbours in order
WEAK_OVERLAP = 0.08  # of the smaller photo
WEAK_INLIERS = 1.3  # times as many as it takes


@dataclass(frozen=True)
class Question:
    """Why a photo is linked to none of its partners, or only weakly; numbers of photos, the likeliest partner first."""

    photo: int
    partners: tuple[int, ...]
    weak: bool = False


def questions(photos: Sequence[Photo], links: Sequence[Link], groups: Groups) -> list[Question]:
    """All there is to explain, or the first of it; nothing where all photos are well linked."""
    refused = sorted(
        (link for link in links if isinstance(link, Rejection)), key=lambda k: (-k.inliers, -k.putative, k.i, k.j)
    )
    near = sorted(in_succession(photos, reach=1)) if groups.singles else []
    singles = [Question(n, _partners(n, refused, near)) for n in groups.singles]
    apart = [one for group in groups.panoramas[1:] for one in _bridge(group, refused)]
    weak = [Question(link.i, (link.j,), weak=True) for link in weak_links(len(photos), links)]
    return [one for one in (*weak, *singles, *apart) if one.partners][:MOST_QUESTIONS]


def _partners(n: int, refused: Sequence[Rejection], near: Sequence[Pair]) -> tuple[int, ...]:
    best = [(link.i, link.j) for link in refused if n in (link.i, link.j)][:PARTNERS]
    return tuple(dict.fromkeys(i + j - n for i, j in (*best, *near) if n in (i, j)))


def _bridge(group: Sequence[int], refused: Sequence[Rejection]) -> list[Question]:
    """What came nearest to joining a group to others."""
    for link in refused:
        if (link.i in group) != (link.j in group):
            photo, partner = (link.i, link.j) if link.i in group else (link.j, link.i)
            return [Question(photo, (partner,))]
    return []


def weak_links(count: int, links: Sequence[Link]) -> list[VerifiedMatch]:
    """Links that rest on little, and without which a panorama would fall apart."""
    sound = [link for link in links if isinstance(link, VerifiedMatch)]
    weak = [link for link in sound if _is_weak(link)]
    if not weak:
        return []
    doubted = set(map(id, weak))
    parts = find_groups(count, [link for link in sound if id(link) not in doubted])
    part_of = {photo: number for number, part in enumerate(parts.panoramas) for photo in part}
    part_of |= {photo: -1 - photo for photo in parts.singles}
    joins = [tuple(sorted((part_of[link.i], part_of[link.j]))) for link in weak]
    times = Counter(joins)
    return [link for link, join in zip(weak, joins, strict=True) if join[0] != join[1] and times[join] == 1]


def _is_weak(link: VerifiedMatch) -> bool:
    return link.overlap < WEAK_OVERLAP or link.inliers < WEAK_INLIERS * needed_inliers(link.putative)
