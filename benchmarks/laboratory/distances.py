"""L2 against Hamming: what comparing bits saves, and what comparing them in the wrong way costs."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

import scenes
from panostitch.features import opencv
from panostitch.matching import brute_force
from panostitch.matching.ratio import believable
from panostitch.options import MatchingOptions
from report import Claim, Finding, Plot, Report, Series, Table, cells, percent

TITLE = "L2 against Hamming"
CLAIM = Claim(
    "Binary descriptors are compared by the Hamming distance, which is many times faster than the Euclidean distance "
    "of floats; to compare them by L2 is a mistake.",
    "Calonder et al. 2010 (BRIEF); Rublee et al. 2011 (ORB)",
)
REPEATS = 3
RIGHT = 4.0  # px
MANY = 3.0  # times: what may be called many times faster
SAME = 0.01  # of the right matches
METHOD = (
    "Time: two nearest neighbours of SIFT (128 floats) and ORB (256 bits) descriptors of a picture and a reduced "
    "copy of it by OpenCV's BFMatcher, and by the program's matrix product, which takes bits for rows of +1 and -1; "
    "by the time of BFMatcher with L2. Right matches: ORB on pairs of photos of two computed scenes, kept by the "
    f"ratio test and mutually, judged by the true cameras to {RIGHT:g} px. `L2 of bytes` takes each byte of eight "
    "bits for a number, `L2 of bits` takes the bits for 256 numbers 0 and 1."
)


@dataclass(frozen=True)
class Settings:
    """Numbers of descriptors, width px of the picture that they are of; scenes, size px of photos, width of texture."""

    counts: tuple[int, ...] = (500, 1000, 2000, 4000, 8000)
    width: int = 3000
    key_points: int = 4000
    worlds: tuple[str, ...] = scenes.SCENES
    size: tuple[int, int] = (1200, 900)
    texture: int = scenes.FINE


FULL, TINY = Settings(), Settings((50, 100), 512, 200, ("shapes",), (160, 120), scenes.COARSE)
CHANGE = scenes.Change(yaw=15, roll=10, noise=4)
KINDS = {"SIFT, L2": (opencv.sift, cv2.NORM_L2), "ORB, Hamming": (opencv.orb, cv2.NORM_HAMMING)}


def experiment(settings: Settings = FULL) -> Report:
    """Times, then what each distance makes of bits."""
    pairs = [scenes.pair(scenes.scene(name, settings.texture), settings.size, CHANGE) for name in settings.worlds]
    times = over_counts(settings)
    counts = [count for count in settings.counts if count in times]
    labels = list(next(iter(times.values())))
    plot = Plot(
        "distances-time", "Time to match, by that of L2 with BFMatcher", "descriptors in each photo", "times as long",
        tuple(Series(label, counts, [times[count][label] for count in counts]) for label in labels), log_x=True,
        log_y=True,
    )  # fmt: skip
    rows = tuple((str(count), *cells(*times[count].values(), digits=3)) for count in counts)
    quality = {name: judged(pairs, settings.key_points, distance) for name, distance in DISTANCES.items()}
    tables = (
        Table("Times as long as BFMatcher with L2", ("descriptors", *labels), rows),
        Table(
            "ORB's bits by three distances",
            ("distance", "kept", "right", "share of right ones"),
            tuple(
                (name, str(kept), str(right), percent(right / max(kept, 1))) for name, (kept, right) in quality.items()
            ),
        ),
    )
    return Report(TITLE, CLAIM, METHOD, findings(times[counts[-1]], quality), tables, (plot,))


def over_counts(settings: Settings) -> dict[int, dict[str, float]]:
    """Times by that of BFMatcher with L2, for each number of descriptors."""
    sets = {
        label: [describe(grey, max(settings.counts)).descriptors for grey in scenes.detailed(settings.width)]
        for label, (describe, _) in KINDS.items()
    }
    fewest = min(len(some) for both in sets.values() for some in both)
    measured = {}
    for count in (count for count in settings.counts if count <= fewest):
        taken: dict[str, float] = {}
        for label, (_, norm) in KINDS.items():
            a, b = (np.ascontiguousarray(some[:count]) for some in sets[label])
            matcher = cv2.BFMatcher(norm)
            taken[f"{label}, BFMatcher"] = scenes.seconds(partial(matcher.knnMatch, a, b, k=2), REPEATS)
            taken[f"{label}, matrix product"] = scenes.seconds(partial(brute_force.nearest, a, b), REPEATS)
        unit = next(iter(taken.values()))
        measured[count] = {label: time / unit for label, time in taken.items()}
    return measured


def of_bytes(bits: NDArray[np.uint8]) -> NDArray[Any]:
    """Each byte as a number; of unit length, as the matrix product asks of floats."""
    return unit_length(bits.astype(np.float32))


def of_bits(bits: NDArray[np.uint8]) -> NDArray[Any]:
    """Each bit as a number, +1 or -1: L2 of these is twice that of 0 and 1."""
    return unit_length(brute_force.floats(bits))


def unit_length(rows: NDArray[np.float32]) -> NDArray[np.float32]:
    """Rows divided by their lengths."""
    return rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), np.float32(1e-6))


DISTANCES: dict[str, Callable[[NDArray[np.uint8]], NDArray[Any]]] = {
    "Hamming": lambda bits: bits,
    "L2 of bits": of_bits,
    "L2 of bytes": of_bytes,
}


def judged(
    pairs: list[list[scenes.View]], count: int, distance: Callable[[NDArray[np.uint8]], NDArray[Any]]
) -> tuple[int, int]:
    """How many matches are kept under a distance, and how many of them are right."""
    kept = right = 0
    for first, second in pairs:
        here, there = (opencv.orb(view.grey, count) for view in (first, second))
        a, b = (distance(np.asarray(one.descriptors, np.uint8)) for one in (here, there))
        chosen = believable(brute_force.nearest(a, b), MatchingOptions().ratio)
        off = np.linalg.norm(scenes.truly(first, second, here.xy[chosen[:, 0]]) - there.xy[chosen[:, 1]], axis=1)
        kept, right = kept + len(chosen), right + int((off <= RIGHT).sum())
    return kept, right


def findings(times: dict[str, float], quality: dict[str, tuple[int, int]]) -> tuple[Finding, ...]:
    """Speed by OpenCV, speed by the matrix product, and the mistake."""
    floats, product, hamming, signs = times.values()
    (_, right), (kept_bits, right_bits), (_, right_bytes) = quality.values()
    lost = 1 - right_bytes / max(right, 1)
    more = right_bits / max(right, 1) - 1
    return (
        Finding(
            "holds" if floats / hamming >= MANY else "does not hold",
            f"by OpenCV's BFMatcher, Hamming on 256 bits is {floats / hamming:.1f} times as quick as L2 on 128 floats.",
        ),
        Finding(
            "does not hold" if product < hamming else "holds",
            f"as one matrix product, L2 on 128 floats takes {product / hamming:.2f} times as long as Hamming by "
            f"BFMatcher, and Hamming {signs / hamming:.2f} times: it is the loop that is slow, not the distance.",
        ),
        Finding(
            "holds" if lost > SAME else "does not hold",
            f"L2 of bytes loses {percent(lost)} of the right matches.",
        ),
        Finding(
            "does not hold",
            "L2 of the bits themselves is no mistake: it is the square root of Hamming, so that the nearest stays "
            f"the nearest. The ratio test then means another ratio ({MatchingOptions().ratio:g} squared), and keeps "
            f"{kept_bits} matches with {right_bits} right ones ({more:+.0%}).",
        ),
    )
