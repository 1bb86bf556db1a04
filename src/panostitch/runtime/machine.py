"""What the machine gives this process: processors and memory, after the limits that containers set."""

import os
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

CGROUPS = Path("/sys/fs/cgroup")
OWN_GROUPS = Path("/proc/self/cgroup")
MEMINFO = Path("/proc/meminfo")
NO_LIMIT = 1 << 60  # bytes; the first version of cgroups has no word for "none", only such numbers


def processors() -> int:
    """Processors on which this process may run."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on this system
        return os.cpu_count() or 1


def threads() -> int:
    """Threads that find work to do: a processor for each, and no more than the container gives time for."""
    quota = processor_quota()
    return processors() if quota is None else max(1, min(processors(), int(quota)))


def processor_quota() -> float | None:
    """Processors' worth of time that the container allows; None without a limit."""
    quotas = []
    for folder in _groups("cpu"):
        words = (_text(folder / "cpu.max") or _old_quota(folder)).split()
        if len(words) == 2 and all(word.isdigit() for word in words) and int(words[1]):
            quotas.append(int(words[0]) / int(words[1]))
    return min(quotas, default=None)


def memory() -> tuple[int | None, int | None]:
    """Bytes of memory in all, and those that could be had now; None where the system does not tell."""
    sizes = dict(line.split(":", 1) for line in _text(MEMINFO).splitlines() if ":" in line)
    total, available = (
        int(words[0]) * 1024 if (words := sizes.get(name, "").split()) and words[0].isdigit() else None
        for name in ("MemTotal", "MemAvailable")
    )
    return total or _physical(), available


def memory_limit() -> int | None:
    """Bytes of memory that the container allows; None without a limit."""
    limits = []
    for folder in _groups("memory"):
        text = _text(folder / "memory.max") or _text(folder / "memory.limit_in_bytes")
        if text.isdigit() and int(text) < NO_LIMIT:
            limits.append(int(text))
    return min(limits, default=None)


def _groups(controller: str) -> Iterator[Path]:
    """The folders of the group of this process and of those it belongs to, in either version of cgroups.

    https://www.kernel.org/doc/html/latest/admin-guide/cgroup-v2.html
    """
    for line in _text(OWN_GROUPS).splitlines():
        number, _, rest = line.partition(":")
        controllers, _, place = rest.partition(":")
        if number == "0" or controller in controllers.split(","):
            root = CGROUPS if number == "0" else CGROUPS / controller
            inner = PurePosixPath(place.lstrip("/"))
            yield from dict.fromkeys((root / inner, *(root / outer for outer in inner.parents)))


def _old_quota(folder: Path) -> str:
    return f"{_text(folder / 'cpu.cfs_quota_us')} {_text(folder / 'cpu.cfs_period_us')}"


def _physical() -> int | None:
    try:
        size = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None
    return size if size > 0 else None


def _text(path: Path) -> str:
    try:
        return path.read_text().strip()
    except (OSError, ValueError):
        return ""
