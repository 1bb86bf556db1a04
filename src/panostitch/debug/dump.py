"""Writes what the stages did into a folder: pictures, one numbered subfolder a stage, and metrics.json."""

import json
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import cv2

from panostitch.debug.folder import Folder
from panostitch.debug.ink import Picture, fit, to_bytes
from panostitch.debug.metrics import Metrics, pure
from panostitch.debug.pictures import Pictures
from panostitch.errors import OutputError, PanostitchError

JPEG_QUALITY = 85
EVENTS = (
    "photos.read",
    "features.detected",
    "matching.matched",
    "matching.linked",
    "matching.grouped",
    "diagnosis.explained",
    "alignment.solved",
    "alignment.bent",
    "layout.chosen",
    "compositing.warped",
    "compositing.exposed",
    "compositing.seamed",
    "compositing.band",
    "compositing.cropped",
    "scoring.judged",
    "panorama.written",
)  # each is a method of Metrics, of Pictures, or of both
FLUSH_SECONDS = 1.0  # a run that is killed leaves numbers, and a list of its files, at most this old


class Dump:
    """A `Trace` that writes pictures and metrics.json; use it as a context or call `close`.

    What goes wrong while a picture is drawn or stored is noted in metrics.json and never stops the run.
    """

    def __init__(
        self, folder: str | Path, *, overwrite: bool = False, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        """Open the folder. Raises OutputError if it cannot be written or holds files and `overwrite` is False.

        overwrite: remove the files that an earlier dump has left there, and nothing else
        """
        self._folder = Folder(folder, overwrite=overwrite)
        self._clock = clock
        self._start = self._flushed = clock()
        self._seconds: dict[str, float] = {}
        self._drawing = 0.0
        self._failed: list[dict[str, str]] = []
        self._metrics = Metrics()
        self._pictures = Pictures(self._save, self._remove)
        self._closed = False

    def __call__(self, event: str, /, **data: Any) -> None:
        """Take an event of a stage; events that are not known are ignored."""
        if self._closed or event not in EVENTS:
            return
        now = self._clock()
        self._seconds[event.partition(".")[0]] = now - self._start
        for listener in (self._metrics, self._pictures):
            method = getattr(listener, event.replace(".", "_"), None)
            if method is not None:
                self._attempt(event, partial(method, **data))
        if self._clock() - self._flushed > FLUSH_SECONDS:
            self._attempt("metrics.json", self._write_metrics)
        self._drawing += self._clock() - now

    def close(self) -> None:
        """Draw what still waits and write metrics.json. Raises OutputError if that fails."""
        if self._closed:
            return
        self._attempt("pairs", self._pictures.finish)
        self._end()

    def _end(self) -> None:
        self._closed = True
        try:
            self._write_metrics()
        except OSError as error:
            raise OutputError(f"cannot write metrics.json to the debug folder: {error.strerror or error}") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if error is None or isinstance(error, Exception):
                self.close()
            else:
                # who presses Ctrl-C does not wait for pictures
                self._end()
        except OutputError:
            # what stopped the run is more important to the user
            if error is None:
                raise

    def _attempt(self, what: str, action: Callable[[], None]) -> None:
        """Do something that may fail; the one place where a failure becomes a note."""
        try:
            action()
        except (cv2.error, ValueError, ArithmeticError, LookupError, OSError, PanostitchError) as error:
            self._failed.append({"what": what, "error": f"{type(error).__name__}: {error}".strip()})

    def _save(self, path: str, picture: Callable[[], Picture]) -> None:
        self._attempt(path, lambda: self._folder.write(path, encode(picture(), Path(path).suffix)))

    def _remove(self, path: str) -> None:
        self._attempt(path, lambda: self._folder.remove(path))

    def _write_metrics(self) -> None:
        content = {
            **self._metrics.as_json(),
            "pairs_not_drawn": pure(self._pictures.not_drawn),
            "seconds": pure(self._seconds),
            "seconds_drawing": pure(self._drawing),
            "failed": pure(self._failed),
            "files": sorted(self._folder.files),
        }
        self._flushed = self._clock()
        self._folder.write_metrics(json.dumps(content, indent=1, allow_nan=False))


def encode(picture: Picture, suffix: str) -> bytes:
    """A picture as the bytes of a JPEG (`.jpg`) or PNG (`.png`) file. Raises ValueError if it cannot be."""
    small = cv2.cvtColor(to_bytes(fit(picture)), cv2.COLOR_RGB2BGR)
    done, data = cv2.imencode(suffix, small, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY] if suffix == ".jpg" else [])
    if not done:
        raise ValueError(f"cannot encode a picture of shape {small.shape}")
    return data.tobytes()
