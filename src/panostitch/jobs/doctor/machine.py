"""What the machine has: processors, memory, disk."""

import os
import platform
import shutil
import tempfile
from collections.abc import Callable, Iterator
from functools import partial

from panostitch.jobs.doctor.check import Check, Verdict, tried
from panostitch.runtime import machine
from panostitch.runtime.memory import in_words

PART = "machine"
LITTLE_MEMORY = 1 << 30  # bytes; below it, a JPEG of a large panorama may not fit
LITTLE_DISK = 1 << 30  # bytes; a panorama of 200 megapixels as TIFF without compression
# Name, folder, what it means if it cannot be written to, and what to do then.
FOLDERS: tuple[tuple[str, Callable[[], str], Verdict, str], ...] = (
    ("temporary folder", tempfile.gettempdir, "failed", "set TMPDIR to a folder that can be written to"),
    ("this folder", os.getcwd, "note", "write the panorama to another folder"),
)


def system() -> Iterator[Check]:
    """Operating system, processors, memory, and room on disk. Sizes are bytes."""
    yield Check(PART, "system", "ok", platform.platform())
    yield _cores()
    yield _memory()
    for name, folder, closed, remedy in FOLDERS:
        yield tried(PART, name, partial(_room, name, folder, closed, remedy), remedy=remedy)


def vision() -> Iterator[Check]:
    """What OpenCV uses of the processor."""
    import cv2

    line = cv2.getCPUFeaturesLine()
    absent = [word.strip("*?") for word in line.split() if word.endswith("?")]
    used = " ".join(word for word in line.split() if not word.endswith("?"))
    without = f"; {' '.join(absent)} not on this processor, so that OpenCV is slower" if absent else ""
    yield Check(PART, "processor features", "ok", f"{used} (* where it pays){without}", value=used)
    yield Check(PART, "OpenCV", "ok", f"{cv2.__version__}, {cv2.getNumThreads()} threads", value=cv2.getNumThreads())


def _cores() -> Check:
    count, whole, quota = machine.processors(), os.cpu_count() or 1, machine.processor_quota()
    found = f"{count} of {whole} may be used, {platform.machine()}"
    if quota is not None and quota < count:
        found += f"; this container has time of {quota:g} of them"
    return Check(PART, "processors", "ok", found, value=machine.threads())


def _memory() -> Check:
    (total, available), limit = machine.memory(), machine.memory_limit()
    if total is None:
        return Check(PART, "memory", "note", "unknown on this system")
    words = [f"{in_words(total)} in all"]
    if available is not None:
        words.append(f"{in_words(available)} available")
    if limit is not None and limit < total:
        words.append(f"{in_words(limit)} allowed to this container")
    most = min(size for size in (total, available, limit) if size is not None)
    little = most < LITTLE_MEMORY
    remedy = f"use --max-memory {in_words(most * 3 // 4)}" if little else ""
    return Check(PART, "memory", "note" if little else "ok", ", ".join(words), remedy, most)


def _room(name: str, where: Callable[[], str], closed: Verdict, remedy: str) -> Check:
    """Free disk of a folder; `closed` is what it means if nothing can be written there."""
    folder = where()
    free = shutil.disk_usage(folder).free
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        return Check(PART, name, closed, f"{folder} cannot be written to: {error.strerror}", remedy, free)
    little = free < LITTLE_DISK
    return Check(PART, name, "note" if little else "ok", f"{in_words(free)} free in {folder}", value=free)
