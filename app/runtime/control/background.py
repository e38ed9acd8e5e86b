"""Work that the tick asks for and does not wait for: loop closures, relocalisation."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

from navcore.localisation.tasks import TaskFailed

JOIN_S = 2.0
"""Longest wait for the end of the thread, seconds."""
log = logging.getLogger(__name__)


class Task(Protocol):
    """A computation on values that nothing else changes."""

    def run(self, is_cancelled: Callable[[], bool]) -> Any:
        """Return the outcome, None if it was cancelled."""


class Background(Protocol):
    """Runs one task at a time."""

    @property
    def is_idle(self) -> bool:
        """Whether a task would be taken now."""

    def submit(self, task: Task) -> None:
        """Begin a task; only while idle."""

    def poll(self) -> Any:
        """Return the outcome of the last task once, when it has one; else None. That of a task
        which raised an exception in another thread is `TaskFailed`."""

    def discard(self) -> None:
        """Cancel the task that runs; no outcome of an earlier task is returned any more."""


class InlineBackground:
    """Runs a task at once and hands its outcome to the next poll: the same run every time, for
    simulated time."""

    def __init__(self) -> None:
        self._outcome: Any = None

    @property
    def is_idle(self) -> bool:
        """Whether a task would be taken now."""
        return self._outcome is None

    def submit(self, task: Task) -> None:
        """Run a task."""
        self._outcome = task.run(lambda: False)

    def poll(self) -> Any:
        """Return the outcome of the last task once."""
        outcome, self._outcome = self._outcome, None
        return outcome

    def discard(self) -> None:
        """Drop the outcome of the last task."""
        self._outcome = None


class ThreadBackground:
    """Runs tasks in a thread of its own; the exception of one that fails is logged."""

    def __init__(self) -> None:
        self._tasks: queue.SimpleQueue[tuple[int, Task] | None] = queue.SimpleQueue()
        self._outcomes: queue.SimpleQueue[tuple[int, Any]] = queue.SimpleQueue()
        self._busy, self._ended = threading.Event(), threading.Event()
        self._generation = 0
        self._thread = threading.Thread(target=self._run, name="localisation", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Cancel the present task and end the thread."""
        self._ended.set()
        self._tasks.put(None)
        self._thread.join(timeout=JOIN_S)

    @property
    def is_idle(self) -> bool:
        """Whether a task would be taken now: not before the outcome of the last one was, or the
        same work would begin again."""
        return not self._busy.is_set() and self._outcomes.empty()

    def submit(self, task: Task) -> None:
        """Begin a task; only while idle."""
        self._busy.set()
        self._tasks.put((self._generation, task))

    def poll(self) -> Any:
        """Return the outcome of the last task once, when it has one; else None."""
        while not self._outcomes.empty():
            generation, outcome = self._outcomes.get()
            if generation == self._generation:
                return outcome
        return None

    def discard(self) -> None:
        """Cancel the task that runs; no outcome of an earlier task is returned any more."""
        self._generation += 1

    def _run(self) -> None:
        while (given := self._tasks.get()) is not None:
            generation, task = given
            try:
                outcome = task.run(partial(self._is_cancelled, generation))
                if outcome is not None:
                    self._outcomes.put((generation, outcome))
            except Exception:
                log.exception("a task in the background failed")
                self._outcomes.put((generation, TaskFailed(task=task)))
            self._busy.clear()

    def _is_cancelled(self, generation: int) -> bool:
        return self._ended.is_set() or generation != self._generation
