"""The programs of `quality.py`: from photos to an equirectangular picture, and where the program says that it lies."""

import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np

from panostitch import pipeline
from panostitch.io.writers import assemble
from panostitch.jobs.contender import DONE, OURS, RIVAL, Task, run_apart
from panostitch.jobs.hugin import HUGIN, LENS, PLAIN, HuginError, is_installed, read_pto, run_hugin
from panostitch.model.camera import Camera
from panostitch.model.photo import Photo
from panostitch.options import Options
from panostitch.runtime.executor import Executor
from panostitch.synthetic.score import score
from quality_judge import Finished, Place

HUGIN_TIMEOUT = 600  # s
EQUIRECTANGULAR = 2  # Hugin's number of it
LEAST_BLACK = 9  # px: cv2.Stitcher's picture is black where it shows nothing, and a scene has small black things
ANY_TURN = np.eye(3)


def installed() -> list[str]:
    """Names in PROGRAMS of those that can run here."""
    hugin = is_installed() and shutil.which("hugin_executor") and shutil.which("enblend")
    return [name for name in PROGRAMS if name != HUGIN or hugin]


def ours(photos: Sequence[Photo], _: Sequence[Camera], run: Executor) -> Finished:
    """As it comes, but equirectangular and not cropped."""
    options = Options.of(projection="equirectangular", crop="none")
    panorama = pipeline.render(pipeline.align(photos, options, run=run), options, run=run)
    pixels, mask = assemble(panorama, run=run)
    canvas, crop = panorama.canvas, panorama.plan.crop
    middle = (-canvas.origin[0] - crop.x, -canvas.origin[1] - crop.y)
    place = Place(pixels.shape[1::-1], canvas.scale, middle, ANY_TURN)
    found = dict(zip((p.name for p in panorama.alignment.photos), panorama.alignment.cameras, strict=True))
    return Finished(pixels, np.asarray(mask, bool), place, tuple(found.get(photo.name) for photo in photos))


def rival(photos: Sequence[Photo], _: Sequence[Camera], run: Executor) -> Finished:
    """cv2.Stitcher as it comes: its panoramas are equirectangular."""
    with tempfile.TemporaryDirectory(prefix="panostitch-quality-") as home:
        outcome = run_apart(Task(RIVAL, tuple(photos), Options(), run.threads), home)
        if outcome.status != DONE:
            raise ValueError(outcome.status)
        pixels = np.load(outcome.picture)
    black = (pixels == 0).all(2).astype(np.uint8)
    black = cv2.morphologyEx(np.pad(black, LEAST_BLACK, mode="edge"), cv2.MORPH_OPEN, np.ones((LEAST_BLACK,) * 2))
    mask = black[LEAST_BLACK:-LEAST_BLACK, LEAST_BLACK:-LEAST_BLACK] == 0
    return Finished(pixels, mask, rival_place(outcome.cameras, pixels.shape[1::-1]), outcome.cameras)


def rival_place(cameras: Sequence[Camera | None], size: tuple[int, int]) -> Place:
    """Where cv2.Stitcher's own warper puts the photos: the scale is their median focal length.

    Raises ValueError where its picture is not as large as that says.
    """
    known = [camera for camera in cameras if camera]
    scale = float(np.median([camera.focal for camera in known]))
    warper = cv2.PyRotationWarper("spherical", scale)
    boxes = []
    for camera in known:
        intrinsics = [[camera.focal, 0, camera.centre[0]], [0, camera.focal, camera.centre[1]], [0, 0, 1]]
        turn = camera.cam_from_world.T.astype(np.float32)
        x, y, width, height = warper.warpRoi(camera.size, np.array(intrinsics, np.float32), turn)
        boxes.append((x, y, x + width, y + height))
    left, top = np.min(boxes, axis=0)[:2]
    right, bottom = np.max(boxes, axis=0)[2:]
    if (right - left, bottom - top) != size:
        raise ValueError(f"a picture of {size} px where its cameras make one of {(right - left, bottom - top)}")
    # its rows are counted from the pole, straight up
    return Place(size, scale, (-float(left), scale * np.pi / 2 - float(top)), ANY_TURN)


def hugin(photos: Sequence[Photo], true: Sequence[Camera], run: Executor) -> Finished:
    """Stitched by Hugin itself (nona and enblend), in the size in which it loses nothing, from the better cameras.

    The better ones of those that autooptimiser leaves and those with the lens optimised after that.
    """
    with tempfile.TemporaryDirectory(prefix="panostitch-quality-") as folder:
        home = Path(folder)
        result = run_hugin(photos, home, threads=run.threads)
        better = min((result.plain, PLAIN), (result.lens, LENS), key=lambda one: score(true, one[0]).rms)[1]
        kind = f"--projection={EQUIRECTANGULAR}"
        tool(["pano_modify", kind, "--fov=AUTO", "--canvas=AUTO", "-o", "canvas.pto", better], home)
        tool(["hugin_executor", "--stitching", "--prefix=panorama", "canvas.pto"], home)
        picture = cv2.imread(str(home / "panorama.tif"), cv2.IMREAD_UNCHANGED)
        project = (home / "canvas.pto").read_text()
    place = hugin_place(project)
    if picture.shape[1::-1] != place.size:
        raise HuginError(f"a picture of {picture.shape[1::-1]} px where the project says {place.size}")
    pixels = np.asarray(picture[..., 2::-1], np.uint8)
    return Finished(pixels, np.asarray(picture[..., 3] == 255), place, read_pto(project))


def hugin_place(project: str) -> Place:
    """Where a .pto file puts its panorama. Raises HuginError for others than equirectangular ones."""
    found = re.search(r"^p f(\d+) w(\d+) h(\d+) v([\d.]+)", project, re.MULTILINE)
    if not found or int(found[1]) != EQUIRECTANGULAR:
        raise HuginError("the project has no equirectangular panorama")
    width, height = int(found[2]), int(found[3])
    return Place((width, height), width / np.deg2rad(float(found[4])), ((width - 1) / 2, (height - 1) / 2), ANY_TURN)


def tool(command: Sequence[str], home: Path) -> None:
    """Run one of Hugin's tools. Raises HuginError where it fails."""
    done = subprocess.run(
        command, cwd=home, stdin=subprocess.DEVNULL, capture_output=True, timeout=HUGIN_TIMEOUT, check=False
    )
    if done.returncode:
        raise HuginError(f"{command[0]} failed with code {done.returncode}")


Program = Callable[[Sequence[Photo], Sequence[Camera], Executor], Finished]  # the true cameras are for choosing only
PROGRAMS: dict[str, Program] = {OURS: ours, RIVAL: rival, HUGIN: hugin}
