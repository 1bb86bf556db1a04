"""Seconds and memory of each stage, by the events that it sends."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from panostitch.runtime.memory import UNKNOWN


@dataclass
class Stage:
    """One stage: seconds that passed before its events, and the most memory (bytes) at one of them."""

    name: str
    seconds: float = 0.0
    resident: int = 0


class Stages:
    """Stages in the order in which they first told something.

    What passes between two events is the time of the stage that sends the later one; what listening takes is nobody's.
    """

    def __init__(self, clock: Callable[[], float], resident: Callable[[], int]) -> None:
        self._clock, self._resident = clock, resident
        self._since = clock()
        self._stages: dict[str, Stage] = {}

    @contextmanager
    def told(self, name: str) -> Iterator[None]:
        """A stage has told something; the block is what is done with it."""
        stage = self._stages.setdefault(name, Stage(name))
        stage.seconds += self._clock() - self._since
        stage.resident = max(stage.resident, self._resident())
        try:
            yield
        finally:
            self._since = self._clock()

    def __iter__(self) -> Iterator[Stage]:
        return iter(self._stages.values())

    @property
    def seconds(self) -> float:
        """Of all stages together."""
        return sum(stage.seconds for stage in self)

    @property
    def resident(self) -> int:
        """The most memory at any event, bytes; 0 where the system does not tell."""
        most = max((stage.resident for stage in self), default=0)
        return 0 if most == UNKNOWN else most
