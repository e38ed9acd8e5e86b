"""The process of a training run: its lock, its exit codes, and what ends it."""

from __future__ import annotations

import errno
import fcntl
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from app.teaching.__main__ import FAILED, TAKEN
from app.teaching.training import lock
from app.teaching.training.lock import LOCK_NAME, RunLock, end_holder, holder_of
from app.teaching.training.progress import read_progress

STALE = 4_000_000
"""Number of a process that does not exist."""


def probe(folder: Path) -> int:
    """Return an open file that asks for the holder of the lock at this moment, as `holder_of`
    does."""
    handle = os.open(folder / LOCK_NAME, os.O_RDWR | os.O_CREAT)
    fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    return handle


def test_a_lock_that_cannot_be_taken_is_not_held(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(handle: int, operation: int) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", refuse)
    with RunLock(tmp_path) as is_mine:
        assert not is_mine


def test_the_lock_names_its_holder_and_nothing_once_it_is_released(tmp_path: Path) -> None:
    assert holder_of(tmp_path) is None
    with RunLock(tmp_path) as is_mine:
        assert is_mine and holder_of(tmp_path) == os.getpid()
    assert holder_of(tmp_path) is None and not (tmp_path / LOCK_NAME).read_bytes()


def test_two_that_ask_for_the_holder_at_once_take_each_other_for_none(tmp_path: Path) -> None:
    (tmp_path / LOCK_NAME).write_text(str(STALE))  # of a process that was killed
    other = probe(tmp_path)
    assert holder_of(tmp_path) is None
    os.close(other)


def test_a_run_gets_its_lock_while_its_holder_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asking, tried, sleep = probe(tmp_path), threading.Event(), time.sleep
    taken: list[bool] = []

    def pause(pause_s: float) -> None:
        tried.set()
        sleep(pause_s)

    monkeypatch.setattr(lock, "TRIES", 500)
    monkeypatch.setattr(time, "sleep", pause)

    def run() -> None:
        with RunLock(tmp_path) as is_mine:
            taken.append(is_mine)

    thread = threading.Thread(target=run)
    thread.start()
    assert tried.wait(10)
    os.close(asking)
    thread.join(10)
    assert taken == [True]


def process_of(folder: Path) -> subprocess.Popen[bytes]:
    """Start the process of a run."""
    return subprocess.Popen([sys.executable, "-m", "app.teaching", str(folder)])


def test_a_second_process_of_a_run_leaves_it_to_the_first(tmp_path: Path) -> None:
    with RunLock(tmp_path):
        assert process_of(tmp_path).wait(60) == TAKEN
    assert not list(tmp_path.glob("*.json"))


@pytest.mark.long
def test_a_run_that_cannot_be_read_fails_in_words_and_ctrl_c_does_not_end_it(
    tmp_path: Path,
) -> None:
    process = process_of(tmp_path)
    while holder_of(tmp_path) is None:
        assert process.poll() is None
    process.send_signal(signal.SIGINT)  # as at the terminal of the console
    assert process.wait(60) == FAILED
    progress = read_progress(tmp_path)
    assert progress.phase == "failed" and "plan.json: no such file" in progress.message


@pytest.mark.parametrize("hears", [True, False])
def test_the_process_of_another_console_is_asked_to_end_and_then_killed(
    tmp_path: Path, hears: bool
) -> None:
    deaf = "" if hears else "signal.signal(signal.SIGTERM, signal.SIG_IGN);"
    program = (
        "import pathlib, signal, sys, time;"
        "from app.teaching.training.lock import RunLock;"
        f"{deaf}"
        "RunLock(pathlib.Path(sys.argv[1])).__enter__();"
        "time.sleep(60)"
    )
    process = subprocess.Popen([sys.executable, "-c", program, str(tmp_path)])
    while holder_of(tmp_path) is None:
        assert process.poll() is None
    end_holder(tmp_path, patience_s=30.0 if hears else 0.1)
    assert holder_of(tmp_path) is None
    assert process.wait(10) == -(signal.SIGTERM if hears else signal.SIGKILL)
