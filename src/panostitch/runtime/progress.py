"""Progress bars on a terminal, by tqdm; nothing in pipes and on work that is over at once."""

import sys
from collections.abc import Iterable
from typing import TypeVar

from tqdm import tqdm

Result = TypeVar("Result")

DELAY_SECONDS = 2.0


def terminal_progress(items: Iterable[Result], /, *, total: int, label: str) -> Iterable[Result]:
    """A bar on stderr once the work has taken two seconds; nothing where stderr is no terminal."""
    bar: Iterable[Result] = tqdm(
        items, total=total, desc=label, delay=DELAY_SECONDS, disable=not sys.stderr.isatty(), leave=False
    )
    return bar
