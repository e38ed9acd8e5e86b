"""Lock of a training run: one process at a time, found again after a restart of the console."""

from __future__ import annotations

import contextlib
import fcntl
import os
import signal
import time
from pathlib import Path
from types import TracebackType

LOCK_NAME = "process.lock"
TRIES, PAUSE_S = 50, 0.02
"""Number of times that the lock is tried, and seconds in between: a process that asks for its
holder has it for a moment."""
KILLED_S = 2.0
"""Longest wait for a process that is killed, seconds."""


class RunLock:
    """Held by the process of a run for as long as it lives; the file names it."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / LOCK_NAME

    def __enter__(self) -> bool:
        """Take the lock; False if another process has it, or it cannot be taken."""
        handle = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        for _ in range(TRIES):
            with contextlib.suppress(OSError):
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                os.ftruncate(handle, 0)
                os.write(handle, str(os.getpid()).encode())
                self._handle: int = handle
                return True
            time.sleep(PAUSE_S)
        os.close(handle)
        return False

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Release the lock."""
        with contextlib.suppress(AttributeError, OSError):
            os.ftruncate(self._handle, 0)  # the number may be another process's by and by
            os.close(self._handle)


def holder_of(folder: Path) -> int | None:
    """Return the id of the process that holds the lock of a run; None without one."""
    try:
        handle = os.open(folder / LOCK_NAME, os.O_RDWR | os.O_CLOEXEC)
    except OSError:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)  # any number may ask at once
    except OSError:
        text = os.pread(handle, 20, 0)
        return int(text) if text.isdigit() else None
    else:
        return None
    finally:
        os.close(handle)


def end_holder(folder: Path, patience_s: float) -> None:
    """Ask the process that holds the lock of a run to end, and kill it where it takes too long;
    raises `OSError` where it is not allowed to."""
    for number, wait_s in ((signal.SIGTERM, patience_s), (signal.SIGKILL, KILLED_S)):
        pid = holder_of(folder)
        if pid is None:
            return
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, number)
        deadline = time.monotonic() + wait_s
        while holder_of(folder) == pid and time.monotonic() < deadline:
            time.sleep(PAUSE_S)
