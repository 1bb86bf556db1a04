"""Finished panoramas of known scenes beside the scene itself: ours, cv2.Stitcher's and Hugin's, of the same photos.

    python benchmarks/quality.py [--textures FOLDER] [--plans row,ring] [--output docs/reference/quality.md]

Every program makes an equirectangular picture. One rule finds the geometry of each: key points matched between the
picture and the scene give the turn, the scale and the place of the picture on the sphere, by robust least squares. Then
the scene is sampled at the picture's own pixels, and nothing of the picture is ever resampled.
"""

import argparse
import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from panostitch import pipeline
from panostitch.errors import PanostitchError
from panostitch.geometry import rotation
from panostitch.io.writers import assemble
from panostitch.jobs import selftest
from panostitch.jobs.contender import DONE, OURS, RIVAL, Task, run_apart
from panostitch.jobs.hugin import HUGIN, LENS, PLAIN, HuginError, is_installed, run_hugin
from panostitch.model.camera import Camera
from panostitch.model.photo import Photo
from panostitch.options import Options
from panostitch.runtime.executor import Executor
from panostitch.synthetic.scene import Scene, sphere_scene

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Picture = NDArray[np.uint8]

PROGRAMS = (OURS, RIVAL, HUGIN)
PLANS = ("row", "low_overlap", "two_rows")
SIZE = (800, 600)  # px of each photo
STEP = 0.3  # EV, up for one photo and down for the next
SCENE_WIDTH = 4096  # px of the scene that key points are sought in
MATCH_RATIO = 0.7
LEAST_MATCHES = 50
SAMPLES = 2  # per pixel and axis, where the scene is sampled
MARGIN = 8  # px of a photo, and of the picture, along the edge of what is judged
SPHERE_ASPECT = 2.0
HUGIN_TIMEOUT = 600  # s


@dataclass(frozen=True)
class Quality:
    """A picture beside the scene: dB on 0..255, structural similarity, gradient energy over the scene's."""

    psnr: float
    ssim: float
    sharpness: float
    pixels: int


def main() -> None:
    """Print the table, and write it if asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--textures", type=Path, help="folder of pictures to photograph; those twice as wide as high")
    parser.add_argument("--plans", default=",".join(PLANS), help="names of plans, with commas between")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--output", type=Path, help="Markdown file to write")
    given = parser.parse_args()
    text = header()
    print(text)
    for name, scene in scenes(given.textures):
        for plan in given.plans.split(","):
            for step in (0.0, STEP):
                line = in_words(name, plan, step, judged(plan, scene, step, Executor(given.threads)))
                print(line, flush=True)
                text += "\n" + line
    if given.output:
        given.output.write_text(text + "\n")


def scenes(folder: Path | None) -> list[tuple[str, Scene | None]]:
    """Spheres of the pictures in a folder; without one, the computed scene (None)."""
    found: list[tuple[str, Scene | None]] = []
    for path in sorted(folder.iterdir()) if folder else []:
        pixels = cv2.imread(str(path), cv2.IMREAD_COLOR_RGB)
        if pixels is not None and pixels.shape[1] / pixels.shape[0] == SPHERE_ASPECT:
            found.append((path.stem, sphere_scene(np.asarray(pixels, np.uint8))))
    return found or [("computed", None)]


def judged(plan: str, scene: Scene | None, step: float, run: Executor) -> dict[str, Quality | str]:
    """What each program made of a plan's photos, or why it failed."""
    conditions = selftest.Conditions(exposure_step=step, vignetting=0.0, noise=0.0, exif=True)
    cameras, photos = selftest.photograph(plan, conditions, scene=scene, size=SIZE, run=run)
    scene = scene or selftest.computed_scene(plan, cameras)
    results: dict[str, Quality | str] = {}
    for program in PROGRAMS:
        if program == HUGIN and not is_installed():
            results[program] = "not installed"
            continue
        try:
            made = [beside(scene, cameras, *picture) for picture in STITCH[program](photos, run)]
            results[program] = max(made, key=lambda quality: quality.psnr)
        except (PanostitchError, HuginError, ValueError) as error:
            results[program] = f"failed: {error}"
    return results


# ---- the programs: from photos to pictures (h, w, 3) and where they show something; of several the best one counts

Stitched = list[tuple[Picture, Booleans]]


def ours(photos: Sequence[Photo], run: Executor) -> Stitched:
    """As it comes, but equirectangular and not cropped."""
    options = Options.of(projection="equirectangular", crop="none")
    pixels, mask = assemble(pipeline.render(pipeline.align(photos, options, run=run), options, run=run), run=run)
    return [(pixels, np.asarray(mask, bool))]


def rival(photos: Sequence[Photo], run: Executor) -> Stitched:
    """cv2.Stitcher as it comes: its pictures are spherical, and black where they show nothing."""
    with tempfile.TemporaryDirectory(prefix="panostitch-quality-") as home:
        outcome = run_apart(Task(RIVAL, tuple(photos), Options(), run.threads), home)
        if outcome.status != DONE:
            raise ValueError(outcome.status)
        pixels = np.load(outcome.picture)
    return [(pixels, np.asarray(pixels.any(2)))]


def hugin(photos: Sequence[Photo], run: Executor) -> Stitched:
    """nona and enblend, as autooptimiser leaves the photos and with the lens optimised after that."""
    made = []
    with tempfile.TemporaryDirectory(prefix="panostitch-quality-") as folder:
        home = Path(folder)
        run_hugin(photos, home, threads=run.threads)
        for project in (PLAIN, LENS):
            for command in (
                ["pano_modify", "--projection=2", "--fov=AUTO", "--canvas=AUTO", "-o", "canvas.pto", project],
                ["nona", "-m", "TIFF_m", "-o", f"{project}-", "canvas.pto"],
            ):
                tool(command, home)
            layers = sorted(path.name for path in home.glob(f"{project}-*.tif"))
            tool(["enblend", "-o", f"{project}.tif", *layers], home)
            picture = cv2.imread(str(home / f"{project}.tif"), cv2.IMREAD_UNCHANGED)
            made.append((np.asarray(picture[..., 2::-1], np.uint8), np.asarray(picture[..., 3] > 254)))
    return made


def tool(command: Sequence[str], home: Path) -> None:
    """Run one of Hugin's tools. Raises HuginError where it fails."""
    done = subprocess.run(
        command, cwd=home, stdin=subprocess.DEVNULL, capture_output=True, timeout=HUGIN_TIMEOUT, check=False
    )
    if done.returncode:
        raise HuginError(f"{command[0]} failed with code {done.returncode}")


STITCH: dict[str, Callable[[Sequence[Photo], Executor], Stitched]] = {OURS: ours, RIVAL: rival, HUGIN: hugin}


# ---- the judge


def beside(scene: Scene, cameras: Sequence[Camera], pixels: Picture, mask: Booleans) -> Quality:
    """A finished picture beside the scene. Raises ValueError where too little of it is recognised."""
    parameters = geometry(scene, pixels)
    shown = cv2.erode(np.pad(mask, 1).astype(np.uint8), np.ones((2 * MARGIN + 1,) * 2, np.uint8))[1:-1, 1:-1] > 0
    shown &= photographed(cameras, rays(parameters, grid(mask.shape))).reshape(mask.shape)
    truth = sampled(scene, parameters, mask.shape)
    found = pixels.astype(np.float64)
    # how bright and of what tint the whole is, is a matter of taste
    found *= [np.median(truth[shown][:, c] / np.maximum(found[shown][:, c], 1)) for c in range(3)]
    error = ((found - truth)[shown] ** 2).mean()
    grey, true_grey = (
        cv2.cvtColor(a.astype(np.float32), cv2.COLOR_RGB2GRAY).astype(np.float64) for a in (found, truth)
    )
    return Quality(
        float(20 * np.log10(255 / np.sqrt(error))),
        float(similarity(grey, true_grey)[shown].mean()),
        float(energy(grey)[shown].sum() / energy(true_grey)[shown].sum()),
        int(shown.sum()),
    )


def geometry(scene: Scene, pixels: Picture) -> Floats:
    """Turn (rotation vector), scale (px per radian), place (x, y px) of an equirectangular picture of the scene."""
    height = SCENE_WIDTH // 2
    whole = cv2.resize(np.asarray(scene.texture, np.uint8), (SCENE_WIDTH, height), interpolation=cv2.INTER_AREA)
    scale = SCENE_WIDTH / (2 * np.pi)
    known = np.array([0, 0, 0, scale, (SCENE_WIDTH - 1) / 2, (height - 1) / 2])
    in_scene, theirs = matches(whole, pixels)
    true = rays(known, in_scene)

    def misfit(parameters: Floats) -> Floats:
        return np.asarray((rays(parameters, theirs) - true).ravel() * scale)

    middle = np.array(pixels.shape[1::-1]) / 2
    # a picture that shows as much as its photos is about as fine as they are
    starts = [np.array([0, 0, 0, s, *middle]) for s in (scale, 0.5 * scale, 2 * scale)]
    fits = []
    for start in starts:
        # with the turn that fits best at this scale
        start[:3] = rotation.log(rotation.nearest(true.T @ rays(start, theirs)))
        fits.append(least_squares(misfit, start, loss="soft_l1", x_scale=[1, 1, 1, scale, 100, 100]))
    return np.asarray(min(fits, key=lambda fit: fit.cost).x)


def matches(one: Picture, other: Picture) -> tuple[Floats, Floats]:
    """Points (n, 2) px of two pictures that show the same. Raises ValueError for too few."""
    sift = cv2.SIFT.create(8000)
    (a, one_says), (b, other_says) = (
        sift.detectAndCompute(cv2.cvtColor(p, cv2.COLOR_RGB2GRAY), None) for p in (one, other)
    )
    pairs = cv2.FlannBasedMatcher().knnMatch(other_says, one_says, k=2)
    good = [first for first, second in pairs if first.distance < MATCH_RATIO * second.distance]
    if len(good) < LEAST_MATCHES:
        raise ValueError(f"{len(good)} points of the picture are found in the scene")
    return np.array([a[m.trainIdx].pt for m in good]), np.array([b[m.queryIdx].pt for m in good])


def rays(parameters: Floats, xy: Floats) -> Floats:
    """Rays (n, 3) of the world at px (n, 2) of an equirectangular picture."""
    longitude, latitude = ((xy - parameters[4:6]) / parameters[3]).T
    ahead = np.cos(latitude)
    seen = np.column_stack([ahead * np.sin(longitude), np.sin(latitude), ahead * np.cos(longitude)])
    return np.asarray(seen @ rotation.exp(parameters[:3]).T)


def grid(shape: tuple[int, ...]) -> Floats:
    """All pixels (n, 2) of a picture (h, w)."""
    x, y = np.meshgrid(np.arange(shape[1]), np.arange(shape[0]))
    return np.column_stack([x.ravel(), y.ravel()]).astype(np.float64)


def sampled(scene: Scene, parameters: Floats, shape: tuple[int, ...]) -> Floats:
    """The scene (h, w, 3) as the picture ought to show it: the mean over each pixel, cubic in between."""
    texture = np.pad(scene.texture.astype(np.float32), ((0, 0), (8, 8), (0, 0)), mode="wrap")
    total = np.zeros((*shape, 3))
    offsets = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
    for across in offsets:
        for down in offsets:
            at = scene.coordinates(rays(parameters, grid(shape) + np.array([across, down]))).astype(np.float32)
            x, y = (at[:, k].reshape(shape) for k in (0, 1))
            total += cv2.remap(texture, x + 8, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return total / SAMPLES**2


def photographed(cameras: Sequence[Camera], directions: Floats) -> Booleans:
    """Which rays (n,) lie well inside a photo."""
    seen = np.zeros(len(directions), bool)
    for camera in cameras:
        xy = camera.project(directions)
        with np.errstate(invalid="ignore"):
            seen |= ((xy >= MARGIN) & (xy <= np.array(camera.size) - 1 - MARGIN)).all(1)
    return seen


def similarity(a: Floats, b: Floats) -> Floats:
    """Structural similarity (h, w) (Wang et al. 2004)."""

    def mean(c: Floats) -> Floats:
        return np.asarray(cv2.GaussianBlur(c, (11, 11), 1.5))

    one, other = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    variance = mean(a * a) - mean(a) ** 2 + mean(b * b) - mean(b) ** 2
    alike = (2 * mean(a) * mean(b) + one) * (2 * (mean(a * b) - mean(a) * mean(b)) + other)
    return np.asarray(alike / ((mean(a) ** 2 + mean(b) ** 2 + one) * (variance + other)))


def energy(grey: Floats) -> Floats:
    """Squares (h, w) of the gradient."""
    return np.asarray(cv2.Sobel(grey, cv2.CV_64F, 1, 0) ** 2 + cv2.Sobel(grey, cv2.CV_64F, 0, 1) ** 2)


# ---- words


def header() -> str:
    """What the table is, and its head."""
    return f"""# Quality

Finished panoramas beside the scene that was photographed: signal to noise in dB (peak 255), structural similarity, and
the sharpness that is left (energy of the gradient over the scene's). The photos are {SIZE[0]} x {SIZE[1]} px, without
noise, with their focal length in the metadata; "steps" is what the light goes up and down by from photo to photo. Each
picture is equirectangular and compared at its own pixels with the scene, sampled where key points matched to the scene
say that it lies; that is fitted by the same rule for every program (a turn, a scale, a place). One factor for each
channel makes the whole as bright as the scene. Of Hugin's two results, as it comes and with its lens optimised, the
better one counts; nona and enblend make its pictures.

Made by `python benchmarks/quality.py` with OpenCV {cv2.__version__}, NumPy {np.__version__}, Python
{platform.python_version()}.

| scene | plan | steps | {" | ".join(f"{name}: dB, similarity, sharpness" for name in PROGRAMS)} |
|---|---|---|{"---|" * len(PROGRAMS)}"""


def in_words(scene: str, plan: str, step: float, results: dict[str, Quality | str]) -> str:
    """A line of the table."""
    cells = [scene, plan, f"{2 * step:g} EV"]
    for result in results.values():
        told = isinstance(result, str)
        cells.append(result if told else f"{result.psnr:.1f}, {result.ssim:.3f}, {result.sharpness:.2f}")
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    sys.exit(main())
