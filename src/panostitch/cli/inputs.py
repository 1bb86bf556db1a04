"""What the user may name: files, folders, globs, @list.txt, - for a list on standard input."""

import difflib
import glob
import os
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from panostitch.errors import InputError, UsageError


def photo_paths(arguments: Sequence[str]) -> list[str]:
    """Paths of all photos named. Raises InputError naming every file that does not exist, UsageError for none."""
    paths = [path for argument in arguments for path in _expand(argument)]
    missing = [path for path in paths if not os.path.exists(path)]
    if missing:
        raise InputError(
            f"{missing[0]}: no such file" + (f" (and {len(missing) - 1} more)" if len(missing) > 1 else ""),
            details=tuple(f"{path}: no such file" for path in missing[1:]),
            hint="check the spelling; nothing has been done",
        )
    if not paths:
        raise _none_in(arguments) if arguments else UsageError("no photos given")
    return paths


def _none_in(arguments: Sequence[str]) -> UsageError:
    """What to say where the arguments name no photo."""
    from panostitch.io.foreign import remedy
    from panostitch.io.readers import EXTENSIONS, photos_in

    entries = [entry for folder in filter(os.path.isdir, arguments) for entry in os.scandir(folder)]
    extensions = Counter(Path(entry.name).suffix for entry in entries if entry.is_file())
    foreign = next((extension for extension, _ in extensions.most_common() if remedy(extension)), "")
    if foreign:
        hint = f"{extensions[foreign]} files end in {foreign}, which is not read: {remedy(foreign)}"
    elif any(photos_in(entry.path) for entry in entries if entry.is_dir() and os.access(entry, os.R_OK)):
        hint = "there are some in its sub-folders: `panostitch batch` makes a panorama of each"
    else:
        hint = f"photos in a folder end in {', '.join(sorted(EXTENSIONS))}"
    return UsageError(f"no photos in {', '.join(arguments)}", hint=hint)


def without(paths: Sequence[str], names: Sequence[str]) -> list[str]:
    """The paths but for those with these names, or these paths.

    Raises UsageError for a name that none has, and where none is left.
    """
    known = {name for path in paths for name in (path, os.path.basename(path))}
    for name in names:
        if name not in known:
            near = difflib.get_close_matches(name, sorted(known), n=1, cutoff=0.0)
            raise UsageError(
                f"--exclude {name}: no photo has that name", hint=f"the nearest is {near[0]}" if near else ""
            )
    kept = [path for path in paths if not {path, os.path.basename(path)} & set(names)]
    if not kept:
        raise UsageError("--exclude leaves no photo", hint="a panorama needs two or more")
    return kept


def _expand(argument: str) -> Iterator[str]:
    from panostitch.io.readers import photos_in

    if argument == "-":
        yield from _lines(sys.stdin.read())
    elif argument.startswith("@") and not os.path.exists(argument):
        yield from _from_list(argument[1:])
    elif os.path.isdir(argument):
        yield from photos_in(argument)
    elif any(c in argument for c in "*?[") and not os.path.exists(argument):
        found = sorted(glob.glob(argument))
        yield from (path for match in found for path in _expand(match)) if found else [argument]
    else:
        yield argument


def _from_list(path: str) -> list[str]:
    """Paths in a text file, one a line, relative to the file."""
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    return [os.path.join(os.path.dirname(path), line) for line in _lines(text)]


def _lines(text: str) -> list[str]:
    return [line.strip() for line in text.splitlines() if line.strip()]
