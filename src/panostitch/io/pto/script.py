"""The text of a .pto file, taken to pieces: lines of words, a word is a name and a value, `=3` is that of image 3."""

import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from panostitch.errors import InputError

MAX_BYTES = 64 << 20
HUGE = 1e7  # no length, angle or number of pixels is larger
WORD = re.compile(r"([A-Za-z]+)(\S*)")

Words = dict[str, str]


@dataclass(frozen=True)
class Script:
    """images, points: the words of the i- and c-lines; off: images that are switched off; masked: whether any is cut"""

    images: tuple[Words, ...]
    points: tuple[Words, ...]
    off: frozenset[int]
    masked: bool

    def number(self, image: int, name: str, default: float | None = None) -> float:
        """A parameter of an image, wherever it is linked to. Raises ValueError where it is none."""
        seen = image
        for _ in self.images:
            text = self.images[seen].get(name)
            if text is None:
                break
            if not text.startswith("="):
                return finite(text, name)
            seen = index(text[1:], len(self.images))
        else:
            raise ValueError(f"{name} of image {image} is linked to itself")
        if default is None:
            raise ValueError(f"image {image} has no {name}")
        return default


def read_script(path: str) -> Script:
    """The lines of a file. Raises InputError where it cannot be read, or is no .pto file."""
    try:
        if os.path.isfile(path) and os.path.getsize(path) > MAX_BYTES:
            raise InputError(f"{path}: not a Hugin project: larger than {MAX_BYTES >> 20} MB")
        data = Path(path).read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    script = _parsed(os.fsdecode(data).splitlines() if b"\0" not in data else [])
    if not script.images:
        raise InputError(f"{path}: not a Hugin project: it names no photos")
    return script


def _parsed(lines: Sequence[str]) -> Script:
    images: list[Words] = []
    points: list[Words] = []
    off, masked, comment = [], False, ""
    for line in lines:
        kind, _, rest = line.partition(" ")
        if kind == "i":
            if "disabled" in comment.split():
                off.append(len(images))
            images.append(_words(rest))
            masked |= "S" in images[-1]
        elif kind == "c":
            points.append(_words(rest))
        masked |= kind == "k"
        comment = line if line.startswith("#-hugin") else ""
    return Script(tuple(images), tuple(points), frozenset(off), masked)


def _words(text: str) -> Words:
    """Names and values; of a name that comes twice the first one, as in Hugin."""
    name = re.search(r'(?:^|\s)n"([^"]*)"', text)
    rest = text if name is None else text[: name.start()] + " " + text[name.end() :]
    found = {"n": name[1]} if name else {}
    for word in rest.split():
        pieces = WORD.fullmatch(word)
        if pieces and not pieces[2].startswith('"'):
            found.setdefault(pieces[1], pieces[2])
    return found


def finite(text: str, name: str) -> float:
    """A number of sensible size. Raises ValueError."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not abs(number) <= HUGE:
        raise ValueError(f"{name} is {text[:20]!r}")
    return number


def index(text: str, count: int) -> int:
    """The number of an image. Raises ValueError."""
    if not (text.isascii() and text.isdigit() and len(text) < 10 and int(text) < count):
        raise ValueError(f"there is no image {text[:20]!r}")
    return int(text)
