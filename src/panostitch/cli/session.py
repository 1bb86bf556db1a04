"""What commands share: threads and progress, the debug folder, opening photos."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING, Any

from panostitch.errors import InputError, OutputError, PanostitchError, UsageError

if TYPE_CHECKING:
    from panostitch.model.alignment import LeftOut
    from panostitch.model.photo import Photo
    from panostitch.options import Options
    from panostitch.report import Record
    from panostitch.runtime.executor import Executor
    from panostitch.runtime.trace import Trace


def executor(given: dict[str, Any]) -> "Executor":
    """Threads and progress bars as the user asked."""
    from panostitch.runtime.executor import Executor, no_progress
    from panostitch.runtime.machine import threads
    from panostitch.runtime.memory import keep_freed
    from panostitch.runtime.progress import terminal_progress

    keep_freed()
    quiet = given["quiet"] or given["as_json"]
    return Executor(given["threads"] or threads(), no_progress if quiet else terminal_progress)


@contextmanager
def debug_trace(given: dict[str, Any]) -> Iterator["Trace"]:
    """A trace into the debug folder if one was asked for. Raises OutputError where it cannot be used."""
    from panostitch.runtime.trace import silent

    if given["debug_dir"] is None:
        with nullcontext(silent) as trace:
            yield trace
        return
    from panostitch.debug.dump import Dump

    with Dump(given["debug_dir"], overwrite=given["overwrite"]) as dump:
        yield dump


@contextmanager
def listening(given: dict[str, Any], options: "Options") -> Iterator["Trace"]:
    """A trace to the debug folder and to the report, whichever were asked for. Raises OutputError as they do.

    The report is written when the block ends, also where it ends in an error that is the user's to mend: the error then
    names the report.
    """
    from panostitch.runtime.trace import combine

    with debug_trace(given) as dump:
        path = given["report"]
        if path is None:
            yield dump
            return
        from panostitch.report import Record, write_report

        record = Record()
        try:
            yield combine(record, dump)
        except PanostitchError as error:
            error.details = (*error.details, _report_of(error, record, path, options))
            raise
        write_report(record, path, options)


def _report_of(error: PanostitchError, record: "Record", path: str, options: "Options") -> str:
    """Write the report of a failure; the line that says so. What stopped the run is more important to the user."""
    from panostitch.report import write_report

    try:
        write_report(record, path, options, error=error)
    except OutputError as second:
        return f"no report: {second.message}"
    return f"report: {path}"


def open_given(
    arguments: tuple[str, ...], *, exclude: tuple[str, ...] = (), require_all: bool = False
) -> "tuple[list[Photo], list[LeftOut], list[str]]":
    """The photos that the user named, those of them that cannot be read, and the paths of all, excluded ones too.

    Raises InputError for a file that is missing, for any that cannot be read if all are required, and where fewer than
    two can or there are; UsageError for names to exclude that no photo has.
    """
    from panostitch.cli.inputs import photo_paths, without
    from panostitch.io.readers import open_photos
    from panostitch.model.alignment import LeftOut
    from panostitch.recognition import check_enough

    paths = photo_paths(arguments)
    photos, failures = open_photos(without(paths, exclude))
    if failures and (require_all or len(photos) < 2):
        first = failures[0]
        more = tuple(error.message for error in failures[1:])
        raise InputError(first.message, details=more, hint=first.hint or "leave it out, or repair it")
    check_enough(photos)
    return photos, [LeftOut.unreadable(error) for error in failures], paths


def check_inclusion_options(given: dict[str, Any]) -> None:
    """Raise UsageError where all photos are required and some need not be there."""
    if given["require_all"] and given["allow_partial"]:
        raise UsageError("--require-all and --allow-partial contradict each other", hint="leave one of them out")
