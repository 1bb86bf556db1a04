"""Lines for people and JSON for scripts. Needs nothing that has to be loaded, so that it works where that fails."""

import json
import sys
from collections.abc import Sequence
from typing import Any

import click

from panostitch.errors import PanostitchError


def printable(text: str) -> str:
    """Text of files and metadata without control characters, which could rewrite the terminal."""
    return "".join(c if c.isprintable() else "?" for c in text)


def say(text: str) -> None:
    """A line on standard error."""
    click.echo(printable(text), err=True)


def show(text: str) -> None:
    """A line on standard output, of commands that make nothing else."""
    click.echo(printable(text))


def say_error(error: PanostitchError) -> None:
    """One line that says what, which file and why; below it the evidence and the next thing to try."""
    say(f"error: {error.message}")
    for line in error.details:
        say(f"  {line}")
    if error.hint:
        say(f"  next: {error.hint}")


def say_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Rows in aligned columns under a head; columns of numbers stand to the right."""
    columns = list(zip(head, *rows, strict=True))
    widths = [max(map(len, column)) for column in columns]
    numeric = [all(cell[:1].isdigit() or cell in ("-", "inf") for cell in column[1:]) for column in columns]
    for row in (head, *rows):
        cells = (
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(row, widths, numeric, strict=True)
        )
        say("  ".join(cells).rstrip())


def show_facts(facts: Sequence[tuple[str, str]]) -> None:
    """Names and what is to be said of each, side by side on standard output."""
    width = max((len(name) for name, _ in facts), default=0)
    for name, text in facts:
        show(f"{name.ljust(width)}  {text}".rstrip())


def print_json(data: Any) -> None:
    """JSON on standard output."""
    json.dump(data, sys.stdout, indent=1)
    sys.stdout.write("\n")
