"""A memory of what was used last: its budget, and that things are made once."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from panostitch.runtime.cache import LastUsed

PATIENCE = 10.0  # seconds after which a test is stuck
NAP = 0.01  # seconds that making something takes
THREADS = 8


class Maker:
    """Makes bytes of a length and counts."""

    def __init__(self):
        self.made = []

    def __call__(self, cache, key, size=10):
        def make():
            self.made.append(key)
            time.sleep(NAP)
            return bytes(size)

        return cache.get(key, make)


@pytest.fixture
def maker():
    return Maker()


def test_what_is_there_is_not_made_again(maker):
    cache = LastUsed(100, len)

    first, again = maker(cache, "a"), maker(cache, "a")

    assert again is first
    assert maker.made == ["a"]


def test_what_was_used_longest_ago_goes_first(maker):
    cache = LastUsed(30, len)
    for key in "abc":
        maker(cache, key)
    maker(cache, "a")  # used again: now b is the oldest
    maker(cache, "d")

    for key in "cad":
        maker(cache, key)
    assert maker.made == list("abcd")
    maker(cache, "b")
    assert maker.made == list("abcdb")


def test_the_budget_is_in_bytes(maker):
    cache = LastUsed(30, len)
    for key in "abc":
        maker(cache, key)
    maker(cache, "large", 25)

    for key in "cba":
        maker(cache, key, 1)

    assert maker.made == [*"abc", "large", *"cba"]


def test_exactly_the_budget_fits(maker):
    cache = LastUsed(30, len)
    for key in "abc" * 2:
        maker(cache, key)

    assert maker.made == list("abc")


def test_the_newest_stays_though_it_is_too_large(maker):
    cache = LastUsed(5, len)

    maker(cache, "huge", 1000)
    maker(cache, "huge", 1000)

    assert maker.made == ["huge"]


def test_made_once_however_many_threads_ask(maker):
    cache = LastUsed(1000, len)
    start = threading.Barrier(THREADS, timeout=PATIENCE)

    def ask(n):
        start.wait()
        return [maker(cache, key) for key in ("ab", "ba")[n % 2]]

    with ThreadPoolExecutor(THREADS) as pool:
        values = list(pool.map(ask, range(THREADS)))

    assert sorted(maker.made) == ["a", "b"]
    assert len({id(v) for pair in values for v in pair}) == len("ab")


def test_one_thing_may_be_made_while_another_is():
    cache = LastUsed(1000, len)
    other_made = threading.Event()

    def slow():
        assert other_made.wait(PATIENCE)
        return b"slow"

    with ThreadPoolExecutor(2) as pool:
        waiting = pool.submit(cache.get, "slow", slow)
        assert pool.submit(cache.get, "quick", lambda: b"quick").result(PATIENCE) == b"quick"
        other_made.set()
        assert waiting.result(PATIENCE) == b"slow"


def test_a_failure_is_not_remembered(maker):
    cache = LastUsed(100, len)

    def fail():
        raise OSError("no")

    with pytest.raises(OSError, match="no"):
        cache.get("a", fail)

    assert len(maker(cache, "a")) == 10
    assert maker.made == ["a"]
