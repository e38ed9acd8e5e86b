"""Temporary files of which one is open at a time."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable
from typing import BinaryIO

from navcore.errors import Refused


class SingleFile:
    """Opens a file unless the last one that it opened is still open; thread-safe."""

    def __init__(self, refusal: str) -> None:
        """`refusal`: sentence by which a second one is refused."""
        self._refusal, self._making = refusal, threading.Lock()
        # Weak: the file of an answer that was never read, or of a request, is closed with it.
        self._last: Callable[[], BinaryIO | None] = lambda: None

    def open(self, make: Callable[[], BinaryIO]) -> BinaryIO:
        """Return what `make` opens; raises `Refused` until the last one is closed."""
        # A second one does not wait while the first is made, which may take long.
        if not self._making.acquire(blocking=False):
            raise Refused(self._refusal)
        try:
            last = self._last()
            if last is not None and not last.closed:
                raise Refused(self._refusal)
            file = make()
            self._last = weakref.ref(file)
            return file
        finally:
            self._making.release()
