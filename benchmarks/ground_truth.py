"""True error of panostitch, cv2.Stitcher and Hugin on photographs of known scenes, a row for each plan of cameras.

    python benchmarks/ground_truth.py [--textures FOLDER] [--plans row,barrel] [--output docs/reference/ground-truth.md]

Every plan is photographed at 1200 x 900 with exposure steps, vignetting and noise, once without and once with the focal
length in the metadata. Of Hugin's two results (autooptimiser -a -m -l -s, and the lens optimised after it) the better
one counts.

Without --textures the scenes are computed. The pictures in FOLDER are put to use by their shape: twice as wide as high
is a whole sphere, square with two halves alike is a stereoscopic one (the upper half is taken), any other is flat. The
pictures take turns, but a plan leaves out those in which one of its photos would show little but plain sky or floor,
which nobody could place. Where none is left it photographs a room papered with the liveliest bands of three pictures,
else a computed scene. A picture coarser than the photos shows in them enlarged, as a soft lens would; the table says by
how much.
"""

import argparse
import platform
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.io.readers import EXTENSIONS
from panostitch.jobs import selftest
from panostitch.jobs.contender import OURS, RIVAL
from panostitch.jobs.hugin import HUGIN, is_installed
from panostitch.jobs.selftest import Finding
from panostitch.model.camera import Camera
from panostitch.options import Options
from panostitch.runtime.executor import Executor
from panostitch.synthetic.scene import FLAT_PLANS, PLANS, Scene, plane_scene, sphere_scene
from panostitch.synthetic.textures import even_on_sphere

Picture = NDArray[np.uint8]

SPHERE_ASPECT = (1.95, 2.05)  # some are a few pixels short of 2 : 1
ALIKE = 0.8  # correlation of the halves of a stereoscopic sphere
FLAT_ASPECT = 4 / 3  # of the piece that is cut from the middle of a flat picture
SHARE = 1 / 5  # of Hugin's error, the most that ours may be
MOST, MOST_OF_HARD = 0.02, 0.05  # px, rms, that ours may be by itself
HARD = frozenset({"barrel", "zoomed", "sphere"})
COMPUTED, PAPERED = "computed", "three pictures"
PLAIN = 4.0  # grey levels: deviation in a neighbourhood below which a picture shows nothing that noise would not hide
NEIGHBOURHOOD = 15  # px
ENOUGH = 1 / 3  # of a photo, the least that must not be plain


@dataclass(frozen=True)
class Subject:
    """What a plan photographs; `scene` is None for the computed one."""

    name: str
    scene: Scene | None = None


@dataclass(frozen=True)
class Row:
    """What the programs made of one plan, with the photos' enlargement of the texture."""

    plan: str
    subject: str
    enlarged: float
    findings: tuple[Finding, ...]

    def of(self, program: str) -> Finding | None:
        """What a program made of it; None if it did not run."""
        return next((finding for finding in self.findings if finding.program == program), None)

    @property
    def ratio(self) -> float | None:
        """Our error over Hugin's; None where Hugin did not find all photos."""
        ours, theirs = self.of(OURS), self.of(HUGIN)
        if not ours or not theirs or theirs.photos < theirs.given or not np.isfinite(theirs.rms):
            return None
        return ours.rms / theirs.rms

    @property
    def kept(self) -> bool:
        """Whether all photos are in and the error is small, and at most its share of Hugin's."""
        ours = self.of(OURS)
        most = MOST_OF_HARD if self.plan in HARD else MOST
        return bool(
            ours and ours.photos == ours.given and ours.rms <= most and (self.ratio is None or self.ratio <= SHARE)
        )


def main() -> int:
    """Print the table, and write it if asked; the exit code is 1 where a promise is broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--textures", type=Path, help="folder of pictures to photograph")
    parser.add_argument("--plans", default=",".join(PLANS), help="names of plans, with commas between")
    parser.add_argument("--picture", help="name of the one picture to take for every plan")
    parser.add_argument("--programs", default=",".join(selftest.PROGRAMS), help="names, with commas between")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--output", type=Path, help="Markdown file to write")
    given = parser.parse_args()
    pictures = [p for p in sorted(given.textures.iterdir()) if is_picture(p)] if given.textures else []
    if given.picture:
        pictures = [path for path in pictures if path.name == given.picture]
    text = header(bool(pictures))
    print(text)
    rows = []
    for plan in given.plans.split(","):
        for row in run(plan, subject(plan, pictures), given.programs.split(","), Executor(given.threads)):
            rows.append(row)
            text += "\n" + in_words(row)
            print(in_words(row), flush=True)
    if given.output:
        given.output.write_text(text + "\n")
    return 0 if all(row.kept for row in rows) else 1


def run(plan: str, of: Subject, programs: Sequence[str], executor: Executor) -> list[Row]:
    """Photograph a plan with and without EXIF and let the programs align the photos."""
    rows = []
    for exif in (False, True):
        conditions = replace(selftest.CONDITIONS, exif=exif)
        cameras, photos = selftest.photograph(plan, conditions, scene=of.scene, run=executor)
        findings = [
            replace(selftest.JUDGES[program](plan, cameras, photos, Options(), executor), exif=exif)
            for program in programs
            if program != HUGIN or is_installed()
        ]
        rows.append(Row(plan, of.name, enlargement(of.scene, plan, cameras), tuple(findings)))
    return rows


# ---- pictures


def is_picture(path: Path) -> bool:
    """Whether the file's name says so."""
    return path.suffix.lower() in EXTENSIONS


def subject(plan: str, pictures: Sequence[Path]) -> Subject:
    """What a plan photographs: the pictures take turns, of those that show enough in each of its photos."""
    fitting = [(path.stem, scene) for path in pictures if suits(plan, scene := scene_of(path))]
    if not fitting:
        paper = papered(pictures) if plan not in FLAT_PLANS else None
        return Subject(PAPERED, paper) if paper and suits(plan, paper) else Subject(COMPUTED)
    return Subject(*fitting[list(PLANS).index(plan) % len(fitting)])


def suits(plan: str, scene: Scene) -> bool:
    """Whether the scene has the plan's shape and shows enough to every camera."""
    if (scene.shape == "plane") != (plan in FLAT_PLANS):
        return False
    return scene.shape == "plane" or poorest(scene, PLANS[plan]()) >= ENOUGH


def poorest(scene: Scene, cameras: Sequence[Camera]) -> float:
    """Share of a photo (0 to 1) that is not plain, for the camera to which the scene shows least."""
    rich = not_plain(scene.texture)
    top = np.array(rich.shape[::-1]) - 1
    shares = []
    for camera in cameras:
        grid = np.stack(np.meshgrid(*(np.linspace(0, n - 1, 24) for n in camera.size)), -1).reshape(-1, 2)
        x, y = np.clip(np.rint(scene.coordinates(camera.rays(grid))), 0, top).astype(int).T
        shares.append(rich[y, x].mean())
    return float(min(shares))


def not_plain(picture: Picture) -> NDArray[np.bool_]:
    """Where (h, w) a picture shows something."""
    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY).astype(np.float32)
    window = (NEIGHBOURHOOD, NEIGHBOURHOOD)
    return np.asarray(cv2.blur((grey - cv2.blur(grey, window)) ** 2, window) > PLAIN**2)


def papered(pictures: Sequence[Path]) -> Scene | None:
    """A sphere of three bands, one above the other, of the three liveliest pictures; None for fewer."""
    spheres = [scene.texture for path in pictures if (scene := scene_of(path)).shape == "sphere"]
    if len(spheres) < 3:
        return None
    width = 6 * (max(texture.shape[1] for texture in spheres) // 6)
    bands = [liveliest_band(np.asarray(texture, np.uint8), width) for texture in spheres]
    bands.sort(key=lambda band: -not_plain(band).mean())
    return sphere_scene(even_on_sphere(np.vstack(bands[:3])))


def liveliest_band(picture: Picture, width: int) -> Picture:
    """A third of the height of a picture (width / 6, width, 3): where most of it is not plain."""
    picture = np.asarray(cv2.resize(picture, (width, width // 2), interpolation=cv2.INTER_CUBIC), np.uint8)
    height = width // 6
    rich = np.concatenate([[0.0], np.cumsum(not_plain(picture).mean(1))])
    top = int(np.argmax(rich[height:] - rich[:-height]))
    return picture[top : top + height]


@cache
def scene_of(path: Path) -> Scene:
    """The scene that a picture makes."""
    pixels = read(path)
    height, width = pixels.shape[:2]
    if height == width and correlation(pixels[: height // 2], pixels[height - height // 2 :]) > ALIKE:
        height //= 2
        pixels = pixels[:height]
    if SPHERE_ASPECT[0] <= width / height <= SPHERE_ASPECT[1]:
        even = 2 * (width // 2)
        return sphere_scene(np.asarray(cv2.resize(pixels, (even, even // 2), interpolation=cv2.INTER_CUBIC), np.uint8))
    across = min(width, round(height * FLAT_ASPECT))
    left = (width - across) // 2
    return plane_scene(np.ascontiguousarray(pixels[:, left : left + across]))


def read(path: Path) -> Picture:
    """Pixels (h, w, 3) RGB."""
    pixels = cv2.imread(str(path), cv2.IMREAD_COLOR_RGB)
    if pixels is None:
        sys.exit(f"{path} cannot be read")
    return np.asarray(pixels, np.uint8)


def correlation(one: Picture, other: Picture) -> float:
    """Of two pictures of the same size."""
    return float(np.corrcoef(one.ravel()[::16], other.ravel()[::16])[0, 1])


def enlargement(scene: Scene | None, plan: str, cameras: Sequence[Camera]) -> float:
    """Photo px for a texture px in the middle of the first photo."""
    scene = scene or selftest.computed_scene(plan, cameras)
    middle = np.array(cameras[0].size) / 2
    rays = cameras[0].rays(middle + np.array([[0.0, 0.0], [0.0, 1.0]]))
    return float(1 / np.hypot(*np.diff(scene.coordinates(rays), axis=0)[0]))


# ---- words


def header(textured: bool) -> str:
    """What the table is, and its head."""
    light = selftest.CONDITIONS
    source = "pictures of true places" if textured else "computed scenes"
    return f"""# Ground truth

True error in pixels (rms over all pairs of photos that overlap) of the cameras found by each program, on 1200 x 900
photographs of {source} with exposure steps of {2 * light.exposure_step:g} EV, {light.vignetting:.0%} of the light lost
in the corners and noise of {light.noise:g} grey levels; in brackets the photos included where some are missing. Of
Hugin's two results, as it comes and with its lens optimised, the better one counts. Seconds are those of finding the
cameras; cv2.Stitcher's include its panorama. "Enlarged": photo px for a px of the picture that is photographed.
"Kept": all photos are in, at most {MOST:g} px ({MOST_OF_HARD:g} for {", ".join(sorted(HARD))}) and at most {SHARE:g} of
Hugin's error where it found all photos.

Made by `python benchmarks/ground_truth.py` with OpenCV {cv2.__version__}, NumPy {np.__version__}, Python
{platform.python_version()}.

| plan | EXIF | scene | enlarged | {OURS} px | {RIVAL} px | {HUGIN} px | {OURS} / {HUGIN} | seconds | kept |
|---|---|---|---|---|---|---|---|---|---|"""


def in_words(row: Row) -> str:
    """A line of the table."""
    findings = [row.of(program) for program in selftest.PROGRAMS]
    seconds = " / ".join("-" if finding is None else f"{finding.seconds:.0f}" for finding in findings)
    cells = [
        row.plan,
        "yes" if row.findings[0].exif else "no",
        row.subject,
        f"{row.enlarged:.1f}",
        *(cell(finding) for finding in findings),
        "-" if row.ratio is None else f"{row.ratio:.2f}",
        seconds,
        "yes" if row.kept else "NO",
    ]
    return f"| {' | '.join(cells)} |"


def cell(finding: Finding | None) -> str:
    """The error of a program, with the photos it included where some are missing."""
    if finding is None:
        return "-"
    if not finding.photos:
        return f"failed: {finding.message}"
    missing = f" ({finding.photos} of {finding.given})" if finding.photos < finding.given else ""
    return f"{finding.rms:.3f}{missing}"


if __name__ == "__main__":
    sys.exit(main())
