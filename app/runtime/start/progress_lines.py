"""What a start is waiting for, as bars or lines: the first one takes minutes."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from rich.console import Console as Terminal
from rich.progress import BarColumn, TaskID, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars

LOADING_NETWORK = "Loading the network (first time: trying its engines)"
COMPILING = "Compiling (first time only)"
WARMING_UP = "Warming up"
STARTING_ROBOT = "Starting the robot"
"""Steps of a start."""
PERIOD_S = 1.0
"""Time between two reports of a step that goes on, seconds."""
LINE_PERIOD_S = 10.0
"""Time between two lines about it where there is no terminal, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """How far a step is."""

    step: str
    """The step."""
    seconds: float = 0.0
    """Time that it has taken so far, seconds."""
    count: tuple[int, int] | None = None
    """How many parts are done, and how many there are; None for a step that is not counted."""
    is_over: bool = False
    """Whether it has ended."""

    @property
    def share(self) -> float | None:
        """The share that is done, 0 to 1; None for a step that is not counted."""
        return None if self.count is None else self.count[0] / max(self.count[1], 1)

    def text(self) -> str:
        """Return one line: the step, "…", and its figures."""
        figures = [] if self.count is None else [f"{self.count[0]} / {self.count[1]}"]
        figures += [f"{self.seconds:.0f} s"] if self.seconds >= 1 else []
        return " ".join([self.step, "…", ", ".join(figures)]).rstrip()


class StepDisplay:
    """Shows steps on a stream: as bars on a terminal, else as a line at the beginning and now and
    then."""

    def __init__(self, terminal: Terminal | None = None) -> None:
        """`terminal`: where to, by default the standard error stream."""
        self._terminal = terminal or Terminal(stderr=True)
        self._lock = threading.Lock()
        self._bars: Bars | None = None
        self._shown: dict[str, TaskID] = {}
        self._due_s: dict[str, float] = {}

    def __call__(self, progress: Progress) -> None:
        """Show how far a step is."""
        with self._lock:
            (self._draw if self._terminal.is_terminal else self._print)(progress)

    def _print(self, progress: Progress) -> None:
        due_s = self._due_s.get(progress.step, 0.0)
        if not progress.is_over and progress.seconds >= due_s:
            self._due_s[progress.step] = due_s + LINE_PERIOD_S
            self._terminal.out(progress.text(), highlight=False)
        elif progress.is_over:
            self._due_s.pop(progress.step, None)

    def _draw(self, progress: Progress) -> None:
        if self._bars is None:
            columns = (
                TextColumn("{task.description}"),
                BarColumn(),
                TextColumn("{task.fields[figures]}"),
                TimeElapsedColumn(),
            )
            self._bars = Bars(*columns, console=self._terminal)
            self._bars.start()
        if progress.step not in self._shown:
            self._shown[progress.step] = self._bars.add_task(progress.step, total=None, figures="")
        done, total = progress.count or (0, None)
        if progress.is_over:
            done = total = total or 1
        self._bars.update(
            self._shown[progress.step],
            completed=done,
            total=total,
            figures="" if progress.count is None else f"{done} / {total}",
        )
        if progress.is_over:
            self._bars.stop_task(self._shown.pop(progress.step))
            if not self._shown:
                self._bars.stop()
                self._bars = None


on_stderr = StepDisplay()
"""Shows the steps of this process."""


@contextmanager
def announced(
    step: str,
    *,
    period_s: float = PERIOD_S,
    say: Callable[[Progress], None] = on_stderr,
    count: Callable[[], tuple[int, int] | None] = lambda: None,
) -> Iterator[None]:
    """Say that a step begins, every so often how far it is, and that it is over."""
    began_s = time.monotonic()

    def report(*, is_over: bool = False) -> None:
        seconds = time.monotonic() - began_s
        say(Progress(step=step, seconds=seconds, count=count(), is_over=is_over))

    ended = threading.Event()

    def go_on() -> None:
        while not ended.wait(period_s):
            report()

    report()
    thread = threading.Thread(target=go_on, name="progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        report(is_over=True)
