"""Brute force against FLANN: time and recall over the number of features."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

import scenes
from panostitch.features import opencv
from panostitch.matching import FLANN_PAYS_FROM, MATCHERS, brute_force, flann
from panostitch.matching.neighbours import Descriptors
from panostitch.matching.ratio import believable
from panostitch.options import MatchingOptions
from report import Claim, Finding, Plot, Report, Series, Table, cells, percent

TITLE = "Brute force against FLANN"
CLAIM = Claim(
    "For large sets of features FLANN is faster than brute force, at little loss.",
    "Muja & Lowe 2009; the OpenCV tutorial on feature matching",
)
REPEATS = 3
LITTLE_LOSS = 0.95  # recall
METHOD = (
    "SIFT and ORB descriptors of a computed world of shapes, and of a copy of it that is reduced to 0.9 and noisy; "
    "of both as many as the axis says, picked at random. Every matcher finds the two nearest neighbours in both "
    "directions. `brute` is the program's matrix product, `flann` its FLANN (four KD-trees with 64 checks; for bits "
    "LSH), `BFMatcher` OpenCV's brute force. Recall: of the matches that `brute` keeps by ratio test and mutually, "
    "the share that is also found with FLANN. Time: against the program's brute force; one thread, the least of "
    f"three runs. The program itself takes FLANN for floats above {FLANN_PAYS_FROM} features in a photo, and not for "
    "bits unless it is asked to."
)


@dataclass(frozen=True)
class Settings:
    """Numbers of features; width px of the picture that they are of."""

    counts: tuple[int, ...] = (500, 1000, 2000, 4000, 8000, 16000)
    width: int = 4096


FULL, TINY = Settings(), Settings((100, 200), 512)
KINDS: dict[str, Callable[[NDArray[np.uint8], int], opencv.Described]] = {"sift": opencv.sift, "orb": opencv.orb}


@dataclass(frozen=True)
class Measured:
    """Of one kind and number of features: times by that of the matrix product, and the recall of FLANN."""

    count: int
    flann: float
    bf_matcher: float
    recall: float
    invented: float


def experiment(settings: Settings = FULL) -> Report:
    """Time all matchers on all numbers of features."""
    measured = {name: over_counts(describe, settings) for name, describe in KINDS.items()}
    series = []
    for name, rows in measured.items():
        series.append(Series(f"{name}: FLANN", [m.count for m in rows], [m.flann for m in rows]))
        series.append(Series(f"{name}: BFMatcher", [m.count for m in rows], [m.bf_matcher for m in rows]))
    every = [m.count for m in next(iter(measured.values()))]
    series.append(Series("brute (matrix product)", every, [1.0] * len(every), theory=True))
    times = Plot(
        "matchers-time", "Time to match, by that of the matrix product", "features in each photo", "times as long",
        tuple(series), log_x=True, log_y=True,
    )  # fmt: skip
    recall = Plot(
        "matchers-recall", "Kept matches that FLANN finds too", "features in each photo", "%",
        tuple(Series(n, [m.count for m in rows], [100 * m.recall for m in rows]) for n, rows in measured.items()),
        log_x=True,
    )  # fmt: skip
    rows = [
        (name, str(m.count), *cells(m.flann, m.bf_matcher), percent(m.recall), percent(m.invented))
        for name, of_kind in measured.items()
        for m in of_kind
    ]
    head = ("descriptors", "features", "FLANN", "BFMatcher", "recall of FLANN", "kept by FLANN alone")
    table = Table("Times as long as the matrix product", head, tuple(rows))
    return Report(TITLE, CLAIM, METHOD, findings(measured), (table,), (times, recall))


def over_counts(describe: Callable[[NDArray[np.uint8], int], opencv.Described], settings: Settings) -> list[Measured]:
    """Measurements for each number of features that the pictures yield."""
    sets = [describe(grey, max(settings.counts)).descriptors for grey in scenes.detailed(settings.width)]
    dice = np.random.default_rng(scenes.SEED)
    sets = [dice.permutation(some) for some in sets]
    possible = [count for count in settings.counts if count <= min(map(len, sets))]
    return [measure(*(np.ascontiguousarray(some[:count]) for some in sets)) for count in possible]


def measure(a: Descriptors, b: Descriptors) -> Measured:
    """All matchers on two sets."""
    brute, indexed = (scenes.seconds(partial(MATCHERS[name], a, b, seed=0), REPEATS) for name in ("brute", "flann"))
    opencvs = scenes.seconds(partial(bf_matcher, a, b), REPEATS)
    limit = MatchingOptions().ratio
    exact, near = (
        {*map(tuple, believable(search(a, b, seed=0), limit).tolist())}
        for search in (brute_force.nearest, flann.nearest)
    )
    found = len(exact & near) / len(exact) if exact else float("nan")
    alone = len(near - exact) / len(near) if near else float("nan")
    return Measured(len(a), indexed / brute, opencvs / brute, found, alone)


def bf_matcher(a: Descriptors, b: Descriptors) -> None:
    """Two nearest neighbours in both directions, by OpenCV."""
    matcher = cv2.BFMatcher(cv2.NORM_HAMMING if a.dtype == np.uint8 else cv2.NORM_L2)
    for query, train in ((a, b), (b, a)):
        matcher.knnMatch(query, train, k=2)


def findings(measured: dict[str, list[Measured]]) -> tuple[Finding, ...]:
    """From where on FLANN pays, if it does, against either brute force."""
    said = []
    for name, rows in measured.items():
        worst = min(m.recall for m in rows)
        said.append(on_time(name, rows, "the matrix product", [m.flann for m in rows]))
        said.append(on_time(name, rows, "OpenCV's BFMatcher", [m.flann / m.bf_matcher for m in rows]))
        said.append(
            Finding(
                "holds" if worst >= LITTLE_LOSS else "does not hold",
                f"{name}: FLANN finds {percent(worst)} or more of what brute force keeps.",
            )
        )
    large = [m for m in measured["sift"] if m.count > FLANN_PAYS_FROM]
    if large:
        pays = all(m.flann < 1 for m in large)
        text = f"that it pays above {FLANN_PAYS_FROM} SIFT features, as the program has it:"
        text = f"{text} {large[0].flann:.2f} times as long"
        said.append(Finding("holds" if pays else "does not hold", f"{text} with {large[0].count}."))
    return tuple(said)


def on_time(name: str, rows: list[Measured], rival: str, ratios: list[float]) -> Finding:
    """Where FLANN is quicker than a brute force, and stays so, given how many times as long it takes."""
    slower = [n for n, ratio in enumerate(ratios) if ratio >= 1]
    most = f"{ratios[-1]:.2f} times as long with {rows[-1].count} features"
    if slower and slower[-1] == len(rows) - 1:
        return Finding("does not hold", f"{name}: FLANN is not quicker than {rival} with many features; {most}.")
    where = f"from {rows[slower[-1] + 1].count} features on" if slower else "with every number tried"
    return Finding("holds", f"{name}: FLANN is quicker than {rival} {where}; {most}.")
