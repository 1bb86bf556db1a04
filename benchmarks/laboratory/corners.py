"""Harris against FAST: time, and repeatability under rotation, scale and noise."""

from collections.abc import Callable
from functools import partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

import scenes
from report import Claim, Finding, Plot, Report, Series, Table, cells, percent

TITLE = "Harris against FAST"
CLAIM = Claim(
    "FAST is many times faster than Harris and as repeatable or more, but suffers more from noise; both bear "
    "rotations, and neither bears a change of scale.",
    "Rosten, Porter & Drummond 2010; Tuytelaars & Mikolajczyk 2008",
)
COUNT = 500  # corners
PLACE = 2.0  # px of the second photo, within which a corner is found again
APART = 5  # px between corners
BLOCK = 3  # px, window of Harris
K = 0.04
FAST_THRESHOLD = 10  # grey levels
REPEATS = 5
MANY = 3.0  # times
CLEARLY = 0.05  # of the repeatability
BEARS = 0.7  # of the repeatability without a change
METHOD = (
    f"The {COUNT} strongest corners, at least {APART} px apart, of photos of 960 x 720 of two computed scenes; Harris "
    f"by OpenCV's `goodFeaturesToTrack` (window {BLOCK} px, k = {K:g}), FAST by its `FastFeatureDetector` (FAST-9, "
    f"threshold {FAST_THRESHOLD}, with non-maximum suppression). Repeatability: the share of the first photo's "
    f"corners, in sight of the second, that were found there again within {PLACE:g} px. `by chance` is that of as "
    "many places at random. Time: detection alone, one thread, the least of five runs."
)


FULL, TINY = scenes.Sweep(), scenes.TINY_SWEEP


def harris(grey: scenes.Grey) -> Any:
    """Corners as OpenCV hands them over, strongest first."""
    return cv2.goodFeaturesToTrack(grey, COUNT, 1e-6, APART, blockSize=BLOCK, useHarrisDetector=True, k=K)


def fast(grey: scenes.Grey) -> Any:
    """All corners as OpenCV hands them over."""
    return cv2.FastFeatureDetector_create(FAST_THRESHOLD).detect(grey)


def places_of_harris(found: Any) -> NDArray[np.float32]:
    """Corners (n, 2) px."""
    return np.zeros((0, 2), np.float32) if found is None else np.asarray(found, np.float32).reshape(-1, 2)


def places_of_fast(found: Any) -> NDArray[np.float32]:
    """The strongest of the corners (n, 2) px that keep their distance."""
    order = np.argsort([-point.response for point in found], kind="stable")
    xy = np.asarray(cv2.KeyPoint.convert(found), np.float32).reshape(-1, 2)[order]
    kept: list[int] = []
    for n, place in enumerate(xy):
        if len(kept) == COUNT:
            break
        if not kept or np.hypot(*(xy[kept] - place).T).min() >= APART:
            kept.append(n)
    return xy[kept]


DETECT: dict[str, tuple[Callable[[scenes.Grey], Any], Callable[[Any], NDArray[np.float32]]]] = {
    "Harris": (harris, places_of_harris),
    "FAST": (fast, places_of_fast),
}
CHANCE = "by chance"


def experiment(settings: scenes.Sweep = FULL) -> Report:
    """Both detectors on all pairs."""
    found = {kind: over_changes(kind, settings) for kind in scenes.UNITS}
    plots = tuple(
        Plot(
            f"corners-{kind}", f"Corners found again: {scenes.UNITS[kind]}", scenes.UNITS[kind], "repeatability, %",
            tuple(
                Series(name, list(rows), [100 * one[name] for one in rows.values()], theory=name == CHANCE)
                for name in (*DETECT, CHANCE)
            ),
        )
        for kind, rows in found.items()
    )  # fmt: skip
    rows = [
        (f"{kind} {amount:g}", *(percent(one[name]) for name in (*DETECT, CHANCE)))
        for kind, by_amount in found.items()
        for amount, one in by_amount.items()
    ]
    table = Table("Repeatability", ("change", *DETECT, CHANCE), tuple(rows))
    ratio = slower(settings)
    speed = Table("Time", ("", *DETECT), (("by that of FAST", *cells(ratio, 1.0, digits=1)),))
    return Report(TITLE, CLAIM, METHOD, findings(found, ratio), (speed, table), plots)


def over_changes(kind: str, settings: scenes.Sweep) -> dict[float, dict[str, float]]:
    """Repeatability by the amount of a change, and by the detector: means of the scenes."""
    return {
        amount: {name: scenes.mean([again(name, *pair) for pair in pairs]) for name in (*DETECT, CHANCE)}
        for amount, pairs in settings.pairs(kind, yaw=3).items()
    }


def again(name: str, first: scenes.View, second: scenes.View) -> float:
    """Repeatability of one detector on one pair."""
    if name == CHANCE:
        dice = np.random.default_rng(scenes.SEED)
        places = [dice.uniform(0, view.camera.size, (COUNT, 2)) for view in (first, second)]
    else:
        find, places_of = DETECT[name]
        places = [places_of(find(view.grey)) for view in (first, second)]
    return scenes.repeatability(first, second, *places, PLACE)


def slower(settings: scenes.Sweep) -> float:
    """How many times as long as FAST Harris takes: mean of the scenes."""
    ratios = []
    for name in settings.worlds:
        grey = scenes.take(scenes.scene(name, settings.texture), settings.size, scenes.Change(noise=1)).grey
        times = [scenes.seconds(partial(find, grey), REPEATS) for find, _ in DETECT.values()]
        ratios.append(times[0] / times[1])
    return scenes.mean(ratios)


def findings(found: dict[str, dict[float, dict[str, float]]], ratio: float) -> tuple[Finding, ...]:
    """Speed; repeatability of either; what each bears."""
    mean = {
        kind: {name: scenes.mean([one[name] for one in list(rows.values())[1:]]) for name in DETECT}
        for kind, rows in found.items()
    }
    said = [
        Finding("holds" if ratio >= MANY else "does not hold", f"Harris takes {ratio:.1f} times as long as FAST."),
        Finding(
            "holds" if mean["roll"]["FAST"] >= mean["roll"]["Harris"] else "does not hold",
            f"found again where the photo is rolled: {percent(mean['roll']['FAST'])} of FAST's corners, "
            f"{percent(mean['roll']['Harris'])} of Harris'.",
        ),
    ]
    loss = {name: lost(found["noise"], name) for name in DETECT}
    said.append(
        Finding(
            "holds" if loss["FAST"] > loss["Harris"] + CLEARLY else "does not hold",
            f"most noise takes {percent(loss['FAST'])} of FAST's repeatability and {percent(loss['Harris'])} of "
            "Harris'.",
        )
    )
    for name in DETECT:
        turned, zoomed = lost(found["roll"], name, worst=True), lost(found["zoom"], name)
        right = turned < 1 - BEARS < zoomed
        said.append(
            Finding(
                "holds" if right else "holds in part" if turned < 1 - BEARS or zoomed > 1 - BEARS else "does not hold",
                f"{name}: the worst roll takes {percent(turned)} of the repeatability, the largest zoom "
                f"{percent(zoomed)}.",
            )
        )
    return tuple(said)


def lost(rows: dict[float, dict[str, float]], name: str, *, worst: bool = False) -> float:
    """Share of the repeatability at the first amount that is lost at the last one, or at the worst."""
    values = [one[name] for one in rows.values()]
    return 1 - (min(values[1:]) if worst else values[-1]) / max(values[0], 1e-9)
