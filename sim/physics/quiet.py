"""Suppresses the messages that PyBullet and its EGL plugin print on standard output from C, amid
what a program prints there itself."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager

STDOUT = 1


@contextmanager
def quiet_stdout() -> Iterator[None]:
    """Discard what this process writes to the descriptor of standard output meanwhile."""
    flush = ctypes.CDLL(None).fflush
    flush(None)
    saved, null = os.dup(STDOUT), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, STDOUT)
    try:
        yield
    finally:
        flush(None)  # C keeps a buffer of its own
        os.dup2(saved, STDOUT)
        os.close(saved)
        os.close(null)
