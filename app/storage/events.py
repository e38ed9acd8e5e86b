"""The event log on disk, over all starts of the console; the oldest entries are deleted when there
are too many."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from app.storage.database import Database
from web.interface.insight import Entry, Kind

MAX_ENTRIES = 100_000
_COLUMNS = "id, start, stamp_s, unix_s, kind, text, x_m, y_m"


class EventTable:
    """Satisfies `app.insight.event_log.EventStore`.

    The writer has numbered the entries: an entry that is written twice is stored once.
    """

    def __init__(self, database: Database, *, max_entries: int = MAX_ENTRIES) -> None:
        self._database, self._max_entries = database, max_entries

    def last(self) -> tuple[int, int]:
        """Return the largest id and the number of the newest start that wrote an entry; zeros
        before the first."""
        ((number, start),) = self._database.rows(
            "SELECT coalesce(max(id), 0), coalesce(max(start), 0) FROM events"
        )
        return int(number), int(start)

    def oldest(self) -> int:
        """Return the smallest id; 0 before the first entry."""
        ((number,),) = self._database.rows("SELECT coalesce(min(id), 0) FROM events")
        return int(number)

    def append(self, entries: Sequence[Entry]) -> None:
        """Write all entries or none; raises `StorageFailed` when none is written."""
        with self._database.writing() as connection:
            marks = "?, ?, ?, ?, ?, ?, ?, ?"
            connection.executemany(
                f"INSERT OR REPLACE INTO events ({_COLUMNS}) VALUES ({marks})",
                map(_row, entries),
            )
            connection.execute(
                "DELETE FROM events WHERE id <= (SELECT max(id) FROM events) - ?",
                (self._max_entries,),
            )

    def between(
        self, since: int, before: int, *, kinds: Collection[Kind], limit: int
    ) -> tuple[Entry, ...]:
        """Return the newest entries of some kinds (none: all), `since` < id < `before`, at most
        `limit`, oldest first."""
        chosen = sorted(kinds)
        only = f" AND kind IN ({', '.join('?' * len(chosen))})" if chosen else ""
        query = (
            f"SELECT {_COLUMNS} FROM events WHERE id > ? AND id < ?{only} ORDER BY id DESC LIMIT ?"
        )
        rows = self._database.rows(query, (since, before, *chosen, limit))
        return tuple(_entry(row) for row in reversed(rows))


def _row(entry: Entry) -> tuple[object, ...]:
    x_m, y_m = entry.place or (None, None)
    return entry.id, entry.start, entry.stamp_s, entry.unix_s, entry.kind, entry.text, x_m, y_m


def _entry(row: tuple[Any, ...]) -> Entry:
    number, start, stamp_s, unix_s, kind, text, x_m, y_m = row
    place = None if x_m is None or y_m is None else (x_m, y_m)
    return Entry(
        id=number, start=start, stamp_s=stamp_s, unix_s=unix_s, kind=kind, text=text, place=place
    )
