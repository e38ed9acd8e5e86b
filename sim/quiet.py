"""Suppresses the messages that PyBullet prints from C, amid what a program prints there itself."""

from __future__ import annotations

import ctypes
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager

STDOUT, STDERR = 1, 2


@contextmanager
def quiet_output() -> Iterator[None]:
    """Discard what this process writes to the descriptors of standard output and error meanwhile;
    after an exception, what was written as an error is written after all."""
    flush = ctypes.CDLL(None).fflush
    flush(None)
    sys.stderr.flush()
    saved = [(descriptor, os.dup(descriptor)) for descriptor in (STDOUT, STDERR)]
    with tempfile.TemporaryFile() as errors:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, STDOUT)
        os.dup2(errors.fileno(), STDERR)
        failed = True
        try:
            yield
            failed = False
        finally:
            flush(None)  # C keeps a buffer of its own
            for descriptor, kept in saved:
                os.dup2(kept, descriptor)
                os.close(kept)
            os.close(null)
            if failed:
                errors.seek(0)
                os.write(STDERR, errors.read())
