"""How long it takes to find the cameras of photos: panostitch, cv2.Stitcher and Hugin, in seconds on the clock and CPU
seconds.

    python benchmarks/registration_time.py FOLDER [FOLDER ...] [--repeat 3] [--threads 2] [--no-hugin]
                                           [--output docs/reference/registration-time.md]

The photos of a folder are registered by one program after the other, and that as often as --repeat says (A B C A B C),
each time in a process of its own; medians count. From opening the first photo to the last camera:

panostitch    `pipeline.align` with the default options but without meshes (`--local-warp none`), which come after the
              last camera and which the others do not have; OpenBLAS on one thread as the command line sets it
cv2.Stitcher  reading the photos and `estimateTransform`, as it comes but without OpenCL
Hugin         cpfind --multirow, cpclean, autooptimiser -a -m -l -s, where they are installed; pto_gen is not counted

Imports are not counted, and the first two have been let loose on two blank photos before the clock starts: what is
loaded late has been loaded. The files have been read once by then: nobody waits for the disk.
"""

import argparse
import json
import os
import platform
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any, TypeVar

import cv2
import numpy as np

from panostitch import pipeline
from panostitch.errors import PanostitchError
from panostitch.io.readers import open_photos, photos_in
from panostitch.jobs.contender import DONE, OURS, RIVAL, STATUS_WORDS
from panostitch.jobs.hugin import GUESS, HUGIN, TIMEOUT, HuginError, is_installed, read_pto
from panostitch.model.photo import Photo
from panostitch.options import Options
from panostitch.runtime.executor import Executor
from panostitch.synthetic.render import ArraySource

Result = TypeVar("Result")

OPTIONS = Options.of(local_warp="none")
BLANK = (320, 240)  # px of the photos to warm up on
KEY_POINTS, MATCHING, CAMERAS, CONTROL_POINTS = STAGES = ("key points", "matching", "cameras", "control points")
LABELS = {"Finding key points": KEY_POINTS, "Measuring control points": CONTROL_POINTS}  # of what the executor runs
ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "MKL")}  # as panostitch.cli.main has it

_cv2: Any = cv2  # OpenCV's stubs lack some of what is used here


@dataclass(frozen=True)
class Seconds:
    """On the clock, and of processors: user and system, of this process and of the children it has waited for."""

    wall: float = 0.0
    cpu: float = 0.0

    @classmethod
    def now(cls) -> "Seconds":
        """Since some moment in the past."""
        used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        return cls(time.perf_counter(), sum(one.ru_utime + one.ru_stime for one in used))

    def __add__(self, other: "Seconds") -> "Seconds":
        return Seconds(self.wall + other.wall, self.cpu + other.cpu)

    def __sub__(self, other: "Seconds") -> "Seconds":
        return Seconds(self.wall - other.wall, self.cpu - other.cpu)


@dataclass(frozen=True)
class Run:
    """What one run of a program took.

    included: photos that got a camera
    stages:   ours only
    """

    included: int
    seconds: Seconds
    status: str = DONE
    stages: dict[str, Seconds] = field(default_factory=dict)

    def to_json(self) -> str:
        """For the parent."""
        stages = {name: (one.wall, one.cpu) for name, one in self.stages.items()}
        return json.dumps([self.included, (self.seconds.wall, self.seconds.cpu), self.status, stages])

    @classmethod
    def from_json(cls, text: str) -> "Run":
        """What `to_json` wrote."""
        included, seconds, status, stages = json.loads(text)
        return cls(included, Seconds(*seconds), status, {name: Seconds(*one) for name, one in stages.items()})


class Stages:
    """Books the time to stages, from what the pipeline tells and from what the executor runs."""

    def __init__(self) -> None:
        self.booked: dict[str, Seconds] = defaultdict(Seconds)
        self._since = Seconds.now()
        self._outside = MATCHING  # to what time counts in which nothing of LABELS runs

    def trace(self, event: str, /, **_: Any) -> None:
        """The listener: after the groups have been found, cameras are."""
        if event == "matching.grouped":
            self.book(MATCHING)
            self._outside = CAMERAS

    def progress(self, items: Iterable[Result], /, *, total: int, label: str) -> Iterator[Result]:
        """What the executor shows progress with."""
        del total
        self.book(self._outside)
        yield from items
        self.book(LABELS.get(label, self._outside))

    def book(self, stage: str = "") -> None:
        """The time since the last call to this stage, by default what goes on outside of LABELS."""
        now = Seconds.now()
        self.booked[stage or self._outside] += now - self._since
        self._since = now


# ---- the child's side: one program, once


def ours(folder: str, threads: int) -> Run:
    """The first half of panostitch."""
    warm_up(lambda: pipeline.align(blank_photos(), OPTIONS, run=Executor(threads)))
    start, stages = Seconds.now(), Stages()
    photos, _ = open_photos(photos_in(folder))
    try:
        alignment = pipeline.align(photos, OPTIONS, run=Executor(threads, stages.progress), trace=stages.trace)
        included, status = len(alignment.photos), DONE
    except PanostitchError as error:
        included, status = 0, error.message
    stages.book()
    return Run(included, Seconds.now() - start, status, stages.booked)


def rival(folder: str, threads: int) -> Run:
    """The first half of cv2.Stitcher."""
    _cv2.ocl.setUseOpenCL(False)
    cv2.setNumThreads(threads)
    warm_up(lambda: new_stitcher().estimateTransform([photo.source.read()[0] for photo in blank_photos()]))
    start = Seconds.now()
    pictures = [pixels for path in photos_in(folder) if (pixels := cv2.imread(path)) is not None]
    stitcher = new_stitcher()
    try:
        code = stitcher.estimateTransform(pictures)
        status = DONE if code == _cv2.Stitcher_OK else STATUS_WORDS.get(code, f"failed with code {code}")
    except cv2.error as error:
        status = f"raised an error: {error.err or error}"
    seconds = Seconds.now() - start
    return Run(len(np.ravel(stitcher.component())) if status == DONE else 0, seconds, status)


def hugin(folder: str, threads: int) -> Run:
    """The first half of Hugin."""
    photos, _ = open_photos(photos_in(folder))
    view = [] if all(photo.focal for photo in photos) else ["-f", str(GUESS)]
    commands = [
        ["cpfind", "--multirow", "--ncores", str(threads), "-o", "points.pto", "photos.pto"],
        ["cpclean", "-o", "clean.pto", "points.pto"],
        ["autooptimiser", "-a", "-m", "-l", "-s", "-o", "done.pto", "clean.pto"],
    ]
    with tempfile.TemporaryDirectory(prefix="panostitch-registration-") as home:
        call(["pto_gen", *view, "-o", "photos.pto", *(os.path.abspath(photo.path) for photo in photos)], home)
        start = Seconds.now()
        said = next((words for command in commands if (words := call(command, home))), "")
        seconds = Seconds.now() - start
        try:
            included = sum(camera is not None for camera in read_pto((Path(home) / "done.pto").read_text()))
        except (OSError, HuginError) as error:
            return Run(0, seconds, said or str(error))
    return Run(included, seconds)


def call(command: Sequence[str], home: str) -> str:
    """Run a tool in a folder; in words, how it failed, or nothing."""
    try:
        done = subprocess.run(
            command, cwd=home, stdin=subprocess.DEVNULL, capture_output=True, timeout=TIMEOUT, check=False
        )
    except subprocess.TimeoutExpired:
        return f"{command[0]} took more than {TIMEOUT} s"
    return f"{command[0]} failed with code {done.returncode}" if done.returncode else ""


def warm_up(work: Callable[[], Any]) -> None:
    """Do this, however it ends: what is loaded late is loaded then."""
    with suppress(PanostitchError, cv2.error):
        work()


def blank_photos() -> list[Photo]:
    """Two photos that show nothing."""
    pixels = np.full((BLANK[1], BLANK[0], 3), 128, np.uint8)
    return [Photo(name, BLANK, ArraySource(pixels)) for name in ("a", "b")]


def new_stitcher() -> Any:
    """A cv2.Stitcher for panoramas, all as it comes."""
    return _cv2.Stitcher.create(_cv2.Stitcher_PANORAMA)


PROGRAMS: dict[str, Callable[[str, int], Run]] = {OURS: ours, RIVAL: rival, HUGIN: hugin}


# ---- the parent's side


def main() -> None:
    """Print the tables, and write them if asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", metavar="FOLDER", help="of photos that belong together")
    parser.add_argument("--repeat", type=int, default=3, help="runs of each program; the median counts")
    parser.add_argument("--threads", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--no-hugin", action="store_true", help="leave Hugin out although it is installed")
    parser.add_argument("--output", type=Path, help="Markdown file to write")
    parser.add_argument("--child", choices=list(PROGRAMS), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child:
        print(PROGRAMS[given.child](given.folders[0], given.threads).to_json())
        return
    programs = [name for name in PROGRAMS if name != HUGIN or (is_installed() and not given.no_hugin)]
    sets = {}
    for folder in given.folders:
        sets[Path(folder).resolve().name, len(photos_in(folder))] = measure(
            folder, programs, repeat=given.repeat, threads=given.threads
        )
    text = page(sets, threads=given.threads)
    print(text)
    if given.output:
        given.output.write_text(text + "\n")


def measure(folder: str, programs: Sequence[str], *, repeat: int, threads: int) -> dict[str, list[Run]]:
    """The runs of each program on one folder, taken in turns."""
    for path in photos_in(folder):
        Path(path).read_bytes()
    runs: dict[str, list[Run]] = {program: [] for program in programs}
    for _ in range(repeat):
        for program in programs:
            runs[program].append(run_apart(program, folder, threads))
            print(Path(folder).resolve().name, program, runs[program][-1], file=sys.stderr, flush=True)
    return runs


def run_apart(program: str, folder: str, threads: int) -> Run:
    """One run in a fresh process."""
    command = [sys.executable, "-P", __file__, "--child", program, "--threads", str(threads), folder]
    environment = {**os.environ, **(ONE_THREAD if program == OURS else {})}
    done = subprocess.run(command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, check=False)
    if done.returncode:
        return Run(0, Seconds(np.nan, np.nan), f"stopped with code {done.returncode}")
    return Run.from_json(done.stdout.decode().splitlines()[-1])


# ---- words


def page(sets: dict[tuple[str, int], dict[str, list[Run]]], *, threads: int) -> str:
    """All of it in Markdown, from the runs of each program on each set (name, number of photos)."""
    times = sorted({len(done) for runs in sets.values() for done in runs.values()})
    stages = "".join(f" {name} |" for name in STAGES)
    lines = [
        header(" to ".join(map(str, dict.fromkeys([times[0], times[-1]]))), threads),
        *(line for (name, photos), runs in sets.items() for line in comparison(name, photos, runs)),
        "",
        f"## Where the time of {OURS} goes",
        "",
        "Seconds on the clock / CPU seconds. Matching includes choosing and verifying pairs; cameras, the model and "
        "every\nadjustment; control points are those that are measured again on the full photos.",
        "",
        f"| set |{stages}\n|---{'|---' * len(STAGES)}|",
        *(by_stage(name, runs[OURS]) for (name, _), runs in sets.items()),
    ]
    return "\n".join(lines)


def header(repeat: str, threads: int) -> str:
    """What the table is, and its head."""
    return f"""# Registration time

Seconds from opening the photos to the last camera, nothing of the panorama; the runs of the programs ({repeat} of each,
the median counts) take turns, each in a process of its own with {threads} threads. {OURS} with its default options,
which measure control points on the full photos, but without meshes (`--local-warp none`);
cv2.Stitcher's `estimateTransform` with the reading of the photos,
without OpenCL; Hugin's cpfind --multirow, cpclean and autooptimiser -a -m -l -s. Imports are not counted, nor is
pto_gen; the first two have warmed up on two blank photos. Seconds on the clock depend on what else the machine is
doing, CPU seconds (user and system) much less. Ratios: {OURS} over the other program, which has had less to do
where it includes fewer photos.

Made by `python benchmarks/registration_time.py FOLDER ...` (`make bench`) with
{", ".join(versions())}.

| set | photos | program | included | wall s | CPU s | wall ratio | CPU ratio |
|---|---|---|---|---|---|---|---|"""


def versions() -> list[str]:
    """Of what counts."""
    found = [f"OpenCV {cv2.__version__}", f"NumPy {np.__version__}", f"Python {platform.python_version()}"]
    if is_installed():
        said = subprocess.run(["cpfind", "--version"], capture_output=True, text=True, check=False).stdout
        found += [f"{HUGIN} {number.group()}" for number in [re.search(r"\d+(\.\d+)+", said)] if number]
    return found


def comparison(name: str, photos: int, runs: dict[str, list[Run]]) -> list[str]:
    """Lines of the first table: one for each program."""
    own = middle([run.seconds for run in runs[OURS]])
    lines = []
    for program, done in runs.items():
        took = middle([run.seconds for run in done])
        compared = program != OURS and all(run.included for run in (*done, *runs[OURS]))
        ratios = [f"{own.wall / took.wall:.2f}", f"{own.cpu / took.cpu:.2f}"] if compared else ["-", "-"]
        cells = [name, str(photos), program, included(done), f"{took.wall:.2f}", f"{took.cpu:.2f}", *ratios]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def included(runs: Sequence[Run]) -> str:
    """How many photos got a camera, from the fewest to the most, and why there are none."""
    counts = sorted({run.included for run in runs})
    failed = next((f": {run.status}" for run in runs if run.status != DONE), "")
    return (f"{counts[0]} to {counts[-1]}" if len(counts) > 1 else str(counts[0])) + failed


def by_stage(name: str, runs: Sequence[Run]) -> str:
    """A line of the second table."""
    took = [middle([run.stages.get(stage, Seconds()) for run in runs]) for stage in STAGES]
    return f"| {name} | {' | '.join(f'{one.wall:.2f} / {one.cpu:.2f}' for one in took)} |"


def middle(seconds: Sequence[Seconds]) -> Seconds:
    """The medians, each for itself."""
    return Seconds(median(one.wall for one in seconds), median(one.cpu for one in seconds))


if __name__ == "__main__":
    main()
