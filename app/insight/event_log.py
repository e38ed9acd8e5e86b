"""The log of decisions: the newest in memory, all of them on a shelf that outlives the console.

Whoever has something to say never waits for a disk: `note` only remembers, and `write`, in a thread
of its own, puts down what has come together. While the disk refuses, the newest wait in memory.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Sequence
from typing import Protocol

from navcore.errors import StorageFailed
from web.insight import Entry, Kind, Page, Place

log = logging.getLogger(__name__)

MAX_ENTRIES = 5000
"""So many are in memory: some hours of driving."""
LARGEST_ID = 2**62


class Shelf(Protocol):
    """Where entries outlive the console. What is asked of it may raise `StorageFailed`."""

    def last(self) -> tuple[int, int]:
        """The largest id and the newest start of the console; zeros before the first entry."""

    def oldest(self) -> int:
        """The smallest id; 0 before the first entry."""

    def append(self, entries: Sequence[Entry]) -> None:
        """All of them or none."""

    def between(
        self, since: int, before: int, *, kinds: Collection[Kind], limit: int
    ) -> tuple[Entry, ...]:
        """The newest of these kinds (none: all) with an id between the two, at most `limit`, oldest
        first."""


class Journal:
    """Entries in order of their ids, which go on from one start of the console to the next."""

    def __init__(
        self,
        shelf: Shelf | None = None,
        *,
        most: int = MAX_ENTRIES,
        wall_clock: Callable[[], float] = time.time,
    ) -> None:
        """Without a shelf it is forgotten at the end. Raises `StorageFailed` when the shelf cannot
        be read."""
        self._shelf, self._wall_clock = shelf, wall_clock
        self._entries: deque[Entry] = deque(maxlen=most)
        self._lock = threading.Lock()
        self._newest, before = (0, 0) if shelf is None else shelf.last()
        self._start = before + 1
        self._written = self._newest
        self._oldest = 0 if shelf is None else shelf.oldest()
        self._fails = False

    def note(self, stamp_s: float, kind: Kind, text: str, place: Place | None = None) -> None:
        """Write one more entry; the oldest in memory gives way when it is full."""
        at = None if place is None else (round(place[0], 3), round(place[1], 3))
        with self._lock:
            self._newest += 1
            entry = Entry(
                id=self._newest,
                start=self._start,
                stamp_s=stamp_s,
                unix_s=self._wall_clock(),
                kind=kind,
                text=text,
                place=at,
            )
            self._entries.append(entry)

    def page(
        self, *, kinds: Collection[Kind], since: int, limit: int, before: int | None = None
    ) -> Page:
        """The newest entries of these kinds (none: all) with an id between `since` and `before`, at
        most `limit`, oldest first.

        Raises `StorageFailed` when only the shelf has what was asked for, and cannot be read.
        """
        with self._lock:
            held, newest = tuple(self._entries), self._newest
        until = LARGEST_ID if before is None else before
        chosen = [
            entry
            for entry in held
            if since < entry.id < until and (not kinds or entry.kind in kinds)
        ]
        chosen = chosen[-limit:] if limit else []
        first = min(held[0].id if held else newest + 1, until)
        older: tuple[Entry, ...] = ()
        if self._shelf is not None and len(chosen) < limit and since < first - 1:
            try:
                older = self._shelf.between(since, first, kinds=kinds, limit=limit - len(chosen))
            except StorageFailed:
                if not chosen:
                    raise
        oldest = self._oldest or (held[0].id if held else 0)
        return Page(newest=newest, oldest=oldest, start=self._start, entries=(*older, *chosen))

    def write(self) -> None:
        """Put down what has been noted since the last time. A disk that refuses is tried again the
        next time."""
        if self._shelf is None:
            return
        with self._lock:
            waiting = [entry for entry in self._entries if entry.id > self._written]
        if not waiting:
            return
        try:
            self._shelf.append(waiting)
            self._oldest = self._shelf.oldest()
        except StorageFailed as error:
            if not self._fails:
                log.error("the log of decisions waits in memory for the disk: %s", error)
            self._fails = True
            return
        self._written, self._fails = waiting[-1].id, False
