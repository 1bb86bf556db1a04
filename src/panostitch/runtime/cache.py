"""A memory of what was made last, bounded in bytes."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import Lock
from typing import Generic, TypeVar

Value = TypeVar("Value")


class LastUsed(Generic[Value]):
    """Keeps the values used last, as many as fit into `budget` bytes; at least the newest one. Thread-safe."""

    def __init__(self, budget: int, size_of: Callable[[Value], int]) -> None:
        self._budget = budget
        self._size_of = size_of
        self._values: OrderedDict[Hashable, Value] = OrderedDict()
        self._locks: dict[Hashable, Lock] = {}
        self._lock = Lock()

    def get(self, key: Hashable, make: Callable[[], Value]) -> Value:
        """The value of the key, made if it is not there; made once, however many threads ask."""
        with self._lock:
            own_lock = self._locks.setdefault(key, Lock())
        with own_lock:
            with self._lock:
                if key in self._values:
                    self._values.move_to_end(key)
                    return self._values[key]
            value = make()
            with self._lock:
                self._values[key] = value
                self._shrink()
            return value

    def forget(self, key: Hashable) -> None:
        """Let go of a value that nobody will ask for soon."""
        with self._lock:
            self._values.pop(key, None)

    def _shrink(self) -> None:
        total = sum(self._size_of(value) for value in self._values.values())
        while total > self._budget and len(self._values) > 1:
            _, dropped = self._values.popitem(last=False)
            total -= self._size_of(dropped)
