"""How many photos ORB takes in the time that another detector takes for one."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np

import scenes
from panostitch.features import DETECTORS
from report import Claim, Finding, Plot, Report, Series, Table

TITLE = "Frames a second of ORB"
CLAIM = Claim(
    "ORB is two orders of magnitude faster than SIFT and one order faster than SURF: fast enough for video.",
    "Rublee et al. 2011",
)
COUNT = 1000  # key points
REPEATS = 5
PROMISED = {"SIFT": 100.0, "SURF": 10.0}
METHOD = (
    f"Every detector finds and describes {COUNT} key points in a photo of a computed world of shapes, at several "
    "sizes; one thread, the least of five runs, means of three photos. Frames a second are given as a share of ORB's "
    "at 320 x 240. `ORB` is OpenCV's as it comes; `ORB here` as the program calls it, which asks for six times as "
    "many points and spreads them. SURF is the program's own, in NumPy, the others are OpenCV's, in C++."
)


@dataclass(frozen=True)
class Settings:
    """Sizes px of the photos, number of photos, width px of the texture."""

    sizes: tuple[tuple[int, int], ...] = ((320, 240), (640, 480), (960, 720), (1280, 960), (1920, 1440))
    photos: int = 3
    texture: int = scenes.FINE


FULL, TINY = Settings(), Settings(((160, 120), (240, 180)), 1, scenes.COARSE)


def plain_orb(grey: scenes.Grey, count: int) -> Any:
    """OpenCV's ORB as it comes."""
    return cv2.ORB_create(nfeatures=count).detectAndCompute(grey, None)


CONTESTANTS: dict[str, Callable[[scenes.Grey, int], Any]] = {
    "ORB": plain_orb,
    "ORB here": DETECTORS["orb"],
    "SURF": DETECTORS["surf"],
    "AKAZE": DETECTORS["akaze"],
    "SIFT": DETECTORS["sift"],
}


def experiment(settings: Settings = FULL) -> Report:
    """Time all detectors at all sizes."""
    world = scenes.scene("shapes", settings.texture)
    largest = [
        scenes.take(world, settings.sizes[-1], scenes.Change(noise=1), yaw=40 * n, seed=n).grey
        for n in range(settings.photos)
    ]
    times = {name: [time(detect, largest, size) for size in settings.sizes] for name, detect in CONTESTANTS.items()}
    unit = times["ORB"][0]
    megapixels = [width * height / 1e6 for width, height in settings.sizes]
    plot = Plot(
        "orb-speed", "Frames a second, as a share of ORB's at the smallest size", "megapixels", "share",
        tuple(Series(name, megapixels, [unit / t for t in row]) for name, row in times.items()), log_x=True, log_y=True,
    )  # fmt: skip
    others = [name for name in times if name != "ORB"]
    rows = [
        (
            f"{width} x {height}",
            f"{unit / times['ORB'][n]:.3f}",
            *(f"{times[o][n] / times['ORB'][n]:.1f}" for o in others),
        )
        for n, (width, height) in enumerate(settings.sizes)
    ]
    head = ("photo", "frames a second of ORB, as a share", *(f"{name}: times as long as ORB" for name in others))
    return Report(TITLE, CLAIM, METHOD, findings(times), (Table("By size", head, tuple(rows)),), (plot,))


def time(detect: Callable[[scenes.Grey, int], Any], photos: list[scenes.Grey], size: tuple[int, int]) -> float:
    """Mean time of the photos at a size."""
    reduced = [np.asarray(cv2.resize(photo, size, interpolation=cv2.INTER_AREA), np.uint8) for photo in photos]
    return scenes.mean([scenes.seconds(partial(detect, photo, COUNT), REPEATS) for photo in reduced])


def findings(times: dict[str, list[float]]) -> tuple[Finding, ...]:
    """The two factors of the paper."""
    said = []
    for name, promised in PROMISED.items():
        factors = [other / own for other, own in zip(times[name], times["ORB"], strict=True)]
        verdict = (
            "holds" if min(factors) >= promised else "holds in part" if max(factors) >= promised else "does not hold"
        )
        text = f"ORB is {min(factors):.1f} to {max(factors):.1f} times as fast as {name} (claimed: {promised:.0f})."
        said.append(Finding(verdict, text))
    here = [other / own for other, own in zip(times["ORB here"], times["ORB"], strict=True)]
    slower = [other / own for other, own in zip(times["SIFT"], times["ORB here"], strict=True)]
    said.append(
        Finding(
            "does not hold" if min(slower) < PROMISED["SIFT"] else "holds",
            f"as the program calls it, ORB takes {min(here):.1f} to {max(here):.1f} times as long as it does as it "
            f"comes, and is {min(slower):.1f} to {max(slower):.1f} times as fast as SIFT.",
        )
    )
    return tuple(said)
