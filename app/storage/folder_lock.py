"""The lock of a data folder, which a console of every version holds while it runs."""

from __future__ import annotations

import fcntl
from pathlib import Path
from typing import TextIO


def lock_folder(folder: Path) -> TextIO:
    """Lock a data folder until the returned file is closed; raises `BlockingIOError` where another
    program has locked it, `OSError` where the folder cannot be used."""
    file = (folder / "lock").open("w")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.close()
        raise
    return file
