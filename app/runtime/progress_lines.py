"""Lines about what a start is waiting for: compiling takes minutes the first time."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

LOADING_NETWORK = "Loading the network (first time: trying its engines, about a minute)"
WARMING_UP = "Warming up (first time: compiling, some minutes)"
STARTING_ROBOT = "Starting the robot"
"""Steps of a start."""
PERIOD_S = 10.0
"""Time between two lines of a step that goes on, seconds."""


def on_stderr(line: str) -> None:
    """Write a line to the standard error stream."""
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


@contextmanager
def announced(
    step: str, *, period_s: float = PERIOD_S, say: Callable[[str], None] = on_stderr
) -> Iterator[None]:
    """Say that a step begins, and every so often that it goes on and for how long."""
    say(f"{step} …")
    ended = threading.Event()

    def go_on() -> None:
        periods = 1
        while not ended.wait(period_s):
            say(f"{step} … {periods * period_s:.0f} s")
            periods += 1

    thread = threading.Thread(target=go_on, name="progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
