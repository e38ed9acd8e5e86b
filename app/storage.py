"""What must survive a restart: zones, the beware list, the reports of past missions. SQLite, WAL, synchronous FULL.

An acknowledged write is on the disk. A write that fails raises `StorageFailed` and leaves everything stored before as it was.
"""

from __future__ import annotations

import fcntl
import json
import sqlite3
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from app.zone_records import zone_of, zone_record
from navcore.beware import BewareClass, BewareList, as_table
from navcore.errors import NotKnown, StorageFailed
from navcore.settings import from_table
from navcore.zones import Zone

_SCHEMA = """
CREATE TABLE IF NOT EXISTS zones (
    id TEXT PRIMARY KEY, name TEXT NOT NULL, polygon TEXT NOT NULL,
    enabled INTEGER NOT NULL, margin_m REAL NOT NULL, version INTEGER NOT NULL
) STRICT;
CREATE TABLE IF NOT EXISTS beware (only INTEGER PRIMARY KEY CHECK (only = 1), list TEXT NOT NULL) STRICT;
CREATE TABLE IF NOT EXISTS runs (id TEXT PRIMARY KEY, report TEXT NOT NULL) STRICT;
CREATE TABLE IF NOT EXISTS zone_details (id TEXT PRIMARY KEY, details TEXT NOT NULL) STRICT;
CREATE TABLE IF NOT EXISTS kept (kind TEXT, name TEXT, value TEXT NOT NULL, PRIMARY KEY (kind, name)) STRICT;
"""
_SAVE_ZONE = (
    "INSERT INTO zones VALUES (?, ?, ?, ?, ?, ?) ON CONFLICT (id) DO UPDATE SET name = excluded.name, "
    "polygon = excluded.polygon, enabled = excluded.enabled, margin_m = excluded.margin_m, version = excluded.version"
)
_DETAILS = ("kind", "max_speed_mps", "colour", "expires_at_s", "drawn")
"""Of a zone, beside what the first version of the table has."""
BUSY_S = 0.5
"""How long a write waits for another process's lock before it is refused."""


class Store:
    """One SQLite file; safe to use from any thread."""

    def __init__(self, folder: Path) -> None:
        self._lock = threading.Lock()
        self.path = folder / "console.sqlite"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._claim = (folder / "lock").open("w")
            self._take(folder)
            self._database = sqlite3.connect(self.path, timeout=BUSY_S, check_same_thread=False, isolation_level=None)
            self._database.execute("PRAGMA journal_mode = WAL")
            self._database.execute("PRAGMA synchronous = FULL")
            self._database.executescript(_SCHEMA)
        except (OSError, sqlite3.Error) as error:
            raise StorageFailed(f"the data folder {folder} cannot be used: {error}") from None

    def close(self) -> None:
        """Release the file."""
        with self._lock:
            self._database.close()
            self._claim.close()

    def _take(self, folder: Path) -> None:
        """One console a folder: two would each bind the robot by zones the other has changed."""
        try:
            fcntl.flock(self._claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._claim.close()
            raise StorageFailed(f"another console uses the data folder {folder}; end it, or give another --data") from None

    def zones(self) -> tuple[Zone, ...]:
        """All zones, in the order they were first stored."""
        with self._reading() as database:
            rows = database.execute(
                "SELECT zones.id, name, polygon, enabled, margin_m, version, details "
                "FROM zones LEFT JOIN zone_details ON zones.id = zone_details.id ORDER BY zones.rowid"
            ).fetchall()
        return tuple(
            zone_of(
                {
                    "id": row[0],
                    "name": row[1],
                    "polygon": json.loads(row[2]),
                    "enabled": bool(row[3]),
                    "margin_m": row[4],
                    "version": row[5],
                    **json.loads(row[6] or "{}"),
                }
            )
            for row in rows
        )

    def save_zone(self, zone: Zone) -> None:
        """Store or overwrite a zone by its id."""
        self.change_zones([zone], [])

    def delete_zone(self, zone_id: str) -> None:
        """Forget a zone."""
        self.change_zones([], [zone_id])

    def change_zones(self, saved: Iterable[Zone], deleted: Iterable[str]) -> None:
        """Store some zones, each in the place of one with its id, and forget others: all or nothing."""
        statements: list[tuple[str, tuple[object, ...]]] = []
        for zone_id in deleted:
            statements += [(f"DELETE FROM {table} WHERE id = ?", (zone_id,)) for table in ("zones", "zone_details")]
        for zone in saved:
            row = (zone.id, zone.name, json.dumps(zone.polygon), int(zone.enabled), zone.margin_m, zone.version)
            details = {name: value for name, value in zone_record(zone).items() if name in _DETAILS}
            statements += [
                (_SAVE_ZONE, row),
                ("INSERT OR REPLACE INTO zone_details VALUES (?, ?)", (zone.id, json.dumps(details))),
            ]
        self._write_all(statements)

    def kept(self, kind: str) -> dict[str, Any]:
        """Name → JSON value of everything of a kind, in the order of names."""
        with self._reading() as database:
            rows = database.execute("SELECT name, value FROM kept WHERE kind = ? ORDER BY name", (kind,)).fetchall()
        return {name: json.loads(value) for name, value in rows}

    def keep(self, kind: str, name: str, value: Any) -> None:
        """Store a JSON value under a name; None forgets it."""
        if value is None:
            self._write("DELETE FROM kept WHERE kind = ? AND name = ?", (kind, name))
        else:
            self._write("INSERT OR REPLACE INTO kept VALUES (?, ?, ?)", (kind, name, json.dumps(value)))

    def beware(self) -> BewareList | None:
        """The list saved last; None on a new installation."""
        with self._reading() as database:
            row = database.execute("SELECT list FROM beware").fetchone()
        if row is None:
            return None
        saved = json.loads(row[0])
        classes = tuple(from_table(BewareClass, table, f"stored beware list[{i}]") for i, table in enumerate(saved["classes"]))
        return BewareList(classes=classes, version=saved["version"])

    def save_beware(self, beware: BewareList) -> None:
        """Store the list in force."""
        document = json.dumps({"version": beware.version, "classes": [as_table(entry) for entry in beware.classes]})
        self._write("INSERT OR REPLACE INTO beware VALUES (1, ?)", (document,))

    def runs(self) -> tuple[dict[str, Any], ...]:
        """Reports of past missions, newest first."""
        with self._reading() as database:
            rows = database.execute("SELECT report FROM runs ORDER BY rowid DESC LIMIT 1000").fetchall()
        return tuple(json.loads(row[0]) for row in rows)

    def run(self, run_id: str) -> dict[str, Any]:
        """One report; raises `NotKnown`."""
        with self._reading() as database:
            row = database.execute("SELECT report FROM runs WHERE id = ?", (run_id,)).fetchone()
        if row is None:
            raise NotKnown(f"no run has the id {run_id!r}")
        report: dict[str, Any] = json.loads(row[0])
        return report

    def save_run(self, report: dict[str, Any]) -> None:
        """Store a mission's report under its `id`."""
        self._write("INSERT OR REPLACE INTO runs VALUES (?, ?)", (report["id"], json.dumps(report)))

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        with self._lock:
            try:
                yield self._database
            except sqlite3.Error as error:
                raise StorageFailed(f"the store {self.path} cannot be read: {error}") from None

    def _write(self, statement: str, values: tuple[object, ...]) -> None:
        self._write_all([(statement, values)])

    def _write_all(self, statements: Sequence[tuple[str, tuple[object, ...]]]) -> None:
        with self._lock:
            try:
                self._database.execute("BEGIN IMMEDIATE")
                for statement, values in statements:
                    self._database.execute(statement, values)
                self._database.execute("COMMIT")
            except sqlite3.Error as error:
                with suppress(sqlite3.Error):
                    self._database.execute("ROLLBACK")
                raise StorageFailed(f"not saved, what was stored before is intact: {error}") from None
