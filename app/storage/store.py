"""The console's store. A write that fails raises `StorageFailed` and changes nothing."""

from __future__ import annotations

import fcntl
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from app.storage.audit import AuditTable
from app.storage.database import Database
from app.storage.events import EventTable
from app.storage.records import zone_of, zone_record
from app.storage.users import UserTable
from navcore.errors import NotKnown, StorageFailed
from navcore.mission.beware_list import BewareClass, BewareList, as_table
from navcore.mission.zone import Zone
from navcore.toml_config import from_table

MAX_RUNS = 1000


class Store:
    """One data folder, locked by one console; safe to use from any thread."""

    def __init__(self, folder: Path) -> None:
        """Lock and open; raises `StorageFailed` when the folder is in use or cannot be written."""
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock_file = (folder / "lock").open("w")
        except OSError as error:
            raise StorageFailed(f"the data folder {folder} cannot be used: {error}") from None
        try:
            self._lock(folder)
            self._database = Database(folder)
        except StorageFailed:
            self._lock_file.close()
            raise
        self.path = self._database.path
        self.users = UserTable(self._database)
        """User accounts."""
        self.audit = AuditTable(self._database)
        """Audit log: who did what, and when."""
        self.events = EventTable(self._database)
        """Event log: what the navigation decided, when and why."""

    def close(self) -> None:
        """Close the files and unlock the folder."""
        self._database.close()
        self._lock_file.close()

    def _lock(self, folder: Path) -> None:
        """Allow one console per folder: two would overwrite the zones of each other."""
        try:
            fcntl.flock(self._lock_file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise StorageFailed(
                f"another console uses the data folder {folder}; end it, or give another --data"
            ) from None

    def zones(self) -> tuple[Zone, ...]:
        """Return all zones, in the order in which they were first stored."""
        rows = self._database.rows("SELECT zone FROM zones ORDER BY position")
        return tuple(zone_of(json.loads(zone)) for (zone,) in rows)

    def save_zone(self, zone: Zone) -> None:
        """Store a zone, replacing the one with its id."""
        self.change_zones([zone], [])

    def change_zones(self, saved: Iterable[Zone], deleted: Iterable[str]) -> None:
        """Delete some zones and store others by their id: all or nothing."""
        with self._database.writing() as connection:
            connection.executemany(
                "DELETE FROM zones WHERE id = ?", [(zone_id,) for zone_id in deleted]
            )
            connection.executemany(
                "INSERT INTO zones (id, zone) VALUES (?, ?) "
                "ON CONFLICT (id) DO UPDATE SET zone = excluded.zone",
                [(zone.id, json.dumps(zone_record(zone))) for zone in saved],
            )

    def documents(self, kind: str) -> dict[str, Any]:
        """Return the JSON documents of a kind by name, sorted by name."""
        rows = self._database.rows(
            "SELECT name, document FROM documents WHERE kind = ? ORDER BY name", (kind,)
        )
        return {name: json.loads(document) for name, document in rows}

    def save_document(self, kind: str, name: str, value: Any) -> None:
        """Store a JSON document under a name; None deletes it."""
        if value is None:
            self._database.write("DELETE FROM documents WHERE kind = ? AND name = ?", (kind, name))
        else:
            self._database.write(
                "INSERT OR REPLACE INTO documents VALUES (?, ?, ?)",
                (kind, name, json.dumps(value)),
            )

    def beware(self) -> BewareList | None:
        """Return the list saved last; None on a new installation."""
        rows = self._database.rows("SELECT list FROM beware_lists ORDER BY position DESC LIMIT 1")
        return _beware_list(rows[0][0]) if rows else None

    def beware_versions(self) -> tuple[BewareList, ...]:
        """Return every list that was ever saved, newest first."""
        return tuple(
            _beware_list(row[0])
            for row in self._database.rows("SELECT list FROM beware_lists ORDER BY position DESC")
        )

    def save_beware(self, beware: BewareList) -> None:
        """Store the list in force; earlier lists are kept."""
        classes = [as_table(entry) for entry in beware.classes]
        document = json.dumps(
            {"version": beware.version, "classes": classes, "retired": beware.retired}
        )
        self._database.write(
            "INSERT INTO beware_lists (version, list) VALUES (?, ?)", (beware.version, document)
        )

    def runs(self) -> tuple[dict[str, Any], ...]:
        """Return the reports of past missions, newest first."""
        rows = self._database.rows(
            "SELECT report FROM runs ORDER BY rowid DESC LIMIT ?", (MAX_RUNS,)
        )
        return tuple(json.loads(row[0]) for row in rows)

    def run(self, run_id: str) -> dict[str, Any]:
        """Return one report; raises `NotKnown`."""
        rows = self._database.rows("SELECT report FROM runs WHERE id = ?", (run_id,))
        if not rows:
            raise NotKnown(f"no run has the id {run_id!r}")
        report: dict[str, Any] = json.loads(rows[0][0])
        return report

    def save_run(self, report: dict[str, Any]) -> None:
        """Store the report of a mission under its `id`."""
        self._database.write(
            "INSERT OR REPLACE INTO runs VALUES (?, ?)", (report["id"], json.dumps(report))
        )


def _beware_list(document: str) -> BewareList:
    saved = json.loads(document)
    classes = tuple(
        from_table(BewareClass, table, f"stored beware list[{i}]")
        for i, table in enumerate(saved["classes"])
    )
    retired = tuple((name, class_id) for name, class_id in saved["retired"])
    return BewareList(classes=classes, version=saved["version"], retired=retired)
