"""CPU time, time on the clock and memory of whole runs: panostitch, cv2.Stitcher, and the floor under both.

    python benchmarks/speed.py [--scenes ring,row] [--repeat 3] [--output docs/reference/speed.md]

Two scenes, photographed anew: a closed ring of twelve photos and a row of eight over 150 degrees, JPEGs of 12
megapixels with grain. Each program runs in a process of its own, from the photos to a JPEG of full size, and that as
often as --repeat says, in turns; medians count. Ratios of CPU time (user and system) depend little on the machine. A
virtual machine may have given memory back to its host, and fetches it again at the cost of whoever asks for it first: a
process of its own does that before each run, so that none profits from the one before it.

panostitch    the command line as it comes, but with `--crop none`: cv2.Stitcher does not crop either
  align       its first half alone
  render      its second half alone
cv2.Stitcher  reading, `stitch` in PANORAMA mode as it comes, writing
floor         decoding every photo, one cubic remap for each pixel of our panorama, encoding: what nobody can do without

Where the time goes is measured in one more run, on one thread (`benchmarks/speed_stages.py`).
"""

import argparse
import compileall
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

import panostitch
from panostitch.jobs.contender import OURS, RIVAL
from panostitch.model.camera import Camera
from panostitch.synthetic.rig import rig
from panostitch.synthetic.scene import Scene, sphere_scene
from panostitch.synthetic.textures import procedural_texture

Picture = NDArray[np.uint8]

SIZE = (4000, 3000)  # px
FOCAL = 3200  # px
HFOV = 2 * np.arctan(SIZE[0] / 2 / FOCAL)
TEXTURE = 8192  # px all around
GRAIN = 2.0  # grey levels
QUALITY = 92
TILE = (1024, 512)  # px, of the floor's remap
STEP = 16  # px between its exact coordinates
MEMORY = 3 << 30  # bytes, as much as the largest run takes

ALIGN, RENDER, FLOOR, SHOOT, FETCH = "align", "render", "floor", "shoot", "fetch"
# scene: most CPU time, time on the clock and memory that ours may take, as shares of cv2.Stitcher's; None: not promised
PROMISED: dict[str, tuple[float, float | None, float]] = {"ring": (0.10, None, 0.25), "row": (0.40, 0.5, 0.5)}
STAGES = str(Path(__file__).with_name("speed_stages.py"))
WHOLE, HALF = 3.5, 2.0  # times the floor's CPU time that the whole and its second half may take

_cv2: Any = cv2  # OpenCV's stubs lack some of what is used here


@dataclass(frozen=True)
class Cost:
    """Of one process: seconds of processors and on the clock, MB at its peak."""

    cpu: float
    wall: float
    megabytes: float
    failed: str = ""


@dataclass(frozen=True)
class Found:
    """Of a scene: size (width, height) of our panorama, what each program takes, CPU seconds of each of our stages."""

    size: tuple[int, int]
    costs: dict[str, Cost]
    stages: dict[str, float]


def ring() -> list[Camera]:
    """Twelve photos all around."""
    return _level(np.arange(12) * 30.0 - 165.0)


def row() -> list[Camera]:
    """Eight photos over 150 degrees."""
    return _level(np.linspace(-1, 1, 8) * (150 - np.rad2deg(HFOV)) / 2)


def _level(yaws: NDArray[np.float64]) -> list[Camera]:
    shake = np.random.default_rng(1).uniform(-1, 1, (2, len(yaws)))
    return rig(np.deg2rad(yaws), np.deg2rad(shake[0]), np.deg2rad(shake[1]), size=SIZE, hfov=HFOV)


SCENES: dict[str, Callable[[], list[Camera]]] = {"ring": ring, "row": row}


def main() -> int:
    """Print the tables, and write them if asked; the exit code is 1 where a promise is broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default=",".join(SCENES), help="names, with commas between")
    parser.add_argument("--repeat", type=int, default=3, help="runs of each program; the median counts")
    parser.add_argument("--threads", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--output", type=Path, help="Markdown file to write")
    parser.add_argument("--child", choices=[SHOOT, RIVAL, FLOOR, FETCH], help=argparse.SUPPRESS)
    parser.add_argument("arguments", nargs="*", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child:
        CHILDREN[given.child](given.threads, *given.arguments)
        return 0
    # as an installation does; not every environment lets Python keep what it has compiled
    compileall.compile_dir(Path(panostitch.__file__).parent, quiet=1)
    found = {}
    for name in given.scenes.split(","):
        with tempfile.TemporaryDirectory(prefix="panostitch-speed-") as folder:
            found[name] = measure(Path(folder), name, repeat=given.repeat, threads=given.threads)
    text, kept = page(found, threads=given.threads)
    print(text)
    if given.output:
        given.output.write_text(text + "\n")
    return 0 if kept else 1


def measure(home: Path, scene: str, *, repeat: int, threads: int) -> Found:
    """The medians of what each program takes, and where our time goes."""
    photos = [str(home / f"photo_{n:02}.jpg") for n in range(len(SCENES[scene]()))]
    out, project, again = (str(home / name) for name in ("ours.jpg", "ours.pano.json", "again.jpg"))
    common = ["--overwrite", "--quiet", "--threads", str(threads)]
    whole = ["--crop", "none"]
    program = [sys.executable, "-m", "panostitch"]
    child = [sys.executable, "-P", __file__, "--threads", str(threads), "--child"]
    # not in this process: Linux tells of a child no smaller peak than that of the process that started it
    run([*child, SHOOT, scene, *photos])
    commands = {
        OURS: [*program, *photos, "-o", out, *whole, *common],
        ALIGN: [*program, "align", *photos, "-o", project, *common],
        RENDER: [*program, "render", project, "-o", again, *whole, *common],
        RIVAL: [*child, RIVAL, str(home / "rival.jpg"), *photos],
        FLOOR: [*child, FLOOR, str(home / "floor.jpg"), out, *photos],
    }
    runs: dict[str, list[Cost]] = {name: [] for name in commands}
    for _ in range(repeat):
        for name, command in commands.items():
            run([*child, FETCH])
            runs[name].append(run(command))
            print(name, runs[name][-1], file=sys.stderr, flush=True)
    told = subprocess.run([sys.executable, "-P", STAGES, *photos, again], check=True, stdout=subprocess.PIPE)
    return Found(size_of(out), {name: middle(costs) for name, costs in runs.items()}, json.loads(told.stdout))


def snapshot(scene: Scene, camera: Camera, seed: int) -> Picture:
    """The photo (h, w, 3) BGR, with grain; quick, and good enough for measuring time."""
    width, height = camera.size
    columns = np.arange(width, dtype=np.float64)
    photo = np.empty((height, width, 3), np.uint8)
    rng = np.random.default_rng(seed)
    for y in range(height):
        xy = scene.coordinates(camera.rays(np.column_stack([columns, np.full(width, float(y))]))).astype(np.float32)
        line = cv2.remap(scene.texture, xy[None, :, 0], xy[None, :, 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_WRAP)
        grain = rng.normal(0, GRAIN, (width, 1))
        photo[y] = np.clip(np.rint(line[0, :, ::-1] + grain), 0, 255)
    return photo


def run(command: Sequence[str]) -> Cost:
    """Run a command to its end."""
    start = time.perf_counter()
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    wall = time.perf_counter() - start
    failed = f"stopped with code {process.returncode}" if process.returncode else ""
    return Cost(used.ru_utime + used.ru_stime, wall, used.ru_maxrss / 1024, failed)


def middle(costs: Sequence[Cost]) -> Cost:
    """The medians, each for itself."""
    cpu, wall, megabytes = (median(getattr(cost, name) for cost in costs) for name in ("cpu", "wall", "megabytes"))
    return Cost(cpu, wall, megabytes, next((cost.failed for cost in costs if cost.failed), ""))


# ---- the child's side


def fetch(threads: int) -> None:
    """Touch as much memory as the largest run takes."""
    del threads
    np.empty(MEMORY, np.uint8)[:: os.sysconf("SC_PAGE_SIZE")] = 1


def shoot(threads: int, name: str, *photos: str) -> None:
    """Photograph a scene."""
    cv2.setNumThreads(threads)
    scene = sphere_scene(procedural_texture(TEXTURE, TEXTURE // 2, 3))
    for n, (path, camera) in enumerate(zip(photos, SCENES[name](), strict=True)):
        _cv2.imwrite(path, snapshot(scene, camera, n), [_cv2.IMWRITE_JPEG_QUALITY, QUALITY])


def rival(threads: int, output: str, *photos: str) -> None:
    """cv2.Stitcher as it comes, but without OpenCL."""
    _cv2.ocl.setUseOpenCL(False)
    cv2.setNumThreads(threads)
    stitcher = _cv2.Stitcher.create(_cv2.Stitcher_PANORAMA)
    status, panorama = stitcher.stitch([_cv2.imread(path) for path in photos])
    if status != _cv2.Stitcher_OK:
        sys.exit(3)
    _cv2.imwrite(output, panorama, [_cv2.IMWRITE_JPEG_QUALITY, QUALITY])


def floor(threads: int, output: str, like: str, *photos: str) -> None:
    """Decode, remap to a picture of the size of another one, encode."""
    cv2.setNumThreads(threads)
    width, height = size_of(like)
    pictures = [_cv2.imread(path) for path in photos]
    panorama = np.empty((height, width, 3), np.uint8)
    for top in range(0, height, TILE[1]):
        for left in range(0, width, TILE[0]):
            place = panorama[top : top + TILE[1], left : left + TILE[0]]
            picture = pictures[left * len(pictures) // width]
            nodes = np.add.outer(np.arange(0.0, place.shape[0] + STEP, STEP), np.arange(0.0, place.shape[1], STEP))
            # a smooth map that stays within the photo, made as cheaply as coordinates can be
            x, y = (
                cv2.resize((nodes * share % (side - TILE[0])).astype(np.float32), place.shape[1::-1])
                for share, side in zip((0.71, 0.69), picture.shape[1::-1], strict=True)
            )
            place[...] = cv2.remap(picture, x, y, cv2.INTER_CUBIC)
    _cv2.imwrite(output, panorama, [_cv2.IMWRITE_JPEG_QUALITY, QUALITY])


def size_of(path: str) -> tuple[int, int]:
    """Of a picture, without decoding it."""
    from PIL import Image

    Image.MAX_IMAGE_PIXELS = None
    with Image.open(path) as picture:
        return picture.size


CHILDREN: dict[str, Callable[..., None]] = {SHOOT: shoot, RIVAL: rival, FLOOR: floor, FETCH: fetch}


# ---- words


def page(found: dict[str, Found], *, threads: int) -> tuple[str, bool]:
    """All of it in Markdown, and whether all promises are kept."""
    text, kept = header(threads), True
    for name, scene in found.items():
        photos, (width, height), costs = len(SCENES[name]()), scene.size, scene.costs
        text += f"\n\n## {name}: {photos} photos of 12 megapixels, {width * height / 1e6:.0f} megapixels\n\n"
        text += "| | CPU s | wall s | peak MB | CPU / cv2.Stitcher | CPU / floor |\n|---|---|---|---|---|---|\n"
        text += "\n".join(line(program, costs) for program in costs) + "\n"
        for said, good in promises(name, costs):
            text += f"\n- {said}: {'yes' if good else 'NO'}"
            kept &= good
    return text + "\n\n" + stages(found), kept


def stages(found: dict[str, Found]) -> str:
    """Where our time goes."""
    names = list(next(iter(found.values())).stages)
    rows = [f"| {name} | {' | '.join(f'{scene.stages[name]:.2f}' for scene in found.values())} |" for name in names]
    sums = " | ".join(f"{sum(scene.stages.values()):.2f}" for scene in found.values())
    return "\n".join(
        [
            "## Where the time goes",
            "",
            "CPU seconds of a run on one thread. Photos are decoded four times: small for the key points and for the",
            "plan, at full size for the control points (their brightness alone) and for the panorama.",
            "",
            f"| | {' | '.join(found)} |",
            f"|---|{'---|' * len(found)}",
            *rows,
            f"| sum | {sums} |",
        ]
    )


def header(threads: int) -> str:
    """What the tables are."""
    return f"""# Speed

Whole runs, from photos to a JPEG of full size, each in a process of its own with {threads} threads; medians. CPU
seconds are user and system; "floor": decoding all photos, one cubic remap a pixel of the panorama, encoding.

Made by `python benchmarks/speed.py` with OpenCV {cv2.__version__}, NumPy {np.__version__}, Python
{platform.python_version()}."""


def line(program: str, costs: dict[str, Cost]) -> str:
    """A row of a table."""
    cost = costs[program]
    if cost.failed:
        return f"| {program} | {cost.failed} | | | | |"
    ratios = [f"{cost.cpu / costs[other].cpu:.2f}" for other in (RIVAL, FLOOR)]
    cells = [program, f"{cost.cpu:.1f}", f"{cost.wall:.1f}", f"{cost.megabytes:.0f}", *ratios]
    return f"| {' | '.join(cells)} |"


def promises(name: str, costs: dict[str, Cost]) -> list[tuple[str, bool]]:
    """What was promised of a scene, in words, and whether it is kept."""
    ours, theirs, least = costs[OURS], costs[RIVAL], costs[FLOOR]
    cpu, wall, memory = PROMISED[name]
    said = [
        (f"at most {cpu:g} of {RIVAL}'s CPU time", ours.cpu <= cpu * theirs.cpu),
        (f"at most {memory:g} of its memory", ours.megabytes <= memory * theirs.megabytes),
        (f"at most {WHOLE:g} times the floor's CPU time", ours.cpu <= WHOLE * least.cpu),
        (f"the second half at most {HALF:g} times the floor's", costs[RENDER].cpu <= HALF * least.cpu),
    ]
    if wall is not None:
        said.append((f"at most {wall:g} of {RIVAL}'s time on the clock", ours.wall <= wall * theirs.wall))
    return said


if __name__ == "__main__":
    sys.exit(main())
