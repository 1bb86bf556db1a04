"""SURF against SIFT: time, repeatability, matches and their accuracy."""

from dataclasses import dataclass
from functools import partial

import numpy as np

import scenes
from panostitch.features import DETECTORS
from panostitch.matching import brute_force
from panostitch.matching.ratio import believable
from panostitch.options import MatchingOptions
from report import Claim, Finding, Plot, Report, Series, Table, cells, percent

TITLE = "SURF against SIFT"
CLAIM = Claim(
    "SURF comes near SIFT or outperforms it in repeatability and distinctiveness, and is several times faster.",
    "Bay et al. 2008",
)
NAMES = ("sift", "surf")
COUNT = 1000  # key points of either
PLACE = 1.5  # px of the second photo, within which a point is found again
RIGHT = 4.0  # px
SEVERAL = 3.0  # times, about what the paper measures
NEAR = 0.05  # of repeatability, of right matches: so much less is still near
REPEATS = 3
METHOD = (
    f"Both find {COUNT} key points in photos of the same size, 960 x 720, of two computed scenes; the second photo is "
    "rolled, zoomed or noisier. Repeatability: the share of the first photo's points, in sight of the second, that "
    f"were found there again within {PLACE:g} px. Right matches: nearest neighbours that pass the ratio test mutually "
    f"and lie within {RIGHT:g} px of the truth; their error is the median distance from it. Time: of both photos, "
    "detected and described, on one thread. SURF is the program's own, in NumPy; SIFT is OpenCV's, in C++. (In the "
    "program SIFT searches smaller pictures than SURF, as it doubles them by itself: here both get the same.)"
)


FULL, TINY = scenes.Sweep(), scenes.TINY_SWEEP


@dataclass(frozen=True)
class Outcome:
    """Of one detector on one pair, or the mean of some."""

    repeatability: float
    right: float
    share: float
    error: float
    seconds: float


def experiment(settings: scenes.Sweep = FULL) -> Report:
    """Both detectors on all pairs."""
    found = {kind: over_changes(kind, settings) for kind in scenes.UNITS}
    plots = tuple(
        Plot(
            f"surf-sift-{kind}", f"Right matches: {scenes.UNITS[kind]}", scenes.UNITS[kind], "right matches of a pair",
            tuple(
                Series(name, list(by_amount), [one[name].right for one in by_amount.values()]) for name in NAMES
            ),
        )
        for kind, by_amount in found.items()
    )  # fmt: skip
    head = ("change", "detector", "repeatability", "right matches", "share of right ones", "error px")
    rows = [
        (f"{kind} {amount:g}", name, *row(one[name]))
        for kind, by_amount in found.items()
        for amount, one in by_amount.items()
        for name in NAMES
    ]
    every = [one for by_amount in found.values() for one in by_amount.values()]
    means = {name: mean_of([one[name] for one in every]) for name in NAMES}
    rows += [("mean", name, *row(means[name])) for name in NAMES]
    return Report(TITLE, CLAIM, METHOD, findings(means), (Table("Means of the scenes", head, tuple(rows)),), plots)


def over_changes(kind: str, settings: scenes.Sweep) -> dict[float, dict[str, Outcome]]:
    """Outcomes by the amount of a change, and by the detector: means of the scenes."""
    return {
        amount: {name: mean_of([outcome(name, *pair) for pair in pairs]) for name in NAMES}
        for amount, pairs in settings.pairs(kind, yaw=5).items()
    }


def outcome(name: str, first: scenes.View, second: scenes.View) -> Outcome:
    """One detector on one pair."""
    detect = DETECTORS[name]
    here, there = (detect(view.grey, COUNT) for view in (first, second))
    here, there = (one.take(np.argsort(-one.response, kind="stable")[:COUNT]) for one in (here, there))
    taken = sum(scenes.seconds(partial(detect, view.grey, COUNT), REPEATS) for view in (first, second))
    pairs = believable(brute_force.nearest(here.descriptors, there.descriptors), MatchingOptions().ratio)
    off = np.linalg.norm(scenes.truly(first, second, here.xy[pairs[:, 0]]) - there.xy[pairs[:, 1]], axis=1)
    right = off <= RIGHT
    again = scenes.repeatability(first, second, here.xy, there.xy, PLACE)
    error = float(np.median(off[right])) if right.any() else float("nan")
    return Outcome(again, float(right.sum()), float(right.mean()) if len(right) else 0.0, error, taken)


def mean_of(outcomes: list[Outcome]) -> Outcome:
    """Means of all figures; an error where there is one."""
    values = np.array([[*vars(one).values()] for one in outcomes])
    return Outcome(*(float(np.nanmean(column)) if np.isfinite(column).any() else np.nan for column in values.T))


def row(one: Outcome) -> tuple[str, ...]:
    """An outcome as cells."""
    return percent(one.repeatability), f"{one.right:.0f}", percent(one.share), *cells(one.error)


def findings(means: dict[str, Outcome]) -> tuple[Finding, ...]:
    """Speed, repeatability, distinctiveness, accuracy."""
    sift, surf = (means[name] for name in NAMES)
    faster = sift.seconds / surf.seconds
    return (
        Finding(
            "holds" if faster >= SEVERAL else "holds in part" if faster > 1 else "does not hold",
            f"SURF takes {1 / faster:.2f} times as long as SIFT.",
        ),
        Finding(
            "holds" if surf.repeatability > sift.repeatability - NEAR else "does not hold",
            f"repeatability: SURF {percent(surf.repeatability)}, SIFT {percent(sift.repeatability)}.",
        ),
        Finding(
            "holds" if surf.right > sift.right * (1 - NEAR) and surf.share > sift.share - NEAR else "does not hold",
            f"distinctiveness: {surf.right:.0f} right matches of a pair by SURF, {sift.right:.0f} by SIFT; of the kept "
            f"ones {percent(surf.share)} and {percent(sift.share)} are right.",
        ),
        Finding(
            "holds" if surf.error <= sift.error * (1 + NEAR) else "does not hold",
            f"places: a right match of SURF is {surf.error:.2f} px off, one of SIFT {sift.error:.2f} px.",
        ),
    )
