"""The audit log on disk: entries are added and read, never changed; the oldest are deleted when
there are too many."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import MINYEAR, UTC, datetime
from typing import Any

from app.storage.database import Database

MAX_ENTRIES = 100_000
SWEEP_PERIOD = 1_000
"""Number of new entries after which surplus old ones are deleted."""


class AuditTable:
    """Satisfies `web`'s port of the audit log.

    The wall clock only dates the entries; nothing is decided by it, and the id gives the order.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def add(self, entry: Mapping[str, Any]) -> int:
        """Add an entry dated now and return its id."""
        at = _stamp(datetime.now(UTC))
        with self._database.writing() as connection:
            added = connection.execute(
                "INSERT INTO audit (at, entry) VALUES (?, ?)", (at, json.dumps(dict(entry)))
            )
            number = int(added.lastrowid or 0)
            if number % SWEEP_PERIOD == 0:
                connection.execute("DELETE FROM audit WHERE id <= ?", (number - MAX_ENTRIES,))
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
        """Return at most `count` entries, newest first, each with its `id` and `at` (UTC).

        `before` continues from an id. `who` selects the entries of one user; `since` and `until`,
        which know their time zone, select those dated between the two.
        """
        wanted: list[tuple[str, object]] = []
        wanted += [("id < ?", before)] if before is not None else []
        wanted += [("json_extract(entry, '$.who') = ?", who)] if who is not None else []
        wanted += [("at >= ?", _stamp(since))] if since is not None else []
        wanted += [("at <= ?", _stamp(until))] if until is not None else []
        where = f" WHERE {' AND '.join(test for test, _ in wanted)}" if wanted else ""
        query = f"SELECT id, at, entry FROM audit{where} ORDER BY id DESC LIMIT ?"
        rows = self._database.rows(query, (*(value for _, value in wanted), count))
        return tuple({"id": row[0], "at": row[1], **json.loads(row[2])} for row in rows)


def _stamp(at: datetime) -> str:
    """Return the date of an entry as text that sorts like the times."""
    try:
        utc = at.astimezone(UTC)
    except OverflowError:  # before the year 1 or after 9999 in UTC
        utc = (datetime.min if at.year == MINYEAR else datetime.max).replace(tzinfo=UTC)
    return utc.isoformat(timespec="milliseconds")
