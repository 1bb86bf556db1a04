"""A panorama of every sub-folder of a folder; a failure ends one panorama, never the batch."""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from panostitch import pipeline
from panostitch.errors import EXIT_BATCH_FAILED, EXIT_LEFT_OUT, EXIT_OK, InputError, PanostitchError
from panostitch.io.readers import open_photos, photos_in
from panostitch.io.writers import check_output, write_panorama
from panostitch.model.alignment import LeftOut
from panostitch.model.photo import natural_key
from panostitch.options import Options
from panostitch.runtime.executor import Executor
from panostitch.runtime.trace import Trace, silent


@dataclass(frozen=True)
class Task:
    """A folder of photos, and the name of the panorama it becomes."""

    name: str
    photos: tuple[str, ...]


@dataclass(frozen=True)
class Outcome:
    """What became of one panorama.

    photos, given: how many photos are in it, and how many there were
    path:          where it lies; empty if it failed
    exit_code:     what `panostitch` alone would have ended with
    message:       what went wrong, empty if nothing did
    depth, notes:  bits of a channel in the file, and what is to be known of it
    """

    name: str
    given: int
    seconds: float
    exit_code: int = EXIT_OK
    message: str = ""
    photos: int = 0
    path: str = ""
    size: tuple[int, int] = (0, 0)
    left_out: tuple[LeftOut, ...] = ()
    depth: int = 0
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Setting:
    """What all panoramas of a batch have in common.

    output:    folder for the panoramas
    extension: of their names, .jpg for example
    tracer:    from a panorama's name to a trace for it, closed when it is done
    require_all: make no panorama of a folder of which photos are left over
    """

    output: str
    extension: str
    overwrite: bool
    options: Options
    run: Executor
    tracer: Callable[[str], AbstractContextManager[Trace]]
    require_all: bool = False


def find_tasks(folder: str) -> list[Task]:
    """The folder's own photos and those of each sub-folder, in natural order. Raises InputError if there are none."""
    if not os.path.isdir(folder):
        raise InputError(f"{folder}: no such folder")
    subfolders = sorted((e.path for e in os.scandir(folder) if e.is_dir()), key=natural_key)
    places = [folder, *(place for place in subfolders if not os.path.basename(place).startswith("."))]
    tasks = [Task(Path(place).resolve().name, tuple(photos_in(place))) for place in places if photos_in(place)]
    if not tasks:
        raise InputError(f"{folder}: no photos in it or in its sub-folders")
    return tasks


def run_batch(tasks: Sequence[Task], setting: Setting, tell: Callable[[Outcome], None]) -> list[Outcome]:
    """Panoramas of all tasks; `tell` hears of each as soon as it is done.

    A folder that holds several panoramas becomes NAME, NAME-2, NAME-3 ...
    """
    outcomes = []
    for task in tasks:
        for outcome in _panoramas(task, setting):
            tell(outcome)
            outcomes.append(outcome)
    return outcomes


def batch_exit_code(outcomes: Sequence[Outcome], *, allow_partial: bool = False) -> int:
    """10 if any panorama failed, 3 if photos were left out of some and may not be, else 0."""
    if any(outcome.exit_code not in (EXIT_OK, EXIT_LEFT_OUT) for outcome in outcomes):
        return EXIT_BATCH_FAILED
    partial = any(outcome.exit_code for outcome in outcomes) and not allow_partial
    return EXIT_LEFT_OUT if partial else EXIT_OK


def _panoramas(task: Task, setting: Setting) -> Iterator[Outcome]:
    """All panoramas of one folder."""
    start = time.perf_counter()
    try:
        with setting.tracer(task.name) as trace:
            photos, failures = open_photos(task.photos)
            if failures and len(photos) < 2:
                raise failures[0]
            unreadable = [LeftOut.unreadable(error) for error in failures]
            recognition = pipeline.recognise(
                photos, setting.options, unreadable=unreadable, run=setting.run, trace=trace
            )
            if not recognition.groups.panoramas:
                raise pipeline.no_overlap(recognition)
            if setting.require_all:
                pipeline.check_all_in(_in_no_panorama(recognition))
            yield _panorama(task, recognition, 0, setting, start, trace)
    except PanostitchError as error:
        yield _failed(task.name, task, error, start)
        return
    for number in range(1, len(recognition.groups.panoramas)):
        yield _panorama(task, recognition, number, setting, time.perf_counter(), silent)


def _panorama(
    task: Task, recognition: pipeline.Recognition, number: int, setting: Setting, start: float, trace: Trace
) -> Outcome:
    """One panorama of a folder; what belongs to none is reported with the first."""
    name = task.name if number == 0 else f"{task.name}-{number + 1}"
    path = os.path.join(setting.output, name + setting.extension)
    try:
        check_output(path, overwrite=setting.overwrite, inputs=task.photos)
        alignment = pipeline.align_panorama(recognition, number, setting.options, run=setting.run, trace=trace)
        panorama = pipeline.render(alignment, setting.options, run=setting.run, trace=trace)
        written = write_panorama(panorama, path, setting.options.output, run=setting.run, trace=trace)
    except PanostitchError as error:
        return _failed(name, task, error, start)
    left_out = tuple(_in_no_panorama(recognition)) if number == 0 else ()
    return Outcome(
        name,
        given=len(task.photos),
        seconds=time.perf_counter() - start,
        exit_code=EXIT_LEFT_OUT if left_out else EXIT_OK,
        photos=len(alignment.photos),
        path=path,
        size=(panorama.plan.crop.width, panorama.plan.crop.height),
        left_out=left_out,
        depth=written.depth,
        notes=written.notes,
    )


def _in_no_panorama(recognition: pipeline.Recognition) -> list[LeftOut]:
    return pipeline.left_out(recognition, [photo for group in recognition.groups.panoramas for photo in group])


def _failed(name: str, task: Task, error: PanostitchError, start: float) -> Outcome:
    return Outcome(name, len(task.photos), time.perf_counter() - start, error.exit_code, error.message)
