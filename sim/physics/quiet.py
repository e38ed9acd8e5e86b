"""PyBullet and its EGL plugin chat on standard output from C; that would end up amid what a program
prints there itself."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager

STDOUT = 1


@contextmanager
def quiet_stdout() -> Iterator[None]:
    """Send what is written to standard output's descriptor, by anybody in this process, to nowhere
    meanwhile."""
    flush = ctypes.CDLL(None).fflush
    flush(None)
    kept, nowhere = os.dup(STDOUT), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, STDOUT)
    try:
        yield
    finally:
        flush(None)  # C keeps a buffer of its own
        os.dup2(kept, STDOUT)
        os.close(kept)
        os.close(nowhere)
