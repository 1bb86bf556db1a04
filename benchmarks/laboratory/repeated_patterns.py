"""Repeated patterns: what matching makes of a facade whose windows repeat themselves."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.debug import draw, ink
from panostitch.features import detect
from panostitch.matching import MATCHERS, drop_contradictions, link_photos
from panostitch.matching.neighbours import Neighbours
from panostitch.matching.ratio import believable
from panostitch.model.camera import Camera
from panostitch.model.features import Features
from panostitch.model.match import Link, VerifiedMatch
from panostitch.model.photo import Photo
from panostitch.options import Options
from panostitch.synthetic.render import photograph_plan
from panostitch.synthetic.rig import view_of_plane
from panostitch.synthetic.scene import plane_scene
from panostitch.synthetic.score import pair_errors
from report import Claim, Finding, Plot, Report, Series, Table, percent

TITLE = "Repeated patterns"
CLAIM = Claim(
    "On repeated patterns the second nearest neighbour is as near as the nearest, so that the ratio test removes the "
    "ambiguous matches; RANSAC removes what wrong ones are left.",
    "Lowe 2004; Szeliski 2022, section 7.1.3",
)
COLUMNS, ROWS = 12, 6  # of windows
RIGHT = 4.0  # px: as far as a true match may be off,
RIGHT_LINK = 5.0  # px, and the median point of a link
NOISE = 2.0  # grey levels
GRAIN = 6.0  # grey levels, before it is smoothed
NEARLY_ALL, HALF = 0.9, 0.5
METHOD = (
    f"A flat facade of {COLUMNS} x {ROWS} windows on plaster with a faint grain. Every window has something of its "
    "own in it, but after some columns, the period, the same windows come again: with a period of 1 all windows of a "
    f"row are alike, with one of {COLUMNS} none. Five photos, each of 4.8 columns and taken 1.5 columns on. SIFT; key "
    f"points matched between neighbours are right within {RIGHT:g} px of the truth. Links are what verification makes "
    f"of all ten pairs, right if their homography is within {RIGHT_LINK:g} px of the true one in the median; the one "
    "pair that shares nothing can only be linked wrongly. `cycles` is the program's step that drops links which "
    "contradict the cycles that they lie on. Three facades for each period, all together."
)


@dataclass(frozen=True)
class Settings:
    """Periods, in columns; px of a window of the texture; size px of the photos; number of facades."""

    periods: tuple[int, ...] = (1, 2, 3, 4, 6, 12)
    window: int = 240
    size: tuple[int, int] = (960, 720)
    facades: int = 3


FULL, TINY = Settings(), Settings((1, 12), 40, (160, 120), 1)
PHOTOS = 5
STEP = 0.25  # half widths of the facade
SHOWN = 1  # number of the period that the picture shows


@dataclass(frozen=True)
class Outcome:
    """Counts over all facades of one period.

    raw, ratio, mutual, both: matches kept, and right ones among them
    verified, cycles:         links, and right ones among them
    """

    raw: tuple[int, int]
    ratio: tuple[int, int]
    mutual: tuple[int, int]
    both: tuple[int, int]
    verified: tuple[int, int]
    cycles: tuple[int, int]

    def __add__(self, other: "Outcome") -> "Outcome":
        return Outcome(
            *((a + c, b + d) for (a, b), (c, d) in zip(vars(self).values(), vars(other).values(), strict=True))
        )


def experiment(settings: Settings = FULL) -> Report:
    """All periods; the picture is of the first facade of one of them."""
    found: dict[int, Outcome] = {}
    for period in settings.periods:
        for seed in range(settings.facades):
            one = outcome(*photographed(period, seed, settings))
            found[period] = found[period] + one if period in found else one
    plot = Plot(
        "repeated-patterns", "Right ones among what is kept", "columns of windows until they repeat", "right, %",
        tuple(
            Series(label, settings.periods, [100 * right_share(vars(one)[name]) for one in found.values()])
            for name, label in (
                ("raw", "nearest neighbours"), ("ratio", "ratio test"), ("both", "ratio test and mutual"),
                ("verified", "links after RANSAC"), ("cycles", "links after cycles"),
            )
        ),
    )  # fmt: skip
    names = list(vars(next(iter(found.values()))))
    rows = [
        (str(period), *(f"{kept} / {percent(right_share((kept, right)))}" for kept, right in vars(one).values()))
        for period, one in found.items()
    ]
    table = Table("Kept / right ones among them", ("period", *names), tuple(rows))
    picture = {"repeated-patterns-matches": shown(settings)}
    return Report(TITLE, CLAIM, METHOD, findings(found), (table,), (plot,), picture)


def right_share(counts: tuple[int, int]) -> float:
    """Share of right ones; NaN of nothing."""
    kept, right = counts
    return right / kept if kept else float("nan")


def photographed(period: int, seed: int, settings: Settings) -> tuple[list[Photo], list[Camera]]:
    """Photos of a facade and their cameras."""
    dice = np.random.default_rng(seed)
    width, distance = settings.size[0], 1.0
    focal = width * distance / 0.8
    cameras = [
        view_of_plane(
            settings.size,
            focal=focal,
            at=((n - (PHOTOS - 1) / 2) * STEP, dice.uniform(-0.05, 0.05), -distance),
            turn=tuple(np.deg2rad(dice.uniform(-3, 3, 3))),
        )
        for n in range(PHOTOS)
    ]
    scene = plane_scene(facade(period, settings.window, dice))
    return photograph_plan(scene, cameras, noise=NOISE, rng=dice), cameras


def facade(period: int, side: int, dice: np.random.Generator) -> NDArray[np.uint8]:
    """A wall (h, w, 3) of furnished windows that come again after so many columns."""
    strip = np.tile(window(side), (ROWS, period, 1))
    for row in range(ROWS):
        for column in range(period):
            furnish(strip[row * side : (row + 1) * side, column * side : (column + 1) * side], dice)
    wall = np.tile(strip, (1, COLUMNS // period, 1))
    plaster = cv2.GaussianBlur(dice.normal(0, GRAIN, wall.shape[:2]), (0, 0), 1.5)[..., None]
    return np.clip(np.rint(wall + plaster), 0, 255).astype(np.uint8)


def window(side: int) -> NDArray[np.uint8]:
    """Plaster (side, side, 3) with a window: frame, six panes, sill."""
    tile = np.full((side, side, 3), (196, 178, 150), np.uint8)

    def box(x0: float, y0: float, x1: float, y1: float, colour: tuple[int, int, int]) -> None:
        tile[round(y0 * side) : round(y1 * side), round(x0 * side) : round(x1 * side)] = colour

    box(0.25, 0.15, 0.75, 0.8, (236, 232, 224))
    for column in range(2):
        for row in range(3):
            x, y = 0.29 + 0.22 * column, 0.19 + 0.2 * row
            box(x, y, x + 0.2, y + 0.17, (52 + 14 * row, 66 + 12 * row, 84 + 10 * column))
    box(0.2, 0.8, 0.8, 0.85, (120, 112, 104))
    return tile


def furnish(pane: NDArray[np.uint8], dice: np.random.Generator) -> None:
    """Curtains, flowers, people: shapes in the window, no two the same."""
    side = pane.shape[0]
    for _ in range(14):
        x, y = (int(v) for v in dice.uniform((0.3, 0.2), (0.7, 0.75)) * side)
        colour = [int(v) for v in dice.integers(20, 250, 3)]
        cv2.circle(pane, (x, y), max(1, int(dice.uniform(0.01, 0.06) * side)), colour, -1, cv2.LINE_AA)


def outcome(photos: list[Photo], cameras: list[Camera]) -> Outcome:
    """What matching makes of one facade."""
    options = Options()
    features = [one for one in detect(photos, options.features) if isinstance(one, Features)]
    counts = np.zeros((4, 2), int)
    for i, j in zip(range(PHOTOS - 1), range(1, PHOTOS), strict=True):
        neighbours = MATCHERS["brute"](features[i].descriptors, features[j].descriptors, seed=0)
        good = right(cameras[i], cameras[j], features[i], features[j], neighbours)
        ratio = neighbours.best < options.matching.ratio * neighbours.second
        every = np.ones(len(good), bool)
        for n, kept in enumerate((every, ratio, neighbours.mutual, ratio & neighbours.mutual)):
            counts[n] += kept.sum(), (kept & good).sum()
    links = link_photos(photos, features, options.matching)
    verified, cycles = (judged(some, cameras) for some in (links, drop_contradictions(photos, links)))
    raw, ratio_test, mutual, both = ((int(kept), int(good)) for kept, good in counts)
    return Outcome(raw, ratio_test, mutual, both, verified, cycles)


def right(first: Camera, second: Camera, here: Features, there: Features, neighbours: Neighbours) -> NDArray[np.bool_]:
    """Which nearest neighbours (n,) are where the cameras see the point."""
    off = np.linalg.norm(second.project(first.rays(here.xy)) - there.xy[neighbours.index], axis=1)
    return np.asarray(off <= RIGHT)


def judged(links: list[Link], cameras: list[Camera]) -> tuple[int, int]:
    """Number of links, and of right ones."""
    good = [is_right(link, cameras) for link in links if isinstance(link, VerifiedMatch)]
    return len(good), sum(good)


def is_right(link: VerifiedMatch, cameras: list[Camera]) -> bool:
    """Whether a homography is the true one."""
    here, there = cameras[link.i], cameras[link.j]
    found = Camera(here.size, 1.0, (0.0, 0.0), np.eye(3)), Camera(there.size, 1.0, (0.0, 0.0), link.j_from_i)
    errors = pair_errors((here, there), found)
    return bool(len(errors) and np.median(errors) <= RIGHT_LINK)


def shown(settings: Settings) -> tuple[str, NDArray[np.uint8]]:
    """Two photos of a facade with what passes both tests, in green and red, and what it says below."""
    period = settings.periods[SHOWN]
    photos, cameras = photographed(period, 0, settings)
    (first, second), (here, there) = (
        photos[:2],
        (one for one in detect(photos[:2], Options().features) if isinstance(one, Features)),
    )
    neighbours = MATCHERS["brute"](here.descriptors, there.descriptors, seed=0)
    good = right(cameras[0], cameras[1], here, there, neighbours)
    chosen = believable(neighbours, Options().matching.ratio)[:, 0]
    groups = [
        draw.Lines(here.xy[some].astype(float), there.xy[neighbours.index[some]].astype(float), colour)
        for some, colour in ((chosen[~good[chosen]], ink.VERMILLION), (chosen[good[chosen]], ink.GREEN))
    ]
    drawn = draw.matches(first.source.read()[0], second.source.read()[0], groups)
    caption = (
        f"A facade that repeats itself after {period} columns: {int(good[chosen].sum())} right matches (green) and "
        f"{int((~good[chosen]).sum())} wrong ones (red) pass the ratio test and are mutual, of {len(here)} key points."
    )
    return caption, ink.to_bytes(ink.fit(drawn, 800))


def findings(found: dict[int, Outcome]) -> tuple[Finding, ...]:
    """What each step leaves, over all facades that have repeated windows."""
    repeated = [one for period, one in found.items() if period < COLUMNS]
    total = repeated[0]
    for one in repeated[1:]:
        total += one
    (raw, good), (kept, kept_good) = total.raw, total.ratio
    gone, lost = 1 - (kept - kept_good) / (raw - good), 1 - kept_good / good
    wrong = [many - right for many, right in (total.verified, total.cycles)]
    rights = [right for _, right in (total.verified, total.cycles)]
    return (
        Finding(
            "holds" if gone >= NEARLY_ALL else "does not hold",
            f"the ratio test removes {percent(gone)} of the wrong matches, and {percent(lost)} of the right ones with "
            "them: of many like windows one is the nearest by chance, and often clearly so.",
        ),
        Finding(
            "holds" if right_share(total.both) >= NEARLY_ALL else "does not hold",
            f"of what passes the ratio test and is mutual {percent(right_share(total.both))} is right.",
        ),
        Finding(
            "holds" if not wrong[0] else "does not hold",
            f"after RANSAC {wrong[0]} of {total.verified[0]} links are wrong: matches that are wrong by the same "
            "number of windows agree with each other.",
        ),
        Finding(
            "holds" if not wrong[1] else "holds in part" if wrong[1] < HALF * wrong[0] else "does not hold",
            f"that cycles tell wrong links from right ones (Zach et al. 2010): of {wrong[0]} wrong links {wrong[1]} "
            f"are left, and {rights[1]} of {rights[0]} right ones. Where a whole facade repeats itself wrong links "
            "agree with each other around cycles as well.",
        ),
    )
