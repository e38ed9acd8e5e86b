"""The log of decisions: bounded, in memory, written by one thread and read by any."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Collection

from web.insight import Entry, Kind, Page, Place

MAX_ENTRIES = 5000
"""The newest are kept: some hours of driving."""


class Journal:
    """Entries in order of their ids."""

    def __init__(self, *, most: int = MAX_ENTRIES, wall_clock: Callable[[], float] = time.time) -> None:
        self._entries: deque[Entry] = deque(maxlen=most)
        self._lock = threading.Lock()
        self._newest = 0
        self._wall_clock = wall_clock

    def note(self, stamp_s: float, kind: Kind, text: str, place: Place | None = None) -> None:
        """Write one more entry; the oldest gives way when the log is full."""
        with self._lock:
            self._newest += 1
            at = None if place is None else (round(place[0], 3), round(place[1], 3))
            entry = Entry(id=self._newest, stamp_s=stamp_s, unix_s=self._wall_clock(), kind=kind, text=text, place=at)
            self._entries.append(entry)

    def page(self, *, kinds: Collection[Kind], since: int, limit: int) -> Page:
        """The newest entries of these kinds (none: all) after the id `since`, at most `limit`, oldest first."""
        with self._lock:
            entries, newest = tuple(self._entries), self._newest
        chosen = [entry for entry in entries if entry.id > since and (not kinds or entry.kind in kinds)]
        return Page(newest=newest, oldest=entries[0].id if entries else 0, entries=tuple(chosen[-limit:] if limit else ()))
