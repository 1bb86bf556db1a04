"""How much the elastic meshes repair where the camera moved: pairs of photos, with and without them, beside others.

    python benchmarks/parallax.py FOLDER ... [--output docs/reference/parallax.md]

Each FOLDER holds two photos. The protocol stands on the page that is written: see PROTOCOL.
"""

import argparse
import platform
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from skimage.metrics import structural_similarity

from panostitch import pipeline
from panostitch.errors import PanostitchError
from panostitch.features import detect
from panostitch.geometry import homography
from panostitch.io.readers import EXTENSIONS, open_photos
from panostitch.jobs.contender import RIVAL, Task, run_apart
from panostitch.matching import match
from panostitch.model.camera import Camera
from panostitch.model.features import Features
from panostitch.model.photo import Photo
from panostitch.options import FeatureOptions, MatchingOptions, Options

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Map = Callable[[Floats], Floats]  # from pixels (n, 2) of the first photo to pixels of the second

HOMOGRAPHY, PLAIN, ELASTIC = "one homography", "--local-warp none", "--local-warp auto"
CONTESTANTS = (HOMOGRAPHY, RIVAL, PLAIN, ELASTIC)
DETECTION = FeatureOptions(work_megapixels=4.0, max_features=6000)
THRESHOLD = 3.0  # px, of MAGSAC
NEIGHBOURS = 8
ODD = 0.003  # of the photo's longer side: a match that is further off its neighbours' median is taken for wrong
EACH = 3  # of so many matches one is held back
STEP = 4  # px between exact coordinates when a photo is resampled
WINDOW = 7  # px, of SSIM
PROTOCOL = f"""Key points of the full photos (SIFT, at most {DETECTION.max_features}) are matched by ratio test
and mutually. A match that goes more than {100 * ODD:g} % of the photo's length another way than the median of its
{NEIGHBOURS} neighbours is taken for wrong. One in {EACH} is held back, and all are judged by these: the distance, in
pixels of the second photo, from where the cameras (or the homography) send the point of the first photo to where it was
matched. `{HOMOGRAPHY}` is MAGSAC++ and robust least squares on the other matches. panostitch and cv2.Stitcher get
nothing but the two photos; of cv2.Stitcher the cameras are taken that it gives back (`cameras()`), which is all its
geometry: it has no local warp. The meshes of panostitch are fitted to patches of its own choice, which may lie where a
match is held back.

The filter favours whatever is smooth, and lets wrong matches pass that come in groups, as on rows of like posts: where
the root mean square is many times the median, it speaks of these, in all columns alike.

PSNR and SSIM: the second photo is resampled into the first one and compared there, after a gain for each channel, over
the pixels that all contestants of the set put into both photos, and nowhere else. A dash: no result. One row of means
is over all sets, the other over those in which every contestant has a result."""


@dataclass(frozen=True)
class Scores:
    """Of one contestant: errors px of the held-back matches, and how alike the photos are where they overlap."""

    rms: float
    median: float
    psnr: float
    ssim: float


def main() -> int:
    """Judge the pairs that the command line names; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path, help="each holds two photos")
    parser.add_argument("--output", type=Path, help="a Markdown page to write")
    given = parser.parse_args()
    results: dict[str, tuple[int, dict[str, Scores]]] = {}
    for folder in given.folders:
        photos, _ = open_photos(sorted(p for p in folder.iterdir() if p.suffix.lower() in EXTENSIONS))
        if len(photos) != 2:
            parser.error(f"{folder} holds {len(photos)} photos, not two")
        results[folder.name] = judge(photos)
        print(folder.name, *(f"{name} {scores}" for name, scores in results[folder.name][1].items()), flush=True)
    text = page(results)
    print(text)
    if given.output:
        given.output.write_text(text)
    return 0


def judge(photos: list[Photo]) -> tuple[int, dict[str, Scores]]:
    """How many matches judge, and the scores of the contestants that have a result."""
    xy_i, xy_j = matches(photos)
    aside = np.arange(len(xy_i)) % EACH == 0
    maps = contestants(photos, xy_i[~aside], xy_j[~aside])
    if HOMOGRAPHY not in maps:
        return 0, {}
    sound = aside & agreeing(maps[HOMOGRAPHY](xy_i) - xy_j, xy_i, max(photos[1].size))
    errors = {name: np.linalg.norm(send(xy_i[sound]) - xy_j[sound], axis=1) for name, send in maps.items()}
    alike = likeness(photos, maps)
    return int(sound.sum()), {
        name: Scores(float(np.sqrt((e**2).mean())), float(np.median(e)), *alike[name]) for name, e in errors.items()
    }


def matches(photos: list[Photo]) -> tuple[Floats, Floats]:
    """Matches (n, 2) px in either photo, from left to right."""
    found = [f for f in detect(photos, DETECTION) if isinstance(f, Features)]
    (putative,) = match(found, [(0, 1)], MatchingOptions())
    xy_i, xy_j = (f.xy[putative.pairs[:, n]].astype(np.float64) for n, f in enumerate(found))
    order = np.lexsort(xy_i.T)
    return xy_i[order], xy_j[order]


def agreeing(off: Floats, xy: Floats, length: int) -> Booleans:
    """Which matches (n,) go the way of their neighbours: the nearest of those that do."""
    kept = np.asarray(np.linalg.norm(np.nan_to_num(off, nan=1e6), axis=1) < 0.1 * length)
    for _ in range(3):  # what is wrong spoils its neighbours' median, so what is left is looked at again
        index = np.flatnonzero(kept)
        _, near = cKDTree(xy[index]).query(xy[index], k=NEIGHBOURS + 1)
        usual = np.median(off[index][near[:, 1:]], axis=1)
        kept[index] = np.linalg.norm(off[index] - usual, axis=1) <= ODD * length
    return kept


def contestants(photos: list[Photo], xy_i: Floats, xy_j: Floats) -> dict[str, Map]:
    """Those that have a result; the matches (n, 2) are for the homography."""
    maps: dict[str, Map] = {}
    found = homography.estimate(xy_i, xy_j, threshold=THRESHOLD, seed=0)
    if found:
        maps[HOMOGRAPHY] = lambda xy: homography.apply(found[0], xy)
    with tempfile.TemporaryDirectory(prefix="panostitch-parallax-") as home:
        cameras = run_apart(Task(RIVAL, tuple(photos), Options()), home).cameras
    if len(cameras) == 2 and cameras[0] and cameras[1]:
        maps[RIVAL] = sending(cameras[0], cameras[1])
    for name, choice in ((PLAIN, "none"), (ELASTIC, "auto")):
        try:
            alignment = pipeline.align(photos, Options.of(local_warp=choice))
        except PanostitchError:
            continue
        place = {photo.name: camera for photo, camera in zip(alignment.photos, alignment.cameras, strict=True)}
        maps[name] = sending(*(place[photo.name] for photo in photos))
    return maps


def sending(first: Camera, second: Camera) -> Map:
    """From pixels of one camera to pixels of another."""
    return lambda xy: second.project(first.rays(xy))


def likeness(photos: list[Photo], maps: dict[str, Map]) -> dict[str, tuple[float, float]]:
    """PSNR (dB) and SSIM of each contestant, over the overlap that all have."""
    first, second = (photo.source.read()[0].astype(np.float32) for photo in photos)
    places = {name: coordinates(send, photos[0].size) for name, send in maps.items()}
    size = np.array(photos[1].size)
    common = np.all([((xy >= 0) & (xy <= size - 1)).all(2) for xy in places.values()], axis=0)
    inner = cv2.erode(common.astype(np.uint8), np.ones((WINDOW, WINDOW), np.uint8), borderValue=0) > 0
    found = {}
    for name, xy in places.items():
        seen = cv2.remap(second, xy[..., 0], xy[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        seen = np.clip(seen * (first[common].mean(0) / seen[common].mean(0)), 0, 255)
        square = float(((seen - first)[common] ** 2).mean())
        _, ssim = structural_similarity(first, seen, win_size=WINDOW, data_range=255, channel_axis=2, full=True)
        found[name] = 10 * float(np.log10(255**2 / square)), float(ssim[inner].mean())
    return found


def coordinates(send: Map, size: tuple[int, int]) -> NDArray[np.float32]:
    """Where (h, w, 2) px in the second photo each pixel of the first is; exact at every STEP-th, else bilinear."""
    columns, rows = (-(-n // STEP) for n in size)
    x, y = np.meshgrid(np.arange(columns) * STEP + (STEP - 1) / 2, np.arange(rows) * STEP + (STEP - 1) / 2)
    sent = np.nan_to_num(send(np.column_stack([x.ravel(), y.ravel()])), nan=-1e4).reshape(rows, columns, 2)
    large = cv2.resize(sent.astype(np.float32), (columns * STEP, rows * STEP))
    return np.ascontiguousarray(large[: size[1], : size[0]])


def page(results: dict[str, tuple[int, dict[str, Scores]]]) -> str:
    """The page with both tables."""
    lines = ["# Parallax", "", f"{len(results)} pairs of photos between which the camera moved.", "", PROTOCOL, ""]
    lines += [
        f"Made by `python benchmarks/parallax.py` with OpenCV {cv2.__version__}, NumPy {np.__version__}, Python",
        f"{platform.python_version()}.",
    ]
    every = [scores for _, scores in results.values()]
    full = [scores for scores in every if len(scores) == len(CONTESTANTS)]
    for title, kinds in (
        ("Held-back matches: root mean square / median, px", (("rms", "{:.2f}"), ("median", "{:.2f}"))),
        ("Overlap: PSNR, dB / SSIM", (("psnr", "{:.2f}"), ("ssim", "{:.3f}"))),
    ):
        lines += ["", f"## {title}", "", f"| set | matches | {' | '.join(CONTESTANTS)} |", f"|---|---|{'---|' * 4}"]
        rows = [(name, str(count), scores) for name, (count, scores) in results.items()]
        rows += [(f"mean of {len(some)}", "", means(some)) for some in (every, full) if some]
        for name, count, scores in rows:
            cells = [cell(scores.get(who), kinds) for who in CONTESTANTS]
            lines.append(f"| {name} | {count} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def means(sets: list[dict[str, Scores]]) -> dict[str, Scores]:
    """The mean scores of each contestant that has a result in all of these sets."""
    return {
        who: Scores(*np.mean([list(vars(scores[who]).values()) for scores in sets], axis=0))
        for who in CONTESTANTS
        if all(who in scores for scores in sets)
    }


def cell(scores: Scores | None, kinds: tuple[tuple[str, str], ...]) -> str:
    """Two figures, or a dash."""
    return " / ".join(form.format(getattr(scores, kind)) for kind, form in kinds) if scores else "-"


if __name__ == "__main__":
    sys.exit(main())
