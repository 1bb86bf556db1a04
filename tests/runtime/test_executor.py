"""Order, errors and progress of work on several threads."""

import threading
import time

import pytest

from panostitch.runtime.executor import Executor, no_progress, serial
from panostitch.runtime.progress import terminal_progress
from panostitch.runtime.trace import combine, silent

THREADS = [1, 2, 7]
NAP = 0.002  # seconds; long enough that threads overtake each other
ITEMS = 100
PATIENCE = 10.0  # seconds after which a test is stuck


@pytest.mark.parametrize("threads", THREADS)
def test_results_come_in_the_order_of_the_items(threads):
    def work(n):
        time.sleep(NAP * ((n * 7) % 5))
        return n * n

    assert list(Executor(threads).map(work, range(30), label="")) == [n * n for n in range(30)]


@pytest.mark.parametrize("threads", THREADS)
@pytest.mark.parametrize("count", [0, 1])
def test_few_items(threads, count):
    assert list(Executor(threads).map(str, range(count), label="")) == ["0"][:count]


def test_items_are_worked_on_at_once():
    both = threading.Barrier(2, timeout=PATIENCE)

    list(Executor(2).map(lambda _: both.wait(), range(2), label=""))  # one alone would wait for ever


def test_serial_stays_on_the_callers_thread():
    assert set(serial.map(lambda _: threading.get_ident(), range(3), label="")) == {threading.get_ident()}


@pytest.mark.parametrize("threads", THREADS)
def test_the_first_error_ends_it(threads):
    begun = []

    def work(n):
        begun.append(n)
        time.sleep(NAP)
        if n in (3, 5):
            raise ValueError(f"item {n}")
        return n

    results = []
    with pytest.raises(ValueError, match="item 3"):
        results.extend(Executor(threads).map(work, range(ITEMS), label=""))

    assert len(begun) < ITEMS


@pytest.mark.parametrize("threads", THREADS)
def test_results_before_the_error_are_had(threads):
    def work(n):
        if n == 3:
            raise KeyError(n)
        return n

    results = Executor(threads).map(work, range(10), label="")

    assert [next(results) for _ in range(3)] == [0, 1, 2]
    with pytest.raises(KeyError):
        next(results)


@pytest.mark.parametrize("threads", THREADS)
def test_who_stops_listening_stops_the_work(threads):
    begun = []

    def work(n):
        begun.append(n)
        time.sleep(NAP)

    results = Executor(threads).map(work, range(ITEMS), label="")
    next(results)
    results.close()

    assert len(begun) < ITEMS


@pytest.mark.parametrize("threads", THREADS)
def test_progress_adds_up(threads):
    seen = {}

    def progress(items, /, *, total, label):
        seen.update(total=total, label=label, done=0)
        for item in items:
            seen["done"] += 1
            yield item

    list(Executor(threads, progress).map(str, range(9), label="Counting"))

    assert seen == {"total": 9, "label": "Counting", "done": 9}


def test_no_progress_passes_things_on():
    items = iter([1, 2])

    assert no_progress(items, total=2, label="") is items


def test_without_a_terminal_there_is_no_bar(capsys, monkeypatch):
    monkeypatch.setattr("panostitch.runtime.progress.DELAY_SECONDS", 0.0)

    assert list(terminal_progress(range(50), total=50, label="Working")) == list(range(50))

    assert capsys.readouterr() == ("", "")


def test_on_a_terminal_there_is_a_bar(capsys, monkeypatch):
    monkeypatch.setattr("panostitch.runtime.progress.DELAY_SECONDS", 0.0)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)

    list(terminal_progress(range(50), total=50, label="Working"))

    out, err = capsys.readouterr()
    assert out == ""
    assert "Working" in err


def test_all_listeners_hear_everything_in_order():
    heard = []

    trace = combine(
        lambda event, /, **data: heard.append(("first", event, data)),
        silent,
        lambda event, /, **data: heard.append(("second", event, data)),
    )
    trace("stage.done", event="a name that is data too", n=1)

    data = {"event": "a name that is data too", "n": 1}
    assert heard == [("first", "stage.done", data), ("second", "stage.done", data)]
