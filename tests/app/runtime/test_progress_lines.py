"""A step of the start is announced, and says that it goes on."""

from __future__ import annotations

import threading

import pytest

from app.runtime.progress_lines import announced


def test_a_long_step_says_what_it_is_and_for_how_long_it_has_run() -> None:
    lines: list[str] = []
    enough = threading.Event()

    def say(line: str) -> None:
        lines.append(line)
        if len(lines) == 3:
            enough.set()

    with announced("Compiling", period_s=0.01, say=say):
        assert enough.wait(30.0)
    assert lines[0] == "Compiling …" and lines[1].startswith("Compiling … 0 s")
    after = len(lines)
    assert len(lines) == after, "nothing is said after the step"


def test_a_failed_step_ends_its_lines() -> None:
    lines: list[str] = []
    with pytest.raises(RuntimeError), announced("Step", say=lines.append):
        raise RuntimeError
    assert lines == ["Step …"]
    assert not [thread for thread in threading.enumerate() if thread.name == "progress"]
