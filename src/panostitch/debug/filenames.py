"""File names for photos: short, safe on every system, and different for different photos."""

import re
import unicodedata

LONGEST_BYTES = 80  # two names and a suffix stay under the 255 bytes that file systems allow
_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)  # devices on Windows


def clean(name: str) -> str:
    """A file name without suffix made of a photo's name: no separators, no leading dot, no `--`."""
    stem = re.sub(r"\.[A-Za-z0-9]{2,5}$", "", unicodedata.normalize("NFC", name))
    safe = "".join(c if c.isalnum() or c in "_-." else "_" for c in stem)
    # `--` is what joins the names of a pair, so it may not be part of one
    safe = re.sub(r"([_.-])\1+", r"\1", safe).strip("-._")
    safe = safe.encode("utf-8")[:LONGEST_BYTES].decode("utf-8", errors="ignore").rstrip("-._")
    if _RESERVED.fullmatch(safe):
        safe += "_"
    return safe or "photo"


class FileNames:
    """Gives every photo name a file name of its own, always the same one."""

    def __init__(self) -> None:
        self._given: dict[str, str] = {}
        self._taken: set[str] = set()

    def of(self, name: str) -> str:
        """The file name, without suffix, of the photo with this name."""
        if name not in self._given:
            stem = candidate = clean(name)
            number = 1
            # file systems may not tell upper case from lower case
            while _folded(candidate) in self._taken:
                number += 1
                candidate = f"{stem}_{number}"
            self._taken.add(_folded(candidate))
            self._given[name] = candidate
        return self._given[name]


def _folded(stem: str) -> str:
    return unicodedata.normalize("NFKC", stem).casefold()
