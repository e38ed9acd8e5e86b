"""The event log: the newest entries in memory, all of them in a store that outlives the console.

A writer never waits for a disk: `note` only remembers, and `write`, in a thread of its own, stores
what has been noted. While the disk refuses, the newest entries wait in memory.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Sequence
from typing import Protocol

from navcore.errors import StorageFailed
from web.interface.insight import Entry, Kind, Page
from web.interface.wire import Position

log = logging.getLogger(__name__)

MAX_ENTRIES = 5000
"""Largest number of entries in memory: some hours of driving."""
LARGEST_ID = 2**62


class EventStore(Protocol):
    """Storage of entries that outlives the console; every method may raise `StorageFailed`."""

    def last(self) -> tuple[int, int]:
        """Return the largest id and the number of the newest start that wrote an entry; zeros
        before the first."""

    def oldest(self) -> int:
        """Return the smallest id; 0 before the first entry."""

    def append(self, entries: Sequence[Entry]) -> None:
        """Write all entries or none."""

    def between(
        self, since: int, before: int, *, kinds: Collection[Kind], limit: int
    ) -> tuple[Entry, ...]:
        """Return the newest entries of some kinds (none: all), `since` < id < `before`, at most
        `limit`, oldest first."""


class EventLog:
    """Entries in the order of their ids, which continue over all starts of the console."""

    def __init__(
        self,
        store: EventStore | None = None,
        *,
        max_entries: int = MAX_ENTRIES,
        wall_clock: Callable[[], float] = time.time,
    ) -> None:
        """Without a store the entries are lost at the end. Raises `StorageFailed` when the store
        cannot be read."""
        self._store, self._wall_clock = store, wall_clock
        self._entries: deque[Entry] = deque(maxlen=max_entries)
        self._lock = threading.Lock()
        self._newest, before = (0, 0) if store is None else store.last()
        self._start = before + 1
        self._written = self._newest
        self._oldest = 0 if store is None else store.oldest()
        self._fails = False

    def note(self, stamp_s: float, kind: Kind, text: str, place: Position | None = None) -> None:
        """Add an entry; a full memory drops its oldest."""
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
        """Return the newest entries of some kinds (none: all), `since` < id < `before`, at most
        `limit`, oldest first.

        Raises `StorageFailed` when only the store has these entries and cannot be read.
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
        if self._store is not None and len(chosen) < limit and since < first - 1:
            try:
                older = self._store.between(since, first, kinds=kinds, limit=limit - len(chosen))
            except StorageFailed:
                if not chosen:
                    raise
        oldest = self._oldest or (held[0].id if held else 0)
        return Page(newest=newest, oldest=oldest, start=self._start, entries=(*older, *chosen))

    def write(self) -> None:
        """Store the entries noted since the last write; a disk that refuses is tried again next
        time."""
        if self._store is None:
            return
        with self._lock:
            waiting = [entry for entry in self._entries if entry.id > self._written]
        if not waiting:
            return
        try:
            self._store.append(waiting)
            self._oldest = self._store.oldest()
        except StorageFailed as error:
            if not self._fails:
                log.error("the event log waits in memory for the disk: %s", error)
            self._fails = True
            return
        self._written, self._fails = waiting[-1].id, False
