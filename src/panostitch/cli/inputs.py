"""What the user may name: files, folders, globs, @list.txt, - for a list on standard input."""

import glob
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from panostitch.errors import InputError, UsageError


def photo_paths(arguments: Sequence[str]) -> list[str]:
    """Paths of all photos named. Raises InputError naming every file that does not exist, UsageError for none."""
    from panostitch.io.readers import EXTENSIONS

    paths = [path for argument in arguments for path in _expand(argument, EXTENSIONS)]
    missing = [path for path in paths if not os.path.exists(path)]
    if missing:
        raise InputError(
            f"{missing[0]}: no such file" + (f" (and {len(missing) - 1} more)" if len(missing) > 1 else ""),
            details=tuple(f"{path}: no such file" for path in missing[1:]),
            hint="check the spelling; nothing has been done",
        )
    if not paths:
        raise UsageError(f"no photos in {', '.join(arguments)}" if arguments else "no photos given")
    return paths


def _expand(argument: str, extensions: frozenset[str]) -> Iterator[str]:
    if argument == "-":
        yield from _lines(sys.stdin.read())
    elif argument.startswith("@") and not os.path.exists(argument):
        yield from _from_list(argument[1:])
    elif os.path.isdir(argument):
        yield from photos_in(argument, extensions)
    elif any(c in argument for c in "*?[") and not os.path.exists(argument):
        yield from sorted(glob.glob(argument)) or [argument]
    else:
        yield argument


def photos_in(folder: str, extensions: frozenset[str]) -> list[str]:
    """Photos in a folder by their extension; hidden files are none."""
    return sorted(
        entry.path
        for entry in os.scandir(folder)
        if entry.is_file() and not entry.name.startswith(".") and Path(entry.name).suffix.lower() in extensions
    )


def _from_list(path: str) -> list[str]:
    """Paths in a text file, one a line, relative to the file."""
    try:
        text = Path(path).read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    return [os.path.join(os.path.dirname(path), line) for line in _lines(text)]


def _lines(text: str) -> list[str]:
    return [line.strip() for line in text.splitlines() if line.strip()]
