"""Everything the console keeps, by what it is. A write that fails raises `StorageFailed` and leaves
everything as it was."""

from __future__ import annotations

import fcntl
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from app.storage.audit import Journal
from app.storage.database import Database
from app.storage.events import DecisionTable
from app.storage.records import zone_of, zone_record
from app.storage.users import UserTable
from navcore.errors import NotKnown, StorageFailed
from navcore.mission.beware_list import BewareClass, BewareList, as_table
from navcore.mission.zone import Zone
from navcore.toml_config import from_table

MAX_RUNS = 1000


class Store:
    """One data folder, claimed by one console; safe to use from any thread."""

    def __init__(self, folder: Path) -> None:
        """Claim and open; raises `StorageFailed` when the folder is in use or cannot be written."""
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._claim = (folder / "lock").open("w")
        except OSError as error:
            raise StorageFailed(f"the data folder {folder} cannot be used: {error}") from None
        try:
            self._take(folder)
            self._database = Database(folder)
        except StorageFailed:
            self._claim.close()
            raise
        self.path = self._database.path
        self.users = UserTable(self._database)
        """Who may log in."""
        self.audit = Journal(self._database, "audit")
        """Who did what, when."""
        self.decisions = DecisionTable(self._database)
        """What the navigation decided, when and why."""

    def close(self) -> None:
        """Release the folder."""
        self._database.close()
        self._claim.close()

    def _take(self, folder: Path) -> None:
        """One console a folder: two would each bind the robot by zones the other has changed."""
        try:
            fcntl.flock(self._claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise StorageFailed(
                f"another console uses the data folder {folder}; end it, or give another --data"
            ) from None

    def zones(self) -> tuple[Zone, ...]:
        """All zones, in the order they were first stored."""
        rows = self._database.rows("SELECT zone FROM zones ORDER BY place")
        return tuple(zone_of(json.loads(zone)) for (zone,) in rows)

    def save_zone(self, zone: Zone) -> None:
        """Store or overwrite a zone by its id."""
        self.change_zones([zone], [])

    def delete_zone(self, zone_id: str) -> None:
        """Forget a zone."""
        self.change_zones([], [zone_id])

    def change_zones(self, saved: Iterable[Zone], deleted: Iterable[str]) -> None:
        """Forget some zones and store others, each in the place of one with its id: all or nothing."""
        with self._database.writing() as connection:
            connection.executemany(
                "DELETE FROM zones WHERE id = ?", [(zone_id,) for zone_id in deleted]
            )
            connection.executemany(
                "INSERT INTO zones (id, zone) VALUES (?, ?) ON CONFLICT (id) DO UPDATE SET zone = excluded.zone",
                [(zone.id, json.dumps(zone_record(zone))) for zone in saved],
            )

    def kept(self, kind: str) -> dict[str, Any]:
        """Name → JSON value of everything of a kind that operators keep under names, in the order
        of names."""
        rows = self._database.rows(
            "SELECT name, document FROM named WHERE kind = ? ORDER BY name", (kind,)
        )
        return {name: json.loads(document) for name, document in rows}

    def keep(self, kind: str, name: str, value: Any) -> None:
        """Store a JSON value under a name; None forgets it."""
        if value is None:
            self._database.write("DELETE FROM named WHERE kind = ? AND name = ?", (kind, name))
        else:
            self._database.write(
                "INSERT OR REPLACE INTO named VALUES (?, ?, ?)", (kind, name, json.dumps(value))
            )

    def beware(self) -> BewareList | None:
        """The list saved last; None on a new installation."""
        rows = self._database.rows("SELECT list FROM beware_lists ORDER BY place DESC LIMIT 1")
        return _beware_list(rows[0][0]) if rows else None

    def beware_versions(self) -> tuple[BewareList, ...]:
        """Every list that was ever in force here, newest first."""
        return tuple(
            _beware_list(row[0])
            for row in self._database.rows("SELECT list FROM beware_lists ORDER BY place DESC")
        )

    def save_beware(self, beware: BewareList) -> None:
        """Store the list in force; those before it are kept."""
        classes = [as_table(entry) for entry in beware.classes]
        document = json.dumps(
            {"version": beware.version, "classes": classes, "retired": beware.retired}
        )
        self._database.write(
            "INSERT INTO beware_lists (version, list) VALUES (?, ?)", (beware.version, document)
        )

    def runs(self) -> tuple[dict[str, Any], ...]:
        """Reports of past missions, newest first."""
        rows = self._database.rows(
            "SELECT report FROM runs ORDER BY rowid DESC LIMIT ?", (MAX_RUNS,)
        )
        return tuple(json.loads(row[0]) for row in rows)

    def run(self, run_id: str) -> dict[str, Any]:
        """One report; raises `NotKnown`."""
        rows = self._database.rows("SELECT report FROM runs WHERE id = ?", (run_id,))
        if not rows:
            raise NotKnown(f"no run has the id {run_id!r}")
        report: dict[str, Any] = json.loads(rows[0][0])
        return report

    def save_run(self, report: dict[str, Any]) -> None:
        """Store a mission's report under its `id`."""
        self._database.write(
            "INSERT OR REPLACE INTO runs VALUES (?, ?)", (report["id"], json.dumps(report))
        )


def _beware_list(document: str) -> BewareList:
    saved = json.loads(document)
    classes = tuple(
        from_table(BewareClass, table, f"stored beware list[{i}]")
        for i, table in enumerate(saved["classes"])
    )
    retired = tuple((name, class_id) for name, class_id in saved.get("retired", []))
    return BewareList(classes=classes, version=saved["version"], retired=retired)
