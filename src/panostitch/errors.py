"""What can go wrong for a user: each error has an exit code and says what to try next.

PanostitchError
├── UsageError             2   an option or argument makes no sense
├── NoOverlapError         4   no two photos overlap, or not all of them where all are required
├── InputError             5   an input cannot be read
├── AlignmentError         6   photos match, but no sound alignment was found
├── LimitError             7   a limit of memory, disk, size or time would be broken
├── OutputError            8   the output cannot be written, or exists already
└── MissingError           9   something optional that was asked for is not installed

Exit code 0 means that every photo is in the panorama, 1 is a bug, 3 says that a panorama was written without
some of the photos, 10 that some panoramas of a batch failed, 11 that the installation is damaged, and 130 that the user
interrupted the run.
"""

from typing import ClassVar

EXIT_OK = 0
EXIT_BUG = 1
EXIT_LEFT_OUT = 3
EXIT_BATCH_FAILED = 10
EXIT_DAMAGED = 11
EXIT_INTERRUPTED = 130
EXIT_PIPE = 141  # as of programs that SIGPIPE ends


class PanostitchError(Exception):
    """A failure that is the user's to mend: one line that says what, which file and why.

    `details` are further lines of evidence, `hint` is the next thing to try.
    """

    exit_code: ClassVar[int] = EXIT_BUG

    def __init__(self, message: str, *, details: tuple[str, ...] = (), hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.details = details
        self.hint = hint


class UsageError(PanostitchError):
    """An option or argument makes no sense."""

    exit_code = 2


class NoOverlapError(PanostitchError):
    """No two of the photos overlap, or with --require-all not all of them; nothing is written."""

    exit_code = 4


class InputError(PanostitchError):
    """An input is missing, or there are fewer than two photos that can be read (with --require-all: not all can)."""

    exit_code = 5


class AlignmentError(PanostitchError):
    """Photos match, but no sound set of cameras explains the matches."""

    exit_code = 6


class LimitError(PanostitchError):
    """The job would break a limit of memory, disk, size or time."""

    exit_code = 7


class OutputError(PanostitchError):
    """The output cannot be written, or would overwrite something."""

    exit_code = 8


class MissingError(PanostitchError):
    """Something optional that was asked for is not installed."""

    exit_code = 9
