"""The lock of a data folder, which a console of every version holds while it runs."""

from __future__ import annotations

import fcntl
import time
from pathlib import Path
from typing import TextIO

WAITS_S = 3.0
"""Time in seconds for which the lock is waited for: a command holds it while it converts the folder
of an earlier version."""
_PERIOD_S = 0.1


def lock_folder(folder: Path) -> TextIO:
    """Lock a data folder until the returned file is closed; raises `BlockingIOError` where another
    program keeps it locked, `OSError` where the folder cannot be used."""
    file = (folder / "lock").open("w")
    try:
        _lock(file)
    except OSError:
        file.close()
        raise
    return file


def _lock(file: TextIO) -> None:
    until_s = time.monotonic() + WAITS_S
    while True:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() >= until_s:
                raise
            time.sleep(_PERIOD_S)
        else:
            return
