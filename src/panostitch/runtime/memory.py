"""How much memory a run takes, and how many threads fit below a limit."""

import ctypes
import os
from contextlib import suppress
from dataclasses import replace

from panostitch.errors import LimitError
from panostitch.runtime.executor import Executor

STATM = "/proc/self/statm"
UNKNOWN = 256 << 20  # bytes that the program itself takes, where the system does not tell
# Of glibc (malloc.h): M_MMAP_THRESHOLD, at the most it takes, and M_TRIM_THRESHOLD
MALLOC = ((-3, 32 << 20), (-1, 64 << 20))
SLACK = 1.15  # what is freed does not all go back to the system


def resident() -> int:
    """Bytes of memory that this process holds now."""
    try:
        with open(STATM) as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError, AttributeError):
        return UNKNOWN


def keep_freed() -> None:
    """Let the C library keep what is freed for what comes next, for the life of this process, but for `give_back`.

    As it comes it returns every large array at once, and half of the time goes into asking for its pages again.
    """
    with suppress(OSError, AttributeError):  # not every system has glibc
        for parameter, size in MALLOC:
            ctypes.CDLL(None).mallopt(parameter, size)


def give_back() -> None:
    """Return to the system what was freed: the C library keeps it for each thread, and little of it is used again."""
    with suppress(OSError, AttributeError):  # not every system has glibc
        ctypes.CDLL(None).malloc_trim(0)


def threads_within(limit: int, *, each: int, besides: int = 0) -> int:
    """How many threads that take so much `each` fit below a limit; 0 where not a single one does."""
    return max(0, int((limit / SLACK - resident() - besides) // max(each, 1)))


def within(run: Executor, limit: int | None, *, each: int, besides: int = 0, hint: str = "") -> Executor:
    """An executor with as few threads as the limit demands.

    each:    bytes that a call takes while it runs
    besides: bytes that will be held besides

    Raises LimitError where the limit leaves no room for a single thread.
    """
    if limit is None:
        return run
    threads = threads_within(limit, each=each, besides=besides)
    if threads < 1:
        needed = (resident() + besides + each) * SLACK
        raise LimitError(
            f"{in_words(needed)} of memory are needed, --max-memory is {in_words(limit)}",
            hint=hint or "allow more with --max-memory, or make it smaller with --scale",
        )
    return replace(run, threads=min(run.threads, threads))


def in_words(count: float) -> str:
    """A number of bytes as --max-memory takes it: 640M, 1.5G."""
    return f"{-(-count // 2**20):.0f}M" if count < 2**30 else f"{count / 2**30:.1f}G"
