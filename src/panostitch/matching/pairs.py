"""Which pairs of photos to compare in full: those that promise something.

Of a few dozen photos every pair gets a first look; of more, only what looks alike (VLAD) and what was taken one after
the other, so that the work grows with the number of photos, not with its square. Of these, a pair is compared in full
if the first look found something, or was among the best of one of the two, or if the two were taken in succession.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations

from panostitch.matching.retrieval import best_partners
from panostitch.model.features import Features
from panostitch.model.photo import Photo, natural_key

Pair = tuple[int, int]

NO_FIRST_LOOK_UP_TO = 8  # photos; of so few all pairs are compared in full
ALL_PAIRS_UP_TO = 40  # photos
ALIKE = 12  # partners for each photo by VLAD
REACH = 2  # a photo's neighbours in order of time or name, to each side
PROMISING = 5  # matches in the first look; of pairs that share nothing, one in a hundred has so many
BEST = 2  # partners of each photo that are compared in full, however few its matches in the first look


def choose_pairs(photos: Sequence[Photo], features: Sequence[Features], *, seed: int) -> list[Pair]:
    """Pairs (i, j), i < j, sorted, that deserve a first look."""
    if len(photos) <= ALL_PAIRS_UP_TO:
        return list(combinations(range(len(photos)), 2))
    # in the order of names, so that the words do not depend on the order in which photos are given
    order = sorted(range(len(photos)), key=lambda n: natural_key(photos[n].name))
    alike = best_partners([features[n].descriptors for n in order], ALIKE, seed=seed)
    return sorted({_sorted(order[a], order[b]) for a, b in alike} | in_succession(photos))


def in_succession(photos: Sequence[Photo], reach: int = REACH) -> set[Pair]:
    """Pairs of photos taken, or named, one after the other."""

    def by_name(n: int) -> tuple[object, ...]:
        return natural_key(photos[n].name)

    timed = [n for n, photo in enumerate(photos) if photo.taken is not None]
    orders = [sorted(range(len(photos)), key=by_name), sorted(timed, key=lambda n: (photos[n].taken, by_name(n)))]
    steps = [(order, step) for order in orders for step in range(1, reach + 1)]
    return {_sorted(a, b) for order, step in steps for a, b in zip(order, order[step:], strict=False)}


def promising(photos: Sequence[Photo], counts: Mapping[Pair, int]) -> list[Pair]:
    """Those of the pairs, sorted, that are worth a full comparison, by the matches that a first look counted."""
    kept = {pair for pair, count in counts.items() if count >= PROMISING}
    kept |= in_succession(photos, reach=1) & counts.keys()
    for best in _ranked(counts, name_of=lambda n: photos[n].name).values():
        kept.update(best[:BEST])
    return sorted(kept)


def _ranked(counts: Mapping[Pair, int], name_of: Callable[[int], str]) -> dict[int, list[Pair]]:
    """The pairs of each photo, most matches first; ties go by the names of the partners."""
    pairs: dict[int, list[tuple[int, tuple[object, ...], Pair]]] = {}
    for (i, j), count in counts.items():
        pairs.setdefault(i, []).append((-count, natural_key(name_of(j)), (i, j)))
        pairs.setdefault(j, []).append((-count, natural_key(name_of(i)), (i, j)))
    return {n: [pair for *_, pair in sorted(rows)] for n, rows in pairs.items()}


def _sorted(a: int, b: int) -> Pair:
    return (a, b) if a < b else (b, a)
