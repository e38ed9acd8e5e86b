"""A step of the start is shown with how far it is, as a bar or as lines."""

from __future__ import annotations

import io
import threading

import pytest
from rich.console import Console as Terminal

from app.runtime.start.progress_lines import Progress, StepDisplay, announced


def test_a_long_step_says_what_it_is_and_for_how_long_it_has_run() -> None:
    said: list[Progress] = []
    enough = threading.Event()

    def say(progress: Progress) -> None:
        said.append(progress)
        if len(said) == 3:
            enough.set()

    with announced("Compiling", period_s=0.01, say=say, count=lambda: (len(said), 9)):
        assert enough.wait(30.0)
    assert said[0].text() == "Compiling … 0 / 9"
    assert [progress.count for progress in said] == [(n, 9) for n in range(len(said))]
    assert [progress.is_over for progress in said] == [False] * (len(said) - 1) + [True]
    assert Progress(step="Compiling", seconds=12.3).text() == "Compiling … 12 s"


def test_a_failed_step_ends_its_lines() -> None:
    said: list[Progress] = []
    with pytest.raises(RuntimeError), announced("Step", say=said.append):
        raise RuntimeError
    assert said[-1].is_over
    assert not [thread for thread in threading.enumerate() if thread.name == "progress"]


def test_without_a_terminal_a_step_is_a_line_every_ten_seconds() -> None:
    stream = io.StringIO()
    show = StepDisplay(Terminal(file=stream))
    for second in range(25):
        show(Progress(step="Compiling", seconds=second, count=(second, 50)))
    show(Progress(step="Compiling", seconds=25.0, count=(50, 50), is_over=True))
    assert stream.getvalue().splitlines() == [
        "Compiling … 0 / 50",
        "Compiling … 10 / 50, 10 s",
        "Compiling … 20 / 50, 20 s",
    ]


def test_on_a_terminal_steps_at_one_time_are_bars_with_figures() -> None:
    stream = io.StringIO()
    show = StepDisplay(Terminal(file=stream, force_terminal=True, width=100))
    show(Progress(step="Compiling", count=(0, 50)))
    show(Progress(step="Trying", count=(2, 6)))
    show(Progress(step="Compiling", count=(50, 50), is_over=True))
    show(Progress(step="Trying", count=(3, 6), is_over=True))
    last = stream.getvalue().rsplit("Compiling", 1)[1]
    assert "50 / 50" in last and "Trying" in last and "6 / 6" in last
