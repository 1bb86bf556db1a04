"""Which pairs to try again: the best bridges between what has stayed apart, and only as many as that is worth."""

from collections.abc import Collection, Sequence

from panostitch.matching.pairs import in_succession
from panostitch.model.match import Groups, Link, Rejection, VerifiedMatch
from panostitch.model.photo import Photo, natural_key

Pair = tuple[int, int]

BRIDGES = 3  # pairs that are tried again for each group and each single photo, besides its neighbours in order
MOST_APART = 24  # groups and single photos that are tried again; in a large heap those of which most is known


def pairs_to_retry(photos: Sequence[Photo], links: Sequence[Link], groups: Groups) -> list[Pair]:
    """Pairs (i, j), i < j, sorted, that would join groups or single photos; the most promising for each of these."""
    parts = [*groups.panoramas, *((n,) for n in groups.singles)]
    part_of = {photo: number for number, part in enumerate(parts) for photo in part}
    singles = set(groups.singles)
    near = [pair for pair in in_succession(photos, reach=1) if singles & set(pair)]
    evidence = dict.fromkeys(near, (0, 0))
    for link in links:
        if isinstance(link, Rejection) and part_of[link.i] != part_of[link.j] and _is_open(link, singles):
            evidence[link.i, link.j] = link.inliers, link.putative

    def rank(pair: Pair) -> tuple[object, ...]:
        inliers, putative = evidence[pair]
        return -inliers, -putative, *sorted(natural_key(photos[n].name) for n in pair)

    bridges: dict[int, list[Pair]] = {}
    for pair in sorted(evidence, key=rank):
        for number in {part_of[n] for n in pair}:
            bridges.setdefault(number, []).append(pair)
    # parts came into the table in the order of their best bridges
    chosen = {pair for number in list(bridges)[:MOST_APART] for pair in bridges[number][:BRIDGES]}
    if len(parts) <= MOST_APART:
        chosen.update(near)
    return sorted(chosen)


def _is_open(link: Rejection, singles: Collection[int]) -> bool:
    """Whether a closer look may help; photos that found their group show enough, so they must have come near a link."""
    if link.inliers and not link.needed:
        return False  # it had enough, and was refuted by the others
    return link.i in singles or link.j in singles or 2 * link.inliers >= link.needed


def improved(links: Sequence[Link], retried: Sequence[Link]) -> list[Link]:
    """The links, sorted, with those of the retried pairs that are verified or at least came nearer to it."""
    best = {(link.i, link.j): link for link in links}
    for link in retried:
        before = best.get((link.i, link.j))
        if before is None or isinstance(link, VerifiedMatch) or link.inliers > before.inliers:
            best[link.i, link.j] = link
    return [best[pair] for pair in sorted(best)]
