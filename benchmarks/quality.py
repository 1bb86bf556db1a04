"""Finished panoramas of known scenes beside the scene itself: ours, cv2.Stitcher's and Hugin's, of the same photos.

    python benchmarks/quality.py [--textures FOLDER] [--plans row,ring] [--output docs/reference/quality.md]

The computed hall is photographed, and the spheres of the folder that are fine enough; once in even light, once in light
that changes from photo to photo. The programs are in `quality_programs`, the judge is in `quality_judge`.
"""

import argparse
import platform
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from panostitch.errors import PanostitchError
from panostitch.io.readers import EXTENSIONS, open_photos
from panostitch.jobs import selftest
from panostitch.jobs.hugin import HuginError, exif_of
from panostitch.jobs.selftest import Conditions
from panostitch.model.camera import Camera
from panostitch.model.photo import Photo
from panostitch.runtime.executor import Executor
from panostitch.synthetic.scene import Scene, gallery_texture, sphere_scene
from panostitch.synthetic.score import score
from quality_judge import Finished, Quality, compare, judge
from quality_programs import PROGRAMS, installed

PLANS = ("row", "two_rows", "ring")
SIZE = (640, 480)  # px of each photo
LIGHTS = {
    "even": Conditions(exposure_step=0.0, vignetting=0.0, noise=0.0, exif=True),
    "uneven": Conditions(exposure_step=0.3, vignetting=0.2, noise=0.0, exif=True),
}
WRONG = 20.0  # px, rms error of the cameras beyond which a program has failed
HALL = "hall"
HALL_WIDTH = 4096  # px
FINE_ENOUGH = 4000  # px, width of a sphere's picture that photos of this size do not enlarge
SPHERE_ASPECT = (1.99, 2.01)  # some are a few pixels short of 2 : 1
PHOTOS = "(the photos)"
JPEG = {"quality": 95, "subsampling": "4:2:2"}  # as good cameras write them


@dataclass(frozen=True)
class Row:
    """What each program made of the photos of a plan: its quality, or why there is none.

    photos: what the JPEG files have left of the photos, on average: nothing made of them can be much better
    """

    scene: str
    plan: str
    light: str
    photos: Quality
    results: dict[str, Quality | str]

    @property
    def made(self) -> dict[str, Quality]:
        """Of the programs that made a picture."""
        return {name: result for name, result in self.results.items() if isinstance(result, Quality)}


def main() -> None:
    """Print every row, and write the page if asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--textures", type=Path, help="folder of pictures to photograph; those twice as wide as high")
    parser.add_argument("--scenes", help="names of those to take, with commas between; by default all")
    parser.add_argument("--plans", default=",".join(PLANS), help="names of plans, with commas between")
    parser.add_argument("--programs", default=",".join(installed()), help="names, with commas between")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--keep", type=Path, help="folder for the pictures, turned as the programs leave them")
    parser.add_argument("--output", type=Path, help="Markdown file to write")
    given = parser.parse_args()
    run = Executor(given.threads)
    rows = []
    for name, scene in scenes(given.textures, given.scenes and given.scenes.split(",")):
        for plan in given.plans.split(","):
            for light in LIGHTS:
                keep = given.keep and given.keep / f"{name}-{plan}-{light}"
                rows.append(judged(name, scene, plan, light, given.programs.split(","), run, keep))
                print("\n".join(lines(rows[-1])), flush=True)
                if given.output:
                    given.output.write_text(page(rows))  # what is done so far


def scenes(folder: Path | None, names: Sequence[str] | None) -> Iterator[tuple[str, Scene]]:
    """The computed hall, and spheres of the pictures in a folder that are fine enough; of these, the ones named."""
    if not names or HALL in names:
        yield HALL, sphere_scene(gallery_texture(HALL_WIDTH))
    for path in sorted(folder.iterdir()) if folder else []:
        known = path.suffix.lower() in EXTENSIONS and (not names or path.stem in names)
        pixels = cv2.imread(str(path), cv2.IMREAD_COLOR_RGB) if known else None
        if pixels is None or pixels.shape[1] < FINE_ENOUGH:
            continue
        if SPHERE_ASPECT[0] <= pixels.shape[1] / pixels.shape[0] <= SPHERE_ASPECT[1]:
            even = 2 * (pixels.shape[1] // 2)
            whole = cv2.resize(pixels, (even, even // 2), interpolation=cv2.INTER_CUBIC)
            yield path.stem, sphere_scene(np.asarray(whole, np.uint8))


def judged(
    name: str, scene: Scene, plan: str, light: str, programs: Sequence[str], run: Executor, keep: Path | None
) -> Row:
    """What each program made of a plan's photos."""
    cameras, exposed = selftest.photograph(plan, LIGHTS[light], scene=scene, size=SIZE, run=run)
    pictures: dict[str, Finished] = {}
    failures: dict[str, str] = {}
    with tempfile.TemporaryDirectory(prefix="panostitch-quality-") as folder:
        photos = on_disk(exposed, Path(folder))
        left = what_is_left(exposed, photos)
        for program in programs:
            try:
                pictures[program] = right(PROGRAMS[program](photos, cameras, run), cameras)
            except (PanostitchError, HuginError, ValueError, subprocess.TimeoutExpired) as error:
                failures[program] = f"failed: {error}"
    qualities = judge(scene, cameras, pictures)
    if keep:
        keep.mkdir(parents=True, exist_ok=True)
        for program, picture in pictures.items():
            cv2.imwrite(str(keep / f"{program}.png"), picture.pixels[..., ::-1])
    results = {program: qualities.get(program) or failures[program] for program in programs}
    return Row(name, plan, light, left, results)


def right(picture: Finished, cameras: Sequence[Camera]) -> Finished:
    """The picture. Raises ValueError where its photos are in wrong places, so that there is nothing to compare."""
    error = score(cameras, picture.cameras).rms
    if error > WRONG:
        raise ValueError("photos in wrong places" + (f", {error:.0f} px off" if np.isfinite(error) else ""))
    return picture


def what_is_left(exposed: Sequence[Photo], photos: Sequence[Photo]) -> Quality:
    """The mean quality of JPEG files beside the photos that they were made of."""
    everywhere = np.ones(SIZE[::-1], bool)
    pairs = zip(photos, exposed, strict=True)
    each = [compare(found.source.read()[0], photo.source.read()[0], everywhere) for found, photo in pairs]
    psnr, ssim, sharpness = np.mean(each, axis=0)
    return Quality(float(psnr), float(ssim), float(sharpness), 0.0, len(photos), 1.0)


def on_disk(photos: Sequence[Photo], folder: Path) -> list[Photo]:
    """The photos as JPEG files, with what the metadata of a camera tell."""
    paths = [folder / f"{photo.name}.jpg" for photo in photos]
    for photo, path in zip(photos, paths, strict=True):
        Image.fromarray(photo.source.read()[0]).save(path, exif=exif_of(photo), **JPEG)
    found, failures = open_photos(paths)
    if failures:
        raise failures[0]
    return found


# ---- words


def page(rows: Sequence[Row]) -> str:
    """The page with the means and with every row."""
    uneven = LIGHTS["uneven"]
    return f"""# Quality

Finished panoramas beside the scene that was photographed: `{HALL}`, which is computed, so that anyone can do it again,
and spherical pictures of true places (`--textures`). The photos are {SIZE[0]} x {SIZE[1]} px, JPEG of quality
{JPEG["quality"]} ({JPEG["subsampling"]}) with their focal length in the metadata. In `uneven` light it goes up and down
by {2 * uneven.exposure_step:g} EV from photo to photo, and {uneven.vignetting:.0%} of it are lost in the corners; in
`even` light nothing of the kind.

All programs make equirectangular pictures, as large as their photos are in the middle. panostitch: `--projection
equirectangular --crop none`. cv2.Stitcher: as it comes. Hugin: cameras as on [the page of the true
errors](ground-truth.md), the better ones of those with and those without an optimised lens; `pano_modify --canvas=AUTO
--fov=AUTO` (its assistant would make the picture 0.7 times as large); `hugin_executor --stitching`, which calls nona
and enblend.

Where a picture lies on the sphere is what its program says of its canvas and its cameras. A turn and a scale of the
whole, with which its grey values differ least from the scene's, are then fitted, by one rule for all; what lies in a
wrong place within the picture stays there. The scene is rendered at the picture's own pixels, so that no picture is
resampled. Each channel gets the factor and the offset that suit it best, as the brightness of the whole is a matter of
taste. Compared is what all pictures show that have all photos in them (or the most of them), without a margin at the
edge; where a program has left photos out, its own picture is judged by as much of that as it shows. Photos more than
{WRONG:g} px from their places count as a failure. The tests of the benchmark show that the place of a perfect picture
is found again to two hundredths of a pixel, at 50 dB or more, and that a part in a wrong place is not excused.

Columns: PSNR in dB (peak 255); SSIM of grey values; sharpness, the energy of the gradient over the scene's, after the
picture has been made as bright as the scene around every pixel (a gradient grows with a gain, which is no sharpness and
counts in PSNR already); the true error of the cameras, rms, px; how many photos are in the panorama; its scale, px for
a px in the middle of a photo. `{PHOTOS}` are the JPEG files beside the photos that they were made of: what compression
alone costs, and adds to the gradient. Bold: best of its panorama, and what is no further from it than
{LEVEL["psnr"]:g} dB, {LEVEL["ssim"]:g} or {LEVEL["sharpness"]:g}; best in sharpness is what is nearest to that of the
photos.

In uneven light what is burnt in the brighter photos is lost there. panostitch shows it as bright as the photos do that
see the place and are not burnt, or else white.

Made by `python benchmarks/quality.py` with OpenCV {cv2.__version__}, NumPy {np.__version__}, Python
{platform.python_version()}.

## Means

Over the panoramas of which every program has a picture, and in how many of these it is best, or as good.

| light | program | panoramas | PSNR | best in | SSIM | best in | sharpness | best in |
|---|---|---|---|---|---|---|---|---|
{chr(10).join(means(rows))}

## All of them

| scene | plan | light | program | PSNR | SSIM | sharpness | cameras px | photos | scale |
|---|---|---|---|---|---|---|---|---|---|
{chr(10).join(line for row in rows for line in lines(row))}
"""


MEASURES = {"psnr": "{:.2f}", "ssim": "{:.4f}", "sharpness": "{:.3f}"}
# what differs by no more is as good: the noise of the files moves it
LEVEL = {"psnr": 0.05, "ssim": 0.0005, "sharpness": 0.005}


def best(row: Row, measure: str) -> list[str]:
    """The program that is best in a row, and others that are as good."""

    def merit(name: str) -> float:
        value, photos = (float(getattr(quality, measure)) for quality in (row.made[name], row.photos))
        return -abs(value - photos) if measure == "sharpness" else value

    most = max(map(merit, row.made), default=0.0)
    return [name for name in row.made if merit(name) >= most - LEVEL[measure]]


def means(rows: Sequence[Row]) -> list[str]:
    """Lines of the means of each light."""
    found = []
    for light in LIGHTS:
        full = [row for row in rows if row.light == light and len(row.made) == len(row.results)]
        some = {program: [row.made[program] for row in full] for program in (full[0].results if full else ())}
        for program, qualities in {PHOTOS: [row.photos for row in full], **some}.items():
            cells = [light, program, str(len(full))]
            for measure, form in MEASURES.items():
                mean = np.mean([getattr(quality, measure) for quality in qualities]) if full else np.nan
                wins = str(sum(program in best(row, measure) for row in full))
                cells += [form.format(mean), "-" if program == PHOTOS else wins]
            found.append(f"| {' | '.join(cells)} |")
    return found


def lines(row: Row) -> list[str]:
    """A line for the photos and for each program; the best figure of each kind is bold."""
    found = []
    for program, result in {PHOTOS: row.photos, **row.results}.items():
        cells = [row.scene, row.plan, row.light, program]
        if isinstance(result, str):
            cells += [result, *["-"] * 5]
        else:
            for measure, form in MEASURES.items():
                value = form.format(getattr(result, measure))
                cells.append(f"**{value}**" if program in best(row, measure) else value)
            cells += [f"{result.cameras:.2f}", str(result.photos), f"{result.scale:.3f}"]
        found.append(f"| {' | '.join(cells)} |")
    return found


if __name__ == "__main__":
    sys.exit(main())
