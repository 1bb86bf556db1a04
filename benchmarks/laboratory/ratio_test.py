"""What the ratio test removes: wrong nearest neighbours, and right ones."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import scenes
from panostitch.features import DETECTORS
from panostitch.matching import brute_force, ratio
from panostitch.matching.neighbours import Neighbours
from panostitch.options import MAX_FEATURES
from report import Claim, Finding, Plot, Report, Series, Table, percent

TITLE = "What the ratio test removes"
CLAIM = Claim(
    "A match is kept if its nearest neighbour is less than 0.8 times as far as the second nearest: this removes 90 % "
    "of the false matches and less than 5 % of the correct ones.",
    "Lowe 2004, section 7.1, of SIFT",
)
RIGHT = 4.0  # px: as far as a true match may be off
LOWE = 0.8
PROMISED_WRONG, PROMISED_RIGHT = 0.90, 0.05
CHANGES = (
    scenes.Change(yaw=25),
    scenes.Change(yaw=15, roll=30),
    scenes.Change(yaw=10, zoom=1.5),
    scenes.Change(yaw=20, noise=6, exposure=-1),
)
METHOD = (
    "Photos of two computed scenes, a hall and a world of shapes, in pairs: turned by 25 degrees; turned and rolled by "
    "30 degrees; turned and zoomed 1.5 times; turned, one step darker and noisier. The nearest neighbour of every key "
    f"point is right if it lies within {RIGHT:g} px of where the true cameras see the point, and wrong otherwise, also "
    "where the other photo does not show the point at all. All pairs together."
)


@dataclass(frozen=True)
class Settings:
    """Scenes, size px of the photos, width px of the texture, ratios to try."""

    worlds: tuple[str, ...] = scenes.SCENES
    size: tuple[int, int] = (960, 720)
    texture: int = scenes.FINE
    ratios: tuple[float, ...] = (0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9)


FULL, TINY = Settings(), Settings(("shapes",), (200, 150), scenes.COARSE, (0.6, 0.8, 0.9))


@dataclass(frozen=True)
class Judged:
    """Nearest neighbours of many pairs, and which are right (n,)."""

    neighbours: Neighbours
    right: NDArray[np.bool_]

    def removed(self, limit: float) -> tuple[float, float]:
        """Shares of the wrong and of the right ones that the ratio test removes."""
        return self._removed(self.neighbours.best >= limit * self.neighbours.second)

    def not_mutual(self) -> tuple[float, float]:
        """Shares that mutual agreement removes."""
        return self._removed(~self.neighbours.mutual)

    def removed_by_both(self, limit: float) -> tuple[float, float]:
        """Shares that the program removes, which asks for both."""
        kept = np.zeros(len(self.right), bool)
        kept[ratio.believable(self.neighbours, limit)[:, 0]] = True
        return self._removed(~kept)

    def _removed(self, gone: NDArray[np.bool_]) -> tuple[float, float]:
        return tuple(float(gone[some].mean()) if some.any() else float("nan") for some in (~self.right, self.right))


def experiment(settings: Settings = FULL) -> Report:
    """Judge the neighbours of all detectors at all ratios."""
    pairs = [
        scenes.pair(scenes.scene(name, settings.texture), settings.size, change)
        for name in settings.worlds
        for change in CHANGES
    ]
    judged = {name: judge(name, pairs) for name in DETECTORS}
    curves = {name: [one.removed(limit) for limit in settings.ratios] for name, one in judged.items()}
    plots = tuple(
        Plot(
            f"ratio-test-{what}",
            f"{what.capitalize()} matches that the ratio test removes",
            "ratio",
            "share removed, %",
            tuple(
                Series(name, settings.ratios, [100 * point[side] for point in curve]) for name, curve in curves.items()
            ),
        )
        for side, what in enumerate(("wrong", "right"))
    )
    return Report(TITLE, CLAIM, METHOD, findings(judged), (table(judged, settings),), plots)


def judge(detector: str, pairs: list[list[scenes.View]]) -> Judged:
    """The nearest neighbours of one detector in all pairs."""
    found, right = [], []
    for first, second in pairs:
        here, there = (DETECTORS[detector](view.grey, MAX_FEATURES[detector]) for view in (first, second))
        if len(here.xy) and len(there.xy):
            neighbours = brute_force.nearest(here.descriptors, there.descriptors)
            off = np.linalg.norm(scenes.truly(first, second, here.xy) - there.xy[neighbours.index], axis=1)
            found.append(neighbours)
            right.append(off <= RIGHT)  # NaN, which the other photo does not show, is not
    together = [np.concatenate([vars(one)[name] for one in found]) for name in ("index", "best", "second", "mutual")]
    return Judged(Neighbours(*together), np.concatenate(right))


def table(judged: dict[str, Judged], settings: Settings) -> Table:
    """Wrong and right removed, in one cell."""
    tests = [(f"ratio {limit:g}", lambda one, limit=limit: one.removed(limit)) for limit in settings.ratios]
    tests += [("mutual", Judged.not_mutual), (f"mutual and {LOWE:g}", lambda one: one.removed_by_both(LOWE))]
    rows = [
        (label, *(" / ".join(percent(share) for share in test(one)) for one in judged.values()))
        for label, test in tests
    ]
    counts = ("right among nearest", *(percent(float(one.right.mean())) for one in judged.values()))
    return Table("Removed: wrong ones / right ones", ("test", *judged), (counts, *rows))


def findings(judged: dict[str, Judged]) -> tuple[Finding, ...]:
    """Lowe's two numbers, for SIFT and for the others."""
    said = []
    for name, one in judged.items():
        wrong, right = one.removed(LOWE)
        kept = [wrong >= PROMISED_WRONG, right < PROMISED_RIGHT]
        verdict = "holds" if all(kept) else "holds in part" if any(kept) else "does not hold"
        text = f"{name} at {LOWE:g}: {percent(wrong)} of the wrong matches go, and {percent(right)} of the right ones."
        said.append(Finding(verdict, text))
    return tuple(said)
