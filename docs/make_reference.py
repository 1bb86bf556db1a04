"""Write docs/reference/options.md and docs/reference/exit-codes.md from the program itself: `make docs`.

With --check nothing is written; it exits 1 where a page is not current.
"""

import argparse
import dataclasses
import sys
from pathlib import Path
from typing import Literal, get_args, get_origin

from panostitch import errors
from panostitch.options import Options

FOLDER = Path(__file__).parent / "reference"
MADE_BY = "<!-- made by docs/make_reference.py; change the program, not this page -->"


def options_page() -> str:
    """A table for each stage, from the dataclasses of options."""
    lines = ["# Options", "", MADE_BY, "", "Each stage has its own. `panostitch COMMAND --help` lists those it takes."]
    for part in dataclasses.fields(Options):
        stage = part.default
        lines += ["", f"## {type(stage).__doc__.splitlines()[0]}", "", "| option | meaning | values | default |"]
        lines.append("|---|---|---|---|")
        for field in dataclasses.fields(stage):
            name = "--" + field.name.replace("_", "-")
            lines.append(f"| `{name}` | {field.metadata['help']} | {_values(field)} | {_default(field)} |")
    return "\n".join(lines) + "\n"


def _values(field: dataclasses.Field) -> str:
    if get_origin(field.type) is Literal:
        return ", ".join(f"`{value}`" for value in get_args(field.type))
    if field.metadata["min"] is None:
        return "text"
    return f"{field.metadata['min']:g} to {field.metadata['max']:g}"


def _default(field: dataclasses.Field) -> str:
    return "" if field.default is None else f"`{field.default}`"


def exit_codes_page() -> str:
    """The exit codes, from the tree of errors."""
    rows = {
        errors.EXIT_OK: "every photo is in the panorama",
        errors.EXIT_BUG: "a bug, or a failed selftest; a bug says where its log lies",
        errors.EXIT_LEFT_OUT: "the panorama is written, but photos were left out or could not be read; each is named "
        "with the reason (0 with `--allow-partial`)",
        errors.EXIT_BATCH_FAILED: "batch: some panoramas failed; the table and `--json` have the code of each",
        errors.EXIT_DAMAGED: "the installation is damaged; `panostitch doctor` says what to do",
        errors.EXIT_INTERRUPTED: "interrupted",
        errors.EXIT_PIPE: "who read the output went away before its end",
    }
    for error in errors.PanostitchError.__subclasses__():
        rows[error.exit_code] = error.__doc__.splitlines()[0].rstrip(".")
    lines = ["# Exit codes", "", MADE_BY, "", "| code | meaning |", "|---|---|"]
    lines += [f"| {code} | {text[0].lower() + text[1:]} |" for code, text in sorted(rows.items())]
    return "\n".join(lines) + "\n"


PAGES = {"options.md": options_page, "exit-codes.md": exit_codes_page}


def main() -> None:
    """Write the pages, or check them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true")
    check = parser.parse_args().check
    stale = [name for name, page in PAGES.items() if _text(FOLDER / name) != page()]
    for name in stale:
        if not check:
            (FOLDER / name).write_text(PAGES[name]())
    if check and stale:
        sys.exit(f"not current: {', '.join(stale)}; run `make docs`")


def _text(path: Path) -> str:
    return path.read_text() if path.exists() else ""


if __name__ == "__main__":
    main()
