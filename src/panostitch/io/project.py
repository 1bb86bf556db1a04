"""The project file: an alignment as JSON. Photos are named relative to it, so that a folder can be moved."""

import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from panostitch.errors import InputError
from panostitch.io.atomic import write_bytes
from panostitch.io.readers import open_photo
from panostitch.model.alignment import (
    FORMAT,
    FORMAT_VERSION,
    Alignment,
    LeftOut,
    LinkSummary,
    LocalWarp,
    Model,
    PairTried,
    Uncertainty,
    camera_from_json,
    control_points_from_json,
)
from panostitch.model.finding import Finding
from panostitch.model.photo import Photo, Pixels

EXTENSION = ".pano.json"


def write_project(alignment: Alignment, path: str) -> None:
    """Write an alignment. Raises OutputError."""
    data = alignment.to_json()
    for entry in data["photos"]:
        entry["path"] = os.path.relpath(os.path.abspath(entry["path"]), os.path.abspath(os.path.dirname(path) or "."))
    write_bytes(path, (json.dumps(data, indent=1) + "\n").encode())


def read_project(path: str) -> Alignment:
    """Read an alignment and open its photos. Raises InputError."""
    return _read(path, _photo)


def peek_project(path: str) -> tuple[Alignment, tuple[str, ...]]:
    """An alignment whose photos may be missing, and what is wrong with them, a line each. Raises InputError."""
    wrong = []

    def photo(entry: dict[str, Any], folder: str) -> Photo:
        try:
            return _photo(entry, folder)
        except InputError as error:
            wrong.append(error.message)
            name, (width, height) = str(entry["name"]), (int(n) for n in entry["size"])
            return Photo(name, (width, height), MissingPhoto(error), os.path.join(folder, entry["path"]))

    return _read(path, photo), tuple(wrong)


@dataclass(frozen=True)
class MissingPhoto:
    """A photo that cannot be opened: asked for its pixels, it says why."""

    error: InputError

    def read(self, scale: float = 1.0) -> tuple[Pixels, Pixels | None]:
        """Raises the InputError."""
        del scale
        raise self.error


def _read(path: str, photo: Callable[[dict[str, Any], str], Photo]) -> Alignment:
    data = _load(path)
    try:
        if data["format"] != FORMAT:
            raise ValueError("it is no panostitch project")
        if data["version"] != FORMAT_VERSION:
            raise ValueError(f"its version is {data['version']}, this program reads {FORMAT_VERSION}")
        if data["model"] not in get_args(Model) or not data["photos"]:
            raise ValueError("it holds no panorama")
        return Alignment(
            model=data["model"],
            photos=tuple(photo(entry, os.path.dirname(path)) for entry in data["photos"]),
            cameras=tuple(camera_from_json(entry) for entry in data["photos"]),
            links=_links(data["links"], len(data["photos"])),
            dropped=_links(data["dropped"], len(data["photos"])),
            left_out=tuple(_left_out(entry) for entry in data["left_out"]),
            rms=float(data["rms"]),
            p95=float(data["p95"]),
            reason=str(data["reason"]),
            control_points=tuple(control_points_from_json(entry) for entry in data["control_points"]),
            held_back_rms=_number(data["held_back_rms"]),
            held_back_p95=_number(data["held_back_p95"]),
            uncertainties=tuple(Uncertainty(**entry) for entry in data["uncertainties"]),
            pairs=tuple(PairTried(**entry) for entry in data["pairs"]),
            local_warp=None if data["local_warp"] is None else LocalWarp(**data["local_warp"]),
            findings=tuple(_finding(entry) for entry in data["findings"]),
        )
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
        what = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise InputError(f"{path}: not a sound project file: {what}") from None


def _left_out(entry: dict[str, Any]) -> LeftOut:
    name, reason, hint, cause = (str(entry[key]) for key in ("name", "reason", "hint", "cause"))
    return LeftOut(name, reason, tuple(map(str, entry["details"])), hint, cause)


def _finding(entry: dict[str, Any]) -> Finding:
    words = {key: str(entry[key]) for key in ("photo", "partner", "cause", "evidence", "next", "culprit")}
    return Finding(**words, overlap=_number(entry["overlap"]), weak=bool(entry["weak"]))


def _links(entries: list[dict[str, Any]], count: int) -> tuple[LinkSummary, ...]:
    links = tuple(
        LinkSummary(int(entry["i"]), int(entry["j"]), int(entry["matches"]), float(entry["rms"])) for entry in entries
    )
    if any(not 0 <= n < count for link in links for n in (link.i, link.j)):
        raise ValueError("a link is of photos that it does not hold")
    return links


def _number(value: Any) -> float | None:
    return None if value is None else float(value)


def _load(path: str) -> dict[str, Any]:
    try:
        data = json.loads(Path(path).read_bytes())
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: not a project file: {error}") from None
    if not isinstance(data, dict):
        raise InputError(f"{path}: not a project file")
    return data


def _photo(entry: dict[str, Any], folder: str) -> Photo:
    photo = open_photo(os.path.normpath(os.path.join(folder, entry["path"])))
    if list(photo.size) != list(entry["size"]):
        raise InputError(
            f"{photo.path}: is {photo.size[0]} x {photo.size[1]} px, the project was made with "
            f"{entry['size'][0]} x {entry['size'][1]}",
            hint="align anew with `panostitch align`",
        )
    return photo
