"""Which pairs of photos to try."""

from itertools import combinations


def choose_pairs(count: int) -> list[tuple[int, int]]:
    """All pairs (i, j), i < j, of `count` photos: right up to a few dozen photos, costly for hundreds."""
    return list(combinations(range(count), 2))
