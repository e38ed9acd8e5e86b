"""Tasks on this machine: in this process, or in processes of their own."""

from __future__ import annotations

import os
import platform
import signal
import threading
import traceback
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from typing import Any

from pebble import ProcessExpired, ProcessPool

from app.fleet.engine import Done, Lost
from app.runtime.record.provenance import version
from navcore.errors import BadConfiguration

LIMIT_S = 3600.0
"""Least real time after which a task in a process of its own counts as hung, seconds."""
SLOWEST = 6.0
"""Real time that a simulated second may take, seconds."""

_Outcome = Done[Any] | TimeoutError


def limit_for(simulated_s: float) -> float:
    """Return the real time in seconds after which a task counts as hung that simulates so much."""
    return max(LIMIT_S, SLOWEST * simulated_s)


@dataclass(frozen=True, slots=True)
class ThisProcess:
    """One task after the other, in this process."""

    alone = True

    @contextmanager
    def started(self) -> Iterator[ThisProcess]:
        """Return itself: there is nothing to start."""
        yield self

    def submit(self, do: Callable[[Any], Any], task: Any) -> Callable[[], Done[Any]]:
        """Keep a task until it is asked for."""
        return lambda: done(do, task)

    def ended(self, handles: Collection[Callable[[], Done[Any]]]) -> list[Callable[[], Done[Any]]]:
        """Return the first task, which is done when its outcome is asked for."""
        return [next(iter(handles))]

    def outcome(self, handle: Callable[[], Done[Any]]) -> Done[Any]:
        """Do a task."""
        return handle()


@dataclass(frozen=True, slots=True, kw_only=True)
class Processes:
    """Processes of this machine; one that is killed or hangs ends with its own task only."""

    workers: int
    """Number of processes."""
    limit_s: float = LIMIT_S
    """Real time after which a task counts as hung, seconds."""
    alone = False

    @contextmanager
    def started(self) -> Iterator[_Pool]:
        """Start the processes; at the end tasks in progress are not waited for."""
        expected = version()
        pool = ProcessPool(
            self.workers,
            context=get_context("spawn"),
            initializer=_begin,
        )
        try:
            yield _Pool(pool, self.limit_s, expected)
        finally:
            pool.stop()  # type: ignore[no-untyped-call]
            pool.join()


@dataclass(frozen=True, slots=True)
class _Pool:
    pool: ProcessPool
    limit_s: float
    expected: str

    def submit(self, do: Callable[[Any], Any], task: Any) -> Future[_Outcome]:
        job: Future[_Outcome] = self.pool.schedule(
            _checked, args=[do, task, self.expected], timeout=self.limit_s
        )
        return job

    def ended(self, handles: Collection[Future[_Outcome]]) -> Collection[Future[_Outcome]]:
        return wait(handles, return_when=FIRST_COMPLETED).done

    def outcome(self, handle: Future[_Outcome]) -> Done[Any] | Lost:
        error = handle.exception()
        if isinstance(error, ProcessExpired):
            return Lost(cause=f"its worker ended with exit code {error.exitcode}")
        if isinstance(error, TimeoutError):
            return Lost(cause=f"it took longer than {self.limit_s:g} s")
        result = handle.result()
        if isinstance(result, TimeoutError):
            raise result
        return result


def done(do: Callable[[Any], Any], task: Any) -> Done[Any]:
    """Do a task in this process."""
    return Done(result=do(task), node=platform.node(), pid=os.getpid())


def check_version(expected: str) -> None:
    """Raise `BadConfiguration` in a worker that has loaded other files than the process that gives
    it tasks."""
    if version() != expected:
        raise BadConfiguration(
            f"a worker on {platform.node()} has bewarenav {version()}, and its tasks are of "
            f"{expected}: all machines need the same version, and its files must not change "
            "meanwhile"
        )


def _checked(do: Callable[[Any], Any], task: Any, expected: str) -> Done[Any] | TimeoutError:
    """Do a task; return its own `TimeoutError`, since the pool raises one for a task that hangs."""
    check_version(expected)
    try:
        return done(do, task)
    except TimeoutError as error:
        error.add_note(traceback.format_exc())  # which is lost on the way between processes
        return error


def _begin() -> None:
    """End this worker when its parent is killed; Ctrl-C is left to the parent."""
    version()  # of the files that are loaded from now on, whatever changes later
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_exit_with_parent, daemon=True).start()


def _exit_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
