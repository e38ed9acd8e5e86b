"""Work beside the tick: one task at a time, and no outcome for a map that was replaced."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator

import pytest

from app.runtime.control.background import InlineBackground, ThreadBackground
from navcore.localisation.tasks import TaskFailed


class Slow:
    """Task that ends when it is told to, or cancelled."""

    def __init__(self) -> None:
        self.may_end, self.began = threading.Event(), threading.Event()
        self.was_cancelled = False

    def run(self, is_cancelled: Callable[[], bool]) -> str:
        self.began.set()
        while not self.may_end.wait(0.01):
            if is_cancelled():
                self.was_cancelled = True
                break
        return "outcome of the map before"


@pytest.fixture
def thread() -> Iterator[ThreadBackground]:
    background = ThreadBackground()
    background.start()
    yield background
    background.stop()


def polled(background: ThreadBackground) -> object:
    """The outcome of the present task, None if it was discarded."""
    outcome = None
    while outcome is None and not background.is_idle:
        time.sleep(0.01)
        outcome = background.poll()
    return outcome


@pytest.mark.parametrize("ended", [False, True])
def test_what_was_computed_before_a_discard_is_never_returned(
    thread: ThreadBackground, ended: bool
) -> None:
    task = Slow()
    thread.submit(task)
    assert task.began.wait(10)
    if ended:
        task.may_end.set()
        while thread._busy.is_set():
            time.sleep(0.01)
        assert not thread.is_idle  # its outcome was not taken
    thread.discard()
    assert polled(thread) is None
    assert task.was_cancelled is not ended
    # The control: without a discard it is.
    task = Slow()
    task.may_end.set()
    thread.submit(task)
    assert polled(thread) == "outcome of the map before"
    assert thread.poll() is None


def test_of_a_task_that_fails_the_outcome_says_so(
    thread: ThreadBackground, caplog: pytest.LogCaptureFixture
) -> None:
    class Failing:
        def run(self, is_cancelled: Callable[[], bool]) -> str:
            raise MemoryError("no room for the map")

    task = Failing()
    thread.submit(task)
    failed = polled(thread)
    assert isinstance(failed, TaskFailed) and failed.task is task
    assert "no room for the map" in caplog.text


def test_in_simulated_time_too() -> None:
    background, task = InlineBackground(), Slow()
    task.may_end.set()
    background.submit(task)
    background.discard()
    assert background.is_idle and background.poll() is None
