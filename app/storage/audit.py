"""What happened, in the order it happened: entries are added and read, never changed. The oldest
give way to new ones."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from app.storage.database import Database

MAX_ENTRIES = 100_000
SWEEP_EVERY = 1_000


class Journal:
    """All entries of one kind. The wall clock only dates them; nothing is decided by it, and the id
    gives the order."""

    def __init__(self, database: Database, kind: str) -> None:
        self._database, self._kind = database, kind

    def add(self, entry: Mapping[str, Any]) -> int:
        """Put down what happened just now; the new entry's id."""
        at = _stamp(datetime.now(UTC))
        with self._database.writing() as connection:
            values = (self._kind, at, json.dumps(dict(entry)))
            number = int(
                connection.execute(
                    "INSERT INTO journal (kind, at, entry) VALUES (?, ?, ?)", values
                ).lastrowid
                or 0
            )
            if number % SWEEP_EVERY == 0:
                kept = "SELECT id FROM journal WHERE kind = ? ORDER BY id DESC LIMIT -1 OFFSET ?"
                connection.execute(
                    f"DELETE FROM journal WHERE id IN ({kept})", (self._kind, MAX_ENTRIES)
                )
        return number

    def newest(
        self,
        count: int = 100,
        *,
        before: int | None = None,
        who: str | None = None,
        since: datetime | None = None,
        until: datetime | None = None,
    ) -> tuple[dict[str, Any], ...]:
        """At most `count` entries, newest first, each with `id` and `at` (UTC); `before` goes on
        from an id.

        `who` keeps those whose `who` it is; `since` and `until`, which know their time zone, those
        put down between the two.
        """
        wanted: list[tuple[str, object]] = [("kind = ?", self._kind)]
        wanted += [("id < ?", before)] if before is not None else []
        wanted += [("json_extract(entry, '$.who') = ?", who)] if who is not None else []
        wanted += [("at >= ?", _stamp(since))] if since is not None else []
        wanted += [("at <= ?", _stamp(until))] if until is not None else []
        query = f"SELECT id, at, entry FROM journal WHERE {' AND '.join(test for test, _ in wanted)} ORDER BY id DESC LIMIT ?"
        rows = self._database.rows(query, (*(value for _, value in wanted), count))
        return tuple({"id": row[0], "at": row[1], **json.loads(row[2])} for row in rows)


def _stamp(at: datetime) -> str:
    """As entries are dated: texts that sort like times."""
    return at.astimezone(UTC).isoformat(timespec="milliseconds")
