"""How many calls run at once. Results come in the order of the items, whatever the number of threads."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Protocol, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


class Progress(Protocol):
    """Wraps an iterator and shows how far it is."""

    def __call__(self, items: Iterable[Result], /, *, total: int, label: str) -> Iterable[Result]: ...


def no_progress(items: Iterable[Result], /, *, total: int, label: str) -> Iterable[Result]:
    """Shows nothing."""
    del total, label
    return items


@dataclass(frozen=True)
class Executor:
    """Runs a function over items on `threads` threads; OpenCV and NumPy release the interpreter while they work."""

    threads: int = 1
    progress: Progress = no_progress

    def map(
        self, function: Callable[[Item], Result], items: Sequence[Item], *, label: str, ahead: int | None = None
    ) -> Iterator[Result]:
        """Results in the order of the items. The first error ends it; calls not yet begun are dropped.

        With `ahead`, at most so many results that nobody has taken yet are made or waiting: memory stays bounded
        where the taker is slow.
        """
        if self.threads <= 1 or len(items) <= 1:
            yield from self.progress(map(function, items), total=len(items), label=label)
            return
        with ThreadPoolExecutor(self.threads) as pool:
            try:
                results = pool.map(function, items) if ahead is None else _ahead(pool, function, items, ahead)
                yield from self.progress(results, total=len(items), label=label)
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise


def _ahead(
    pool: ThreadPoolExecutor, function: Callable[[Item], Result], items: Iterable[Item], count: int
) -> Iterator[Result]:
    waiting: deque[Future[Result]] = deque()
    for item in items:
        if len(waiting) >= max(1, count):
            yield waiting.popleft().result()
        waiting.append(pool.submit(function, item))
    while waiting:
        yield waiting.popleft().result()


serial = Executor()
