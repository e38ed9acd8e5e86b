"""What the store holds of one site: zones, beware lists, documents, and the folder of its map."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from app.storage.database import Database
from app.storage.records import zone_of, zone_record
from navcore.errors import NotKnown
from navcore.files import read_whole
from navcore.mapping.storage.map_file import MAX_BYTES
from navcore.mission.beware_list import BewareClass, BewareList, as_table
from navcore.mission.zone import Zone
from navcore.toml_config import from_table
from web.interface.beware import BewareVersion, BewareVersionSummary

MAX_LISTS = 1000
"""Largest number of beware lists that are kept of a site."""
MAP_FILE = "map.npz"
"""Name of the map file in the folder of a site."""


class SiteStore:
    """One site of a data folder; safe to use from any thread.

    It keeps its site when another one is chosen, so that an edit that began before is stored where
    it belongs.
    """

    def __init__(self, database: Database, *, site_id: str, name: str, folder: Path) -> None:
        self._database = database
        self.id = site_id
        """What its rows and requests call the site, whatever its name."""
        self.name = name
        """Name of the site when it was opened."""
        self.folder = folder
        """Folder of the map; it may not exist before the first map is kept."""

    @property
    def map_file(self) -> Path:
        """Path of the map that is kept while driving."""
        return self.folder / MAP_FILE

    def map_data(self, *, at_most: int = MAX_BYTES) -> bytes | None:
        """Return the map file; None before the first map is kept."""
        return read_whole(self.map_file, at_most=at_most) if self.map_file.exists() else None

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Read within the block what the site holds at one moment; raises `NotKnown` where it has
        been deleted."""
        with self._database.reading():
            if not self._database.rows("SELECT 1 FROM sites WHERE id = ?", (self.id,)):
                raise NotKnown(f"no site is called {self.name!r:.90}")
            yield

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Store what the block stores as one: all or nothing; raises `StorageFailed`."""
        with self._database.writing():
            yield

    def zones(self) -> tuple[Zone, ...]:
        """Return all zones, in the order in which they were first stored."""
        rows = self._database.rows(
            "SELECT zone FROM zones WHERE site = ? ORDER BY position", (self.id,)
        )
        return tuple(zone_of(json.loads(zone)) for (zone,) in rows)

    def save_zone(self, zone: Zone) -> None:
        """Store a zone, replacing the one with its id."""
        self.change_zones([zone], [])

    def change_zones(self, saved: Iterable[Zone], deleted: Iterable[str]) -> None:
        """Delete some zones and store others by their id: all or nothing."""
        with self._database.writing() as connection:
            connection.executemany(
                "DELETE FROM zones WHERE site = ? AND id = ?",
                [(self.id, zone_id) for zone_id in deleted],
            )
            connection.executemany(
                "INSERT INTO zones (site, id, zone) VALUES (?, ?, ?) "
                "ON CONFLICT (site, id) DO UPDATE SET zone = excluded.zone",
                [(self.id, zone.id, json.dumps(zone_record(zone))) for zone in saved],
            )

    def documents(self, kind: str) -> dict[str, Any]:
        """Return the JSON documents of a kind by name, sorted by name."""
        rows = self._database.rows(
            "SELECT name, document FROM documents WHERE site = ? AND kind = ? ORDER BY name",
            (self.id, kind),
        )
        return {name: json.loads(document) for name, document in rows}

    def save_document(self, kind: str, name: str, value: Any) -> None:
        """Store a JSON document under a name; None deletes it."""
        if value is None:
            self._database.write(
                "DELETE FROM documents WHERE site = ? AND kind = ? AND name = ?",
                (self.id, kind, name),
            )
        else:
            self._database.write(
                "INSERT OR REPLACE INTO documents (site, kind, name, document) VALUES (?, ?, ?, ?)",
                (self.id, kind, name, json.dumps(value)),
            )

    def beware(self) -> BewareList | None:
        """Return the list saved last; None on a new site."""
        versions = self.beware_versions(limit=1)
        return versions[0].list if versions else None

    def beware_versions(self, *, limit: int = MAX_LISTS) -> tuple[BewareVersion, ...]:
        """Return the lists saved last, newest first."""
        rows = self._database.rows(
            "SELECT list FROM beware_lists WHERE site = ? ORDER BY position DESC LIMIT ?",
            (self.id, limit),
        )
        return tuple(_beware_version(json.loads(row[0])) for row in rows)

    def beware_summaries(self) -> tuple[BewareVersionSummary, ...]:
        """Return the kept lists by what is said of them, newest first; no list is parsed here."""
        rows = self._database.rows(
            "SELECT version, json_extract(list, '$.unix_s'), json_extract(list, '$.by'), "
            "json_extract(list, '$.what'), json_array_length(list, '$.classes') "
            "FROM beware_lists WHERE site = ? ORDER BY position DESC LIMIT ?",
            (self.id, MAX_LISTS),
        )
        return tuple(
            BewareVersionSummary(
                version=version, unix_s=unix_s, by=by or "", what=what or "", classes=classes
            )
            for version, unix_s, by, what, classes in rows
        )

    def beware_version(self, version: int) -> BewareVersion | None:
        """Return the newest list of a version; None where it is not kept."""
        rows = self._database.rows(
            "SELECT list FROM beware_lists WHERE site = ? AND version = ? "
            "ORDER BY position DESC LIMIT 1",
            (self.id, version),
        )
        return _beware_version(json.loads(rows[0][0])) if rows else None

    def save_beware(
        self,
        beware: BewareList,
        *,
        unix_s: float | None = None,
        by: str = "",
        what: str = "",
    ) -> None:
        """Store the list in force, with the time of the edit in seconds since 1970, who made it
        and its description; the oldest go."""
        document = {
            "version": beware.version,
            "classes": [as_table(entry) for entry in beware.classes],
            "retired": beware.retired,
            "unix_s": unix_s,
            "by": by,
            "what": what,
        }
        text = json.dumps(document)
        with self._database.writing() as connection:
            connection.execute(
                "INSERT INTO beware_lists (site, version, list) VALUES (?, ?, ?)",
                (self.id, beware.version, text),
            )
            connection.execute(
                "DELETE FROM beware_lists WHERE site = ? AND position <= (SELECT position FROM "
                "beware_lists WHERE site = ? ORDER BY position DESC LIMIT 1 OFFSET ?)",
                (self.id, self.id, MAX_LISTS),
            )


def _beware_version(saved: Mapping[str, Any]) -> BewareVersion:
    classes = tuple(
        from_table(BewareClass, table, f"stored beware list[{i}]")
        for i, table in enumerate(saved["classes"])
    )
    retired = tuple((name, class_id) for name, class_id in saved["retired"])
    return BewareVersion(
        list=BewareList(classes=classes, version=saved["version"], retired=retired),
        unix_s=saved.get("unix_s"),
        by=saved.get("by", ""),
        what=saved.get("what", ""),
    )
