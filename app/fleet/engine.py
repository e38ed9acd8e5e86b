"""Independent tasks on several workers: what an engine is, and the loop that all engines share."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Collection, Generator, Hashable, Sequence
from contextlib import AbstractContextManager, closing
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

Task = TypeVar("Task", bound=Hashable)
Result = TypeVar("Result")
Handle = Any
"""Name of a submitted task, as its engine gives it."""
TRIES = 2
"""Number of times that a task is tried when its worker ends or hangs."""
MACHINE_LOSSES = 10
"""Number of times that a task may lose its machine, which is no failure of the task."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Done(Generic[Result]):
    """Result of a task."""

    result: Result
    """Return value of the task."""
    node: str
    """Name of the machine that did the task."""
    pid: int
    """Number of the process that did the task."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lost:
    """End of a task without a result and without an error of the program."""

    cause: str
    """Cause, in words."""
    machine: bool = False
    """Whether the whole machine was lost, not the worker alone."""


class Workers(Protocol):
    """Workers in operation."""

    def submit(self, do: Callable[[Any], Any], task: Hashable) -> Handle:
        """Schedule a task, to be done by the next free worker."""
        ...

    def ended(self, handles: Collection[Handle]) -> Collection[Handle]:
        """Wait until a task ends; return those of the handles that have ended."""
        ...

    def outcome(self, handle: Handle) -> Done[Any] | Lost:
        """Return what came of an ended task; raises the error that the task raised."""
        ...


class Engine(Protocol):
    """Where tasks are done."""

    alone: bool
    """Whether tasks are done in this process, so that they may share what it has loaded."""

    def started(self) -> AbstractContextManager[Workers]:
        """Start the workers; they end with the context, whatever they are doing."""
        ...


def run(
    engine: Engine, do: Callable[[Task], Result], tasks: Sequence[Task], *, ahead: int | None = None
) -> Generator[tuple[Task, Done[Result] | Lost]]:
    """Yield each task with what came of it, in the order in which the tasks end.

    A task whose worker ends or hangs is tried once more, and one whose machine is lost is done by
    another; `Lost` is yielded when that does not help. With `ahead`, a task waits until the first
    unfinished one is fewer places before it, which bounds what a reader in the order of the tasks
    must hold. Raises at once the error that a task raises.
    """
    losses: Counter[tuple[int, bool]] = Counter()
    left, waiting, unfinished = (
        deque(range(len(tasks))),
        dict[Handle, int](),
        set(range(len(tasks))),
    )
    with engine.started() as workers:
        while unfinished:
            while left and (ahead is None or left[0] < min(unfinished) + ahead):
                number = left.popleft()
                waiting[workers.submit(do, tasks[number])] = number
            for handle in workers.ended(waiting):
                number = waiting.pop(handle)
                outcome = workers.outcome(handle)
                if isinstance(outcome, Lost):
                    kind = number, outcome.machine
                    losses[kind] += 1
                    if losses[kind] < (MACHINE_LOSSES if outcome.machine else TRIES):
                        waiting[workers.submit(do, tasks[number])] = number
                        continue
                unfinished.discard(number)
                yield tasks[number], outcome


def in_order(
    engine: Engine, do: Callable[[Task], Result], tasks: Sequence[Task], *, ahead: int
) -> Generator[Result | Lost]:
    """Yield what came of each task, in the order of the tasks, which differ from each other; at
    most `ahead` results wait for their turn."""
    early: dict[Task, Result | Lost] = {}
    with closing(run(engine, do, tasks, ahead=ahead)) as ended:
        for expected in tasks:
            while expected not in early:
                task, outcome = next(ended)
                early[task] = outcome.result if isinstance(outcome, Done) else outcome
            yield early.pop(expected)
