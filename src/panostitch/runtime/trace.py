"""What stages tell to whoever listens: `trace("matching.verified", link=...)`.

No stage knows who listens; the debug pictures and the metrics are made from these events alone. Events are sent from
the thread that runs the pipeline, in an order that does not depend on the number of threads.
"""

from typing import Any, Protocol


class Trace(Protocol):
    """Takes the name of an event and its data."""

    def __call__(self, event: str, /, **data: Any) -> None: ...


def silent(event: str, /, **data: Any) -> None:
    """Nobody listens."""


def combine(*listeners: Trace) -> Trace:
    """Tell several listeners; `silent` if none of them listens, so that nobody makes what nobody hears."""
    heard = [listener for listener in listeners if listener is not silent]
    if not heard:
        return silent

    def tell(event: str, /, **data: Any) -> None:
        for listener in heard:
            listener(event, **data)

    return tell
