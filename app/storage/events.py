"""The log of decisions on disk: what the navigation decided over all the console's starts. The
oldest give way to new ones."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from app.storage.database import Database
from web.insight import Entry, Kind

MAX_ENTRIES = 100_000
_COLUMNS = "id, start, stamp_s, unix_s, kind, text, x_m, y_m"


class DecisionTable:
    """Satisfies `app.journal.Shelf`. Whoever writes has numbered the entries: an entry written
    twice is one entry."""

    def __init__(self, database: Database, *, most: int = MAX_ENTRIES) -> None:
        self._database, self._most = database, most

    def last(self) -> tuple[int, int]:
        """The largest id and the newest start of the console that wrote anything; zeros before the
        first entry."""
        ((number, start),) = self._database.rows(
            "SELECT coalesce(max(id), 0), coalesce(max(start), 0) FROM decisions"
        )
        return int(number), int(start)

    def oldest(self) -> int:
        """The smallest id; 0 before the first entry."""
        ((number,),) = self._database.rows("SELECT coalesce(min(id), 0) FROM decisions")
        return int(number)

    def append(self, entries: Sequence[Entry]) -> None:
        """All of them, as one write, or none: then it raises `StorageFailed`."""
        with self._database.writing() as connection:
            marks = "?, ?, ?, ?, ?, ?, ?, ?"
            connection.executemany(
                f"INSERT OR REPLACE INTO decisions ({_COLUMNS}) VALUES ({marks})",
                map(_row, entries),
            )
            connection.execute(
                "DELETE FROM decisions WHERE id <= (SELECT max(id) FROM decisions) - ?",
                (self._most,),
            )

    def between(
        self, since: int, before: int, *, kinds: Collection[Kind], limit: int
    ) -> tuple[Entry, ...]:
        """The newest entries of these kinds (none: all) with an id between the two, at most
        `limit`, oldest first."""
        chosen = sorted(kinds)
        only = f" AND kind IN ({', '.join('?' * len(chosen))})" if chosen else ""
        query = f"SELECT {_COLUMNS} FROM decisions WHERE id > ? AND id < ?{only} ORDER BY id DESC LIMIT ?"
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
