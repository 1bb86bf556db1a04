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
Grey = NDArray[np.float32]
Map = Callable[[Floats], Floats]  # from pixels (n, 2) of the first photo to pixels of the second

HOMOGRAPHY, PLAIN, ELASTIC = "one homography", "--local-warp none", "--local-warp auto"
CONTESTANTS = (HOMOGRAPHY, RIVAL, PLAIN, ELASTIC)
DETECTION = FeatureOptions(work_megapixels=4.0, max_features=6000)
THRESHOLD = 3.0  # px, of MAGSAC
EPIPOLAR = 1.5  # px, of MAGSAC: how far a match may be off its epipolar line
HALF = 12  # px from the middle of a patch to its edge
REACH = 0.1  # of the photo's longer side, around a match, in which nothing else may look like it
ALIKE, CLEARLY = 0.7, 0.1  # correlation of the patches of a match, and how much less all others must have
SAME = 3.0  # px: nearer places are the same
TEXTURE = 2.0  # grey levels: a patch of less deviation shows nothing
PLACES = 12  # along a photo: by area, the matches of each place count as much as those of any other
EACH = 3  # of so many matches one is held back
STEP = 4  # px between exact coordinates when a photo is resampled
WINDOW = 7  # px, of SSIM
PROTOCOL = f"""Key points of the full photos (SIFT, at most {DETECTION.max_features}) are matched by ratio test
and mutually. One in {EACH} is held back, and all contestants are judged by those of them that are true: the distance,
in pixels of the second photo, from where the cameras (or the homography) send the point of the first photo to where it
was matched. `{HOMOGRAPHY}` is MAGSAC++ and robust least squares on the other matches. panostitch and cv2.Stitcher get
nothing but the two photos; of cv2.Stitcher the cameras are taken that it gives back (`cameras()`), which is all its
geometry: it has no local warp. The meshes of panostitch are fitted to patches of its own choice, which may lie where a
match is held back.

No contestant has a say in which matches are true. Those are that lie within {EPIPOLAR:g} px of their epipolar line, as
in any scene that stands still, and that nothing in the neighbourhood can be mistaken for: patches of {2 * HALF + 1} px
have a correlation of at least {ALIKE:g}, and all other places within {REACH:.0%} of the photo's length have
{CLEARLY:g} less, looked for in either photo. That leaves out rows of like windows, and keeps what is near: matches may
go tens of pixels another way than those of what is far, and no warp without a tear brings both together.

Most matches lie on walls, few on the ground, which may fill half of the picture. By area: the root mean square in which
all squares of a {PLACES}th of the first photo's length count alike that hold a match.

PSNR and SSIM: the second photo is resampled into the first one and compared there, after a gain for each channel, over
the pixels that all contestants of the set put into both photos, and nowhere else. A dash: no result. One row of means
is over all sets, the other over those in which every contestant has a result. The means are those of a few sets with
much parallax; the last row gives all sets the same weight."""


@dataclass(frozen=True)
class Scores:
    """Of one contestant: errors px of the held-back matches, and how alike the photos are where they overlap."""

    rms: float
    median: float
    area: float
    psnr: float
    ssim: float


def main() -> int:
    """Judge the pairs that the command line names; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path, help="each holds two photos")
    parser.add_argument("--output", type=Path, help="a Markdown page to write, set by set")
    given = parser.parse_args()
    results: dict[str, tuple[int, dict[str, Scores]]] = {}
    for folder in given.folders:
        photos, _ = open_photos(sorted(p for p in folder.iterdir() if p.suffix.lower() in EXTENSIONS))
        if len(photos) != 2:
            parser.error(f"{folder} holds {len(photos)} photos, not two")
        results[folder.name] = judge(photos)
        if given.output:
            given.output.write_text(page(results))  # what is done so far
        print(folder.name, *(f"{name} {scores}" for name, scores in results[folder.name][1].items()), flush=True)
    print(page(results))
    return 0


def judge(photos: list[Photo]) -> tuple[int, dict[str, Scores]]:
    """How many matches judge, and the scores of the contestants that have a result."""
    xy_i, xy_j = matches(photos)
    aside = np.arange(len(xy_i)) % EACH == 0
    maps = contestants(photos, xy_i[~aside], xy_j[~aside])
    sound = aside & true_matches(photos, xy_i, xy_j)
    errors = {name: np.linalg.norm(send(xy_i[sound]) - xy_j[sound], axis=1) for name, send in maps.items()}
    alike = likeness(photos, maps)
    share = by_area(xy_i[sound], max(photos[0].size) / PLACES)
    return int(sound.sum()), {
        name: Scores(float(np.sqrt((e**2).mean())), float(np.median(e)), float(np.sqrt(share @ e**2)), *alike[name])
        for name, e in errors.items()
    }


def by_area(xy: Floats, side: float) -> Floats:
    """The weight (n,) of each point (n, 2) px, in sum 1, by which all squares of this side count alike."""
    _, square, count = np.unique(np.floor((xy + 0.5) / side), axis=0, return_inverse=True, return_counts=True)
    return np.asarray(1 / count[square.ravel()] / len(count), np.float64)


def matches(photos: list[Photo]) -> tuple[Floats, Floats]:
    """Matches (n, 2) px in either photo, from left to right."""
    found = [f for f in detect(photos, DETECTION) if isinstance(f, Features)]
    (putative,) = match(found, [(0, 1)], MatchingOptions())
    xy_i, xy_j = (f.xy[putative.pairs[:, n]].astype(np.float64) for n, f in enumerate(found))
    order = np.lexsort(xy_i.T)
    return xy_i[order], xy_j[order]


def true_matches(photos: list[Photo], xy_i: Floats, xy_j: Floats) -> Booleans:
    """Which matches (n,) two views of a scene can have, and nothing near can be mistaken for."""
    first, second = (cv2.cvtColor(photo.source.read()[0], cv2.COLOR_RGB2GRAY).astype(np.float32) for photo in photos)
    _, kept = cv2.findFundamentalMat(xy_i, xy_j, cv2.USAC_MAGSAC, EPIPOLAR, 0.999, 10_000)
    found = kept.ravel() > 0
    for one, other, here, there in ((first, second, xy_i, xy_j), (second, first, xy_j, xy_i)):
        found[found] = [unmistakable(one, other, *pair) for pair in zip(here[found], there[found], strict=True)]
    return np.asarray(found)


def unmistakable(one: Grey, other: Grey, here: Floats, there: Floats) -> bool:
    """Whether the patch of a picture (h, w) at px `here` is seen in another one at px `there`, and nowhere near."""
    patch = cv2.getRectSubPix(one, (2 * HALF + 1, 2 * HALF + 1), tuple(map(float, here)))
    reach = HALF + int(REACH * max(other.shape))
    column, row = np.rint(there).astype(int)
    left, top = max(0, column - reach), max(0, row - reach)
    around = other[top : row + reach + 1, left : column + reach + 1]
    if patch.std() < TEXTURE or min(around.shape) < 2 * HALF + 1:
        return False
    alike = cv2.matchTemplate(around, patch, cv2.TM_CCOEFF_NORMED)
    y, x = np.indices(alike.shape)
    away = np.hypot(x - (column - left - HALF), y - (row - top - HALF))
    most = alike[away <= SAME].max(initial=-1.0)
    return bool(most >= ALIKE and most >= alike[away > HALF].max(initial=-1.0) + CLEARLY)


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
        (
            "Held-back matches: root mean square / median / root mean square by area, px",
            (("rms", "{:.2f}"), ("median", "{:.2f}"), ("area", "{:.2f}")),
        ),
        ("Overlap: PSNR, dB / SSIM", (("psnr", "{:.2f}"), ("ssim", "{:.3f}"))),
    ):
        lines += ["", f"## {title}", "", f"| set | matches | {' | '.join(CONTESTANTS)} |", f"|---|---|{'---|' * 4}"]
        rows = [(name, str(count), scores) for name, (count, scores) in results.items()]
        rows += [(f"mean of {len(some)}", "", means(some)) for some in (every, full) if some]
        if kinds[0][0] == "rms":
            rows.append((f"times that of {HOMOGRAPHY}, geometric mean", "", ratios(every)))
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


def ratios(sets: list[dict[str, Scores]]) -> dict[str, Scores]:
    """What each contestant's scores are of the homography's, in the sets in which both have one: no set outweighs."""
    found = {}
    for who in CONTESTANTS:
        both = [(vars(scores[who]), vars(scores[HOMOGRAPHY])) for scores in sets if {who, HOMOGRAPHY} <= scores.keys()]
        if both:
            shares = [np.log(np.divide(list(one.values()), list(other.values()))) for one, other in both]
            found[who] = Scores(*np.exp(np.mean(shares, axis=0)))
    return found


def cell(scores: Scores | None, kinds: tuple[tuple[str, str], ...]) -> str:
    """Two figures, or a dash."""
    return " / ".join(form.format(getattr(scores, kind)) for kind, form in kinds) if scores else "-"


if __name__ == "__main__":
    sys.exit(main())
