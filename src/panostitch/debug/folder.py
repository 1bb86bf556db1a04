"""The folder of a dump: what may be written and removed there.

The rule is that no file is ever lost that a dump has not made itself: files of an earlier dump are known by the list
in its metrics.json.
"""

import json
import os
from pathlib import Path, PurePosixPath

from panostitch.errors import OutputError

FORMAT = "panostitch debug dump"
FORMAT_VERSION = 1
METRICS = "metrics.json"

FEATURES = "01_features"
MATCHES = "02_matches"
LINKS = "03_links"
ALIGNMENT = "04_alignment"
WARPED = "05_warped"
EXPOSURE = "06_exposure"
SEAMS = "07_seams"
BLEND = "08_blend"
CROP = "09_crop"
PANORAMA = "10_panorama"
SUBFOLDERS = (FEATURES, MATCHES, LINKS, ALIGNMENT, WARPED, EXPOSURE, SEAMS, BLEND, CROP, PANORAMA)
SUFFIXES = (".jpg", ".png")


class Folder:
    """A folder that is ours to write to; `files` are the paths written so far, relative to it."""

    def __init__(self, root: str | Path, *, overwrite: bool = False) -> None:
        """Make the folder, or take it over. Raises OutputError if it cannot be had or holds something."""
        self.root = Path(root)
        self.files: list[str] = []
        try:
            self.root.mkdir(parents=True, exist_ok=True)
            if any(self.root.iterdir()):
                if not overwrite:
                    raise OutputError(
                        f"debug folder is not empty: {self.root}", hint="choose an empty folder or add --overwrite"
                    )
                self._clear()
            self.write_metrics(json.dumps({"format": FORMAT, "version": FORMAT_VERSION, "files": []}))
        except OSError as error:
            raise OutputError(
                f"cannot write to the debug folder {self.root}: {error.strerror or error}",
                hint="choose a folder that you may write to",
            ) from error

    def write(self, relative: str, data: bytes) -> None:
        """Write a file, replacing one of this dump but no other. Raises OSError."""
        path = self.root / relative
        path.parent.mkdir(exist_ok=True)
        ours = relative in self.files
        try:
            with path.open("wb" if ours else "xb") as file:
                if not ours:
                    self.files.append(relative)
                file.write(data)
        except FileExistsError as error:
            raise FileExistsError(f"{relative} exists and no dump has made it; it was left as it is") from error

    def remove(self, relative: str) -> None:
        """Remove a file that this dump has written; others are left alone. Raises OSError."""
        if relative in self.files:
            (self.root / relative).unlink(missing_ok=True)
            self.files.remove(relative)

    def write_metrics(self, text: str) -> None:
        """Replace metrics.json as a whole, so that a reader never sees half of it. Raises OSError."""
        part = self.root / (METRICS + ".part")
        part.write_text(text + "\n", encoding="utf-8")
        os.replace(part, self.root / METRICS)

    def _clear(self) -> None:
        """Remove the files that the metrics.json of an earlier dump lists, and folders that become empty by it."""
        for relative in self._earlier_files():
            if _is_picture_of_a_dump(relative) and not (self.root / relative).parent.is_symlink():
                (self.root / relative).unlink(missing_ok=True)
        for name in SUBFOLDERS:
            path = self.root / name
            if path.is_dir() and not path.is_symlink() and not any(path.iterdir()):
                path.rmdir()

    def _earlier_files(self) -> list[str]:
        path = self.root / METRICS
        if not path.exists():
            return []
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
        except ValueError:
            data = None
        if not isinstance(data, dict) or data.get("format") != FORMAT or not isinstance(data.get("files"), list):
            raise OutputError(
                f"{path} is not from a debug dump of panostitch, and would be replaced", hint="choose an empty folder"
            )
        return [name for name in data["files"] if isinstance(name, str)]


def _is_picture_of_a_dump(relative: str) -> bool:
    """Whether a dump could have written this path: a list that somebody has edited must not reach further."""
    parts = PurePosixPath(relative).parts
    return (
        len(parts) == 2 and parts[0] in SUBFOLDERS and relative.endswith(SUFFIXES) and not set(relative) & set("\\:\0")
    )
