"""Files that are written whole or not at all."""

import os
import secrets
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from panostitch.errors import OutputError


@contextmanager
def replacing(path: str) -> Iterator[IO[bytes]]:
    """A file to write and read, which takes the place of `path` when the block ends without an error.

    Where the system knows files without a name (Linux) it has none until then: even a killed run leaves nothing.
    Elsewhere it has a temporary name, which only a kill leaves behind. Raises OutputError.
    """
    target = Path(path)
    temporary = target.with_name(f".{target.name[:40]}.{secrets.token_hex(4)}")
    try:
        with _nameless(temporary) or _named(temporary) as file:
            yield file
            file.flush()
            if not temporary.exists():
                _give_name(file, temporary)
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, target)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from None
    finally:
        temporary.unlink(missing_ok=True)


def write_bytes(path: str, data: Any) -> None:
    """Write a file whole or not at all. Raises OutputError."""
    with replacing(path) as file:
        file.write(data)


def scratch(path: str) -> IO[bytes]:
    """A file beside `path` that is gone when it is closed."""
    return tempfile.TemporaryFile(dir=Path(path).parent)


def _nameless(path: Path) -> IO[bytes] | None:
    """A file without a name that can be given this one; None where there are no such files."""
    if not hasattr(os, "O_TMPFILE") or not os.path.isdir("/proc/self/fd"):
        return None
    try:
        return _opened(path, path.parent, os.O_TMPFILE | os.O_RDWR)
    except OSError:  # not every file system has them; what else is wrong is said when a name is tried
        return None


def _named(path: Path) -> IO[bytes]:
    return _opened(path, path, os.O_CREAT | os.O_EXCL | os.O_RDWR | getattr(os, "O_BINARY", 0))


def _opened(name: Path, real: Path, flags: int) -> IO[bytes]:
    return open(name, "w+b", opener=lambda *_: os.open(real, flags | getattr(os, "O_CLOEXEC", 0), 0o600))


def _give_name(file: IO[bytes], path: Path) -> None:
    # without the descriptor of a folder, Python calls link(2), which does not follow the symbolic link
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.link(f"/proc/self/fd/{file.fileno()}", path, src_dir_fd=folder, follow_symlinks=True)
    finally:
        os.close(folder)


def _umask() -> int:
    """The process's umask, under which temporary files are not made."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask
