"""The web of links between photos, and the cycles in it."""

from collections import deque
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

from panostitch.model.match import VerifiedMatch

SQUARES = 8  # looked at for one link
LONGEST = 24  # links in a cycle; the error to be expected has grown beyond use


@dataclass(frozen=True)
class Cycle:
    """Photos in a ring, each linked to the next and the last to the first; and the numbers of those links, sorted."""

    photos: tuple[int, ...]
    links: tuple[int, ...]


@dataclass(frozen=True)
class Web:
    """Links by the pair of photos (i < j) they join, the reverse, and for each photo those it is linked to, sorted."""

    numbers: Mapping[tuple[int, int], int]
    pairs: Mapping[int, tuple[int, int]]
    neighbours: Mapping[int, Sequence[int]]

    @classmethod
    def of(cls, links: Sequence[VerifiedMatch], without: Collection[int] = ()) -> Self:
        """The web of these links but for some (numbers)."""
        numbers = {(link.i, link.j): n for n, link in enumerate(links) if n not in without}
        neighbours: dict[int, list[int]] = {}
        for i, j in sorted([*numbers, *((j, i) for i, j in numbers)]):
            neighbours.setdefault(i, []).append(j)
        return cls(numbers, {n: pair for pair, n in numbers.items()}, neighbours)

    def triangles(self) -> list[Cycle]:
        """All cycles of three links."""
        sets = {photo: set(others) for photo, others in self.neighbours.items()}
        return [self._cycle((i, j, k)) for i, j in sorted(self.numbers) for k in sorted(sets[i] & sets[j]) if k > j]

    def squares(self, links: Sequence[int]) -> list[Cycle]:
        """Some cycles of four links on which these links lie."""
        found = [self._cycle(ring) for n in links for ring in self._squares(*self.pairs[n])]
        return list({cycle.links: cycle for cycle in found}.values())

    def _squares(self, i: int, j: int) -> list[tuple[int, ...]]:
        beside = set(self.neighbours[i]) - {j}
        rings = ((i, j, k, m) for k in self.neighbours[j] if k != i for m in self.neighbours[k] if m in beside - {k})
        return [ring for ring, _ in zip(rings, range(SQUARES), strict=False)]

    def detours(self, links: Sequence[int]) -> list[list[Cycle]]:
        """The shortest cycle through each of these links, by their lengths; without the others where that is possible.

        Wrong links between photos that are far apart are shortcuts: one must not stand witness for another.
        """
        doubted = {self.pairs[n] for n in links}
        found: dict[int, dict[tuple[int, ...], Cycle]] = {}
        for pair in sorted(doubted):
            ring = self._around(pair, doubted) or self._around(pair, {pair})
            if ring:
                cycle = self._cycle(ring)
                found.setdefault(len(ring), {})[cycle.links] = cycle
        return [list(found[length].values()) for length in sorted(found)]

    def _around(self, pair: tuple[int, int], without: set[tuple[int, int]]) -> tuple[int, ...]:
        """Photos on the shortest way from one end of a link to the other; empty if there is none."""
        first, last = pair
        came_from = {first: first}
        waiting = deque([(first, 1)])
        while waiting and last not in came_from:
            photo, length = waiting.popleft()
            if length == LONGEST:
                break
            for other in self.neighbours[photo]:
                if other not in came_from and (min(photo, other), max(photo, other)) not in without:
                    came_from[other] = photo
                    waiting.append((other, length + 1))
        if last not in came_from:
            return ()
        way = [last]
        while way[-1] != first:
            way.append(came_from[way[-1]])
        return tuple(way)

    def _cycle(self, ring: tuple[int, ...]) -> Cycle:
        pairs = zip(ring, (*ring[1:], ring[0]), strict=True)
        return Cycle(ring, tuple(sorted(self.numbers[min(pair), max(pair)] for pair in pairs)))
