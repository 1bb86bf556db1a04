"""One program on one set of photos, in a process of its own: its seconds and megabytes are then nobody else's, and
nothing but its result is lost if it crashes.

Parent and child share a folder: the child finds its `Task` there and leaves its `Outcome`.
"""

import importlib
import importlib.metadata
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.errors import InputError, PanostitchError
from panostitch.geometry.sampling import rescale
from panostitch.jobs.hugin import HUGIN, HuginError, run_hugin, stitch_hugin
from panostitch.jobs.hugin import version as hugin_version
from panostitch.model.alignment import Alignment
from panostitch.model.camera import Camera
from panostitch.model.photo import Photo
from panostitch.options import Options
from panostitch.synthetic.score import View

Pixels = NDArray[np.uint8]

OURS, RIVAL = "panostitch", "cv2.Stitcher"  # and HUGIN
DONE = "done"
STATUS_WORDS = {
    1: "need more images: too few photos overlap",
    2: "homography estimation failed",
    3: "camera parameters adjusting failed",
}  # cv2.Stitcher::Status
LOG_LINES = 30
TASK, OUTCOME, LOG, PICTURE = "task.pickle", "outcome.pickle", "log.txt", "panorama.npy"

# -P, so that a file cv2.py in the folder where the user stands is not taken for OpenCV
COMMAND = (sys.executable, "-P", "-c", "import sys; from panostitch.jobs.contender import main; main(sys.argv[1])")

_cv2: Any = cv2  # OpenCV's stubs lack some of what is used here


@dataclass(frozen=True)
class Task:
    """What a program is to do.

    program:   name in PROGRAMS
    threads:   threads at work; None for as many as the program takes by itself
    debug_dir: folder for panostitch's pictures of every stage; may be replaced if `overwrite`
    """

    program: str
    photos: tuple[Photo, ...]
    options: Options
    threads: int | None = None
    debug_dir: str | None = None
    overwrite: bool = False


@dataclass(frozen=True)
class Outcome:
    """What a program made of the photos.

    status:         DONE, or in words why there is no panorama
    cameras:        for each photo its camera, None where it was left out; empty if there is no panorama
    size:           (width, height) px of the panorama
    seconds, cpu_seconds: from opening the first photo to the last pixel of the panorama in memory
    peak_megabytes: most memory that the process ever held, its libraries included
    picture:        file of the panorama (h, w, 3) RGB or (h, w, 4) RGBA uint8, an array of NumPy's; empty without one
    alignment:      ours only, and only of what succeeded
    error:          ours only: the failure that is the user's to mend
    log:            last lines of what the program said
    """

    program: str
    version: str
    status: str
    cameras: tuple[View | None, ...] = ()
    size: tuple[int, int] | None = None
    seconds: float | None = None
    cpu_seconds: float | None = None
    peak_megabytes: float | None = None
    picture: str = ""
    alignment: Alignment | None = None
    error: PanostitchError | None = None
    log: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Work:
    """What a program gives back: a panorama, or the words that say why there is none."""

    status: str
    cameras: tuple[View | None, ...] = ()
    pixels: Pixels | None = field(default=None, repr=False)
    alignment: Alignment | None = None


# ---- the parent's side


def run_apart(task: Task, folder: str | Path) -> Outcome:
    """Run a program in a fresh process, with this existing, empty folder as the place where it may leave files."""
    home = Path(folder)
    (home / TASK).write_bytes(pickle.dumps(task))
    start = time.perf_counter()
    with (home / LOG).open("wb") as log:
        process = subprocess.Popen([*COMMAND, str(home)], stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        try:
            code = process.wait()
        finally:
            if process.poll() is None:  # the user interrupts us: the child must not work on
                process.kill()
                process.wait()
    if code == -signal.SIGINT:
        raise KeyboardInterrupt
    said = tuple((home / LOG).read_text(errors="replace").strip().splitlines()[-LOG_LINES:])
    if code == 0 and (home / OUTCOME).exists():
        outcome: Outcome = pickle.loads((home / OUTCOME).read_bytes())
        return replace(outcome, log=said)
    return Outcome(
        task.program, version_of(task.program), _last_words(code), seconds=time.perf_counter() - start, log=said
    )


def _last_words(code: int) -> str:
    """In words, how a process ended that left no outcome."""
    if code >= 0:
        return f"stopped with code {code}"
    name = signal.strsignal(-code) or f"signal {-code}"
    return f"crashed: {name.lower()}" + (", perhaps for want of memory" if code == -signal.SIGKILL else "")


def version_of(program: str) -> str:
    """Version of a contender."""
    if program == HUGIN:
        return hugin_version()
    return cv2.__version__ if program == RIVAL else importlib.metadata.version("panostitch")


# ---- the child's side


def main(folder: str) -> None:
    """Do the task in the folder. The process's whole life."""
    # at once and without a traceback, also in the midst of OpenCV
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    home = Path(folder)
    task: Task = pickle.loads((home / TASK).read_bytes())
    for library in LIBRARIES[task.program]:
        importlib.import_module(library)
    error = None
    wall, cpu = time.perf_counter(), cpu_seconds()
    try:
        work = PROGRAMS[task.program](task)
    except PanostitchError as failure:
        work, error = _Work(failure.message), failure
    outcome = Outcome(
        task.program,
        version_of(task.program),
        work.status,
        work.cameras,
        seconds=time.perf_counter() - wall,
        cpu_seconds=cpu_seconds() - cpu,
        peak_megabytes=peak_megabytes(),
        alignment=work.alignment,
        error=error,
    )
    if work.pixels is not None:
        height, width = work.pixels.shape[:2]
        np.save(home / PICTURE, work.pixels)
        outcome = replace(outcome, size=(width, height), picture=str(home / PICTURE))
    (home / OUTCOME).write_bytes(pickle.dumps(outcome))


def cpu_seconds() -> float:
    """Seconds of processors that this process has used, with the programs it has run."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def peak_megabytes() -> float | None:
    """Most memory (MB) that this process, or a program that it has run, ever held; None where nobody tells.

    Linux hands `ru_maxrss` on from the parent through fork and exec; VmHWM begins anew with the program.
    """
    try:
        import resource
    except ImportError:  # Windows
        return None
    unit = 1 if sys.platform == "darwin" else 1024
    who = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    own, run = (resource.getrusage(which).ru_maxrss * unit / 1e6 for which in who)
    try:
        status = Path("/proc/self/status").read_text()
        own = int(status.split("VmHWM:")[1].split()[0]) * 1024 / 1e6
    except (OSError, IndexError, ValueError):
        pass
    return max(own, run)


def _ours(task: Task) -> _Work:
    """Both halves of panostitch."""
    from panostitch import pipeline
    from panostitch.io.writers import assemble
    from panostitch.runtime.executor import Executor
    from panostitch.runtime.trace import silent

    run = Executor(task.threads or cv2.getNumberOfCPUs())
    with _dump(task) if task.debug_dir else nullcontext(silent) as trace:
        alignment = pipeline.align(task.photos, task.options, run=run, trace=trace)
        pixels, mask = assemble(pipeline.render(alignment, task.options, run=run, trace=trace), run=run)
    if not mask.all():
        pixels = np.dstack([pixels, mask])
    cameras = {photo.name: camera for photo, camera in zip(alignment.photos, alignment.cameras, strict=True)}
    return _Work(DONE, tuple(cameras.get(photo.name) for photo in task.photos), pixels, alignment)


def _dump(task: Task) -> Any:
    from panostitch.debug.dump import Dump

    return Dump(str(task.debug_dir), overwrite=task.overwrite)


def _rival(task: Task) -> _Work:
    """cv2.Stitcher for panoramas, all as it comes but OpenCL, which is none of these processors' business."""
    _cv2.ocl.setUseOpenCL(False)
    if task.threads:
        cv2.setNumThreads(task.threads)
    read = [_as_opencv_reads(photo) for photo in task.photos]
    given = [n for n, pixels in enumerate(read) if pixels is not None]
    stitcher = _cv2.Stitcher.create(_cv2.Stitcher_PANORAMA)
    try:
        code = stitcher.estimateTransform([read[n] for n in given])
        if code == _cv2.Stitcher_OK:
            code, picture = stitcher.composePanorama()
    except cv2.error as error:
        traceback.print_exc()
        return _Work(f"raised an error: {error.err or error}")
    if code != _cv2.Stitcher_OK:
        return _Work(STATUS_WORDS.get(code, f"failed with code {code}"))
    included = [given[int(n)] for n in np.ravel(stitcher.component())]
    sizes = [task.photos[n].size for n in included]
    found = dict(zip(included, rival_cameras(stitcher.cameras(), stitcher.workScale(), sizes), strict=True))
    pixels = np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), np.uint8)
    return _Work(DONE, tuple(found.get(n) for n in range(len(task.photos))), pixels)


def _hugin(task: Task) -> _Work:
    """Hugin's tools as its assistant runs them; photos that it cannot join to the others are left away, as users do."""
    threads = task.threads or cv2.getNumberOfCPUs()
    given = list(range(len(task.photos)))
    try:
        while True:
            with tempfile.TemporaryDirectory() as folder:
                found = run_hugin([task.photos[n] for n in given], folder, threads=threads).plain
                joined = [n for n, camera in zip(given, found, strict=True) if camera]
                if len(joined) < 2:
                    return _Work("no two photos are joined by control points")
                if joined == given:
                    cameras = dict(zip(given, found, strict=True))
                    return _Work(DONE, tuple(map(cameras.get, range(len(task.photos)))), stitch_hugin(folder))
            given = joined
    except HuginError as error:
        return _Work(str(error))


def _as_opencv_reads(photo: Photo) -> Pixels | None:
    """A photo (h, w, 3) BGR as users of OpenCV read it, by our reader where that fails; None if it is broken."""
    pixels = cv2.imread(photo.path) if photo.path else None
    if pixels is not None and pixels.shape[1::-1] == photo.size:
        return np.asarray(pixels, np.uint8)
    try:
        return np.ascontiguousarray(photo.source.read()[0][..., ::-1])
    except InputError:
        return None


def rival_cameras(estimated: Sequence[Any], work_scale: float, sizes: Sequence[tuple[int, int]]) -> list[Camera]:
    """cv2.detail.CameraParams, which belong to photos reduced by `work_scale`, as our cameras of the full photos.

    Their R is world_from_cam; OpenCV warps with its transpose, not its inverse, so that is what counts where rounding
    has left it a little off a rotation.
    """
    cameras = []
    for camera, size in zip(estimated, sizes, strict=True):
        x, y = rescale(np.array([camera.ppx, camera.ppy]), 1 / work_scale)
        cam_from_world = np.asarray(camera.R, np.float64).T
        cameras.append(Camera(size, float(camera.focal) / work_scale, (float(x), float(y)), cam_from_world))
    return cameras


PROGRAMS: dict[str, Callable[[Task], _Work]] = {RIVAL: _rival, HUGIN: _hugin, OURS: _ours}

# loaded before the clock starts; not by every child, as they would count as the other program's memory
LIBRARIES: dict[str, tuple[str, ...]] = {RIVAL: (), HUGIN: (), OURS: ("panostitch.pipeline", "panostitch.io.writers")}
