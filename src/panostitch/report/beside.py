"""Panoramas that several programs made of the same photos, as the page shows them."""

from collections.abc import Sequence
from dataclasses import dataclass

from panostitch.debug.ink import Picture


@dataclass(frozen=True)
class Table:
    """A head and rows of text; the first column names the program."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Panorama:
    """What one program made; `picture` (h, w, 3) is None where it made none, `words` say what is to be known."""

    program: str
    picture: Picture | None
    words: str


@dataclass(frozen=True)
class Beside:
    """All programs, with what they cost and how good they are."""

    tables: Sequence[Table]
    panoramas: Sequence[Panorama]
