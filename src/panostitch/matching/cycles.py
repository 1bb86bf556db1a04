"""Which links contradict the cycles they lie on: repeated windows and patterns make confident wrong links.

Around a cycle of photos the homographies must lead back to where one started. The links to drop are the cheapest
set without which no cycle contradicts itself (Zach, Klopschitz & Pollefeys, CVPR 2010: evidence from loops, the best
explanation by an integer program). A link that lies on no cycle cannot be judged and stays, and so do wrong links that
agree with all that they meet.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array

from panostitch.matching.loops import Judged, Steps, judge, steps_of
from panostitch.matching.web import Cycle, Web
from panostitch.model.match import Link, Rejection, VerifiedMatch
from panostitch.model.photo import Photo

CONTRADICTS = 3.5  # times the expected error: a cycle that is further off holds a wrong link
CONFIRMS = 1.5  # times the expected error: a cycle that closes this well speaks for its links ...
CERTAIN = 0.1  # ... if a difference of this many photo lengths would have shown
WORST = 12.0  # a cycle counts for at most this much, however far off it is
WITNESSES = 3  # a link with fewer triangles than this is looked at in cycles of four links as well
NODES = 2000  # of the integer program's search: a bound that, unlike seconds, is the same on every computer


def drop_contradictions(photos: Sequence[Photo], links: Sequence[Link]) -> list[Link]:
    """The links in the same order; each that contradicts the others has become a Rejection that says so."""
    found = [(n, link) for n, link in enumerate(links) if isinstance(link, VerifiedMatch)]
    result = list(links)
    for k, reason in contradicting(photos, [link for _, link in found]).items():
        n, link = found[k]
        result[n] = Rejection(link.i, link.j, reason, link.putative, link.inliers, overlap=link.overlap)
    return result


def contradicting(photos: Sequence[Photo], links: Sequence[VerifiedMatch]) -> dict[int, str]:
    """Numbers of the links (indices i, j into `photos`) that contradict the others, and why, one line each."""
    if len(links) < 3:
        return {}
    court, found = _Court(steps_of(photos, links), {}), dict[int, str]()
    while True:  # wrong links stand up for each other: without one, the next is looked at more closely
        dropped = _dropped(photos, links, court.hear(Web.of(links, without=found)))
        if not dropped:
            return dict(sorted(found.items()))
        found |= dropped


def _dropped(photos: Sequence[Photo], links: Sequence[VerifiedMatch], judged: Sequence[Judged]) -> dict[int, str]:
    """The cheapest links to drop, and why."""
    bad = [loop for loop in judged if loop.ratio > CONTRADICTS]
    if not bad:
        return {}
    suspects = sorted({n for loop in bad for n in loop.cycle.links})
    good = [loop for loop in judged if loop.ratio < CONFIRMS and loop.expected < CERTAIN]
    chosen = _cheapest(links, suspects, bad, good)
    return {n: _reason(photos, links[n], n, bad, chosen) for n in chosen}


@dataclass(frozen=True)
class _Court:
    """Hears cycles, each but once."""

    steps: Steps
    known: dict[Cycle, Judged]

    def hear(self, web: Web) -> list[Judged]:
        """Triangles; for links on few of them cycles of four links; for links that nothing has judged yet any cycle."""
        judged = self._judge(web.triangles())
        seen = _times_judged(judged)
        judged += self._judge(web.squares([n for n in web.pairs if seen[n] < WITNESSES]))
        seen = _times_judged(judged)
        for cycles in web.detours([n for n in web.pairs if not seen[n]]):
            judged += self._judge(cycles)
        return judged

    def _judge(self, cycles: Sequence[Cycle]) -> list[Judged]:
        fresh = [cycle for cycle in cycles if cycle not in self.known]
        self.known.update((loop.cycle, loop) for loop in judge(self.steps, fresh))
        return [self.known[cycle] for cycle in cycles]


def _times_judged(judged: Sequence[Judged]) -> Counter[int]:
    """On how many cycles with something to say each link lies."""
    return Counter(
        n for loop in judged if loop.ratio > CONTRADICTS or loop.expected < CERTAIN for n in loop.cycle.links
    )


@dataclass(frozen=True)
class _Program:
    """min cost x over 0/1 vectors x with rows x >= low, built up row by row."""

    cost: list[float]
    entries: list[tuple[int, int, float]]
    low: list[float]

    def variable(self, cost: float) -> int:
        self.cost.append(cost)
        return len(self.cost) - 1

    def require(self, terms: Sequence[tuple[int, float]], low: float) -> None:
        self.entries.extend((len(self.low), column, value) for column, value in terms)
        self.low.append(low)

    def solve(self) -> NDArray[np.bool_]:
        from scipy.optimize import Bounds, LinearConstraint, milp  # long to load, and most photos need it not

        row, column, value = zip(*self.entries, strict=True)
        matrix = coo_array((value, (row, column)), shape=(len(self.low), len(self.cost))).tocsr()
        found = milp(
            self.cost,
            integrality=np.ones(len(self.cost)),
            bounds=Bounds(0, 1),
            constraints=LinearConstraint(matrix, np.array(self.low)),
            options={"node_limit": NODES},
        )
        # nothing is dropped where the search came to no answer
        return np.asarray(found.x > 0.5) if found.x is not None else np.zeros(len(self.cost), bool)


def _cheapest(
    links: Sequence[VerifiedMatch], suspects: Sequence[int], bad: Sequence[Judged], good: Sequence[Judged]
) -> set[int]:
    """The suspects to drop: each costs its strength and the confirmations that it takes part in, which are as good as
    the weakest of their links; a contradiction that is left costs as much as it is far off."""
    program = _Program([], [], [])
    drop = {n: program.variable(links[n].strength) for n in suspects}
    for loop in bad:
        left = program.variable(min(loop.ratio, WORST))
        program.require([(left, 1.0), *((drop[n], 1.0) for n in loop.cycle.links)], 1.0)
    for loop in good:
        mine = [n for n in loop.cycle.links if n in drop]
        if mine:
            lost = program.variable(min(1.0, *(links[n].strength for n in loop.cycle.links)))
            for n in mine:
                program.require([(lost, 1.0), (drop[n], -1.0)], 0.0)
    chosen = program.solve()
    return {n for n in suspects if chosen[drop[n]]}


def _reason(photos: Sequence[Photo], link: VerifiedMatch, number: int, bad: Sequence[Judged], dropped: set[int]) -> str:
    """The plainest contradiction with links that stay."""
    mine = [loop for loop in bad if number in loop.cycle.links]
    clean = [loop for loop in mine if not (set(loop.cycle.links) - {number}) & dropped]
    worst = max(clean or mine, key=lambda loop: loop.ratio)
    via = ", ".join(photos[p].name for p in worst.cycle.photos if p not in (link.i, link.j))
    return f"contradicts the other links (via {via}: {worst.error * max(photos[link.j].size):.0f} px off)"
