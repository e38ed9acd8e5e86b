"""The console's store. A write that fails raises `StorageFailed` and changes nothing.

What belongs to a site is in `SiteStore`, which `Store.site` and `Store.sites` give.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from app.storage.audit import AuditTable
from app.storage.database import Database
from app.storage.events import EventTable
from app.storage.folder_lock import lock_folder
from app.storage.schema import FIRST_SITE
from app.storage.site_store import SiteStore
from app.storage.sites import SiteTable
from app.storage.users import UserTable
from navcore.errors import NotKnown, StorageFailed

MAX_RUNS = 1000
"""Largest number of reports that are kept."""


class Store:
    """One data folder, locked by one console; safe to use from any thread."""

    def __init__(self, folder: Path) -> None:
        """Lock and open; raises `StorageFailed` when the folder is in use or cannot be written."""
        try:
            folder.mkdir(parents=True, exist_ok=True)
            # Two consoles would overwrite the zones of each other.
            self._lock_file = lock_folder(folder)
        except BlockingIOError:
            raise StorageFailed(
                f"another console uses the data folder {folder}; end it, or give another --data"
            ) from None
        except OSError as error:
            raise StorageFailed(f"the data folder {folder} cannot be used: {error}") from None
        try:
            self._database = Database(folder, locked=True)
            self.sites = SiteTable(self._database, folder)
            """Sites of the data folder."""
            self.sites.tidy()
            if not self.sites.all():
                self.sites.make(FIRST_SITE)
            newest = max(self.sites.all(), key=lambda row: row.chosen)
            self.site = self.sites.open(newest.name)
            """Site in use."""
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

    @contextmanager
    def using(self, site: SiteStore, world: str) -> Iterator[None]:
        """Use a site from now on, in `world`, with what the block stores there: all or nothing."""
        with self._database.writing():
            self.sites.choose(site, world)
            yield
        self.site = site

    def close(self) -> None:
        """Close the files and unlock the folder."""
        self._database.close()
        self._lock_file.close()

    def runs(self) -> tuple[dict[str, Any], ...]:
        """Return the reports of past missions without their time series, newest first."""
        rows = self._database.rows(
            "SELECT summary FROM runs ORDER BY rowid DESC LIMIT ?", (MAX_RUNS,)
        )
        return tuple(json.loads(summary) for (summary,) in rows)

    def run(self, run_id: str) -> dict[str, Any]:
        """Return one report; raises `NotKnown`."""
        rows = self._database.rows("SELECT summary, series FROM runs WHERE id = ?", (run_id,))
        if not rows:
            raise NotKnown(f"no run has the id {run_id!r}")
        summary, series = rows[0]
        report: dict[str, Any] = json.loads(summary)
        return report if series is None else {**report, "series": json.loads(series)}

    def save_run(self, report: dict[str, Any]) -> None:
        """Store the report of a mission under its `id`; the oldest go."""
        summary = json.dumps({key: value for key, value in report.items() if key != "series"})
        series = json.dumps(report["series"]) if "series" in report else None
        with self._database.writing() as connection:
            connection.execute(
                "INSERT OR REPLACE INTO runs VALUES (?, ?, ?)", (report["id"], summary, series)
            )
            connection.execute(
                "DELETE FROM runs WHERE rowid NOT IN "
                "(SELECT rowid FROM runs ORDER BY rowid DESC LIMIT ?)",
                (MAX_RUNS,),
            )
