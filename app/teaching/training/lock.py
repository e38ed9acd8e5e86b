"""Lock of a training run: one process at a time, found again after a restart of the console."""

from __future__ import annotations

import contextlib
import fcntl
import os
import signal
from pathlib import Path
from types import TracebackType

LOCK_NAME = "process.lock"


class RunLock:
    """Held by the process of a run for as long as it lives; the file names it."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / LOCK_NAME

    def __enter__(self) -> bool:
        """Take the lock; False if another process has it."""
        handle = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(handle)
            return False
        os.ftruncate(handle, 0)
        os.write(handle, str(os.getpid()).encode())
        self._handle: int = handle
        return True

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Release the lock."""
        with contextlib.suppress(AttributeError, OSError):
            os.close(self._handle)


def holder_of(folder: Path) -> int | None:
    """Return the id of the process that holds the lock of a run; None without one."""
    try:
        handle = os.open(folder / LOCK_NAME, os.O_RDWR | os.O_CLOEXEC)
    except OSError:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        text = os.pread(handle, 20, 0)
        return int(text) if text.isdigit() else None
    else:
        return None
    finally:
        os.close(handle)


def ask_to_end(pid: int) -> None:
    """Ask the process of a run to end."""
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, signal.SIGTERM)
