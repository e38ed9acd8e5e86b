"""The schema of the console's SQLite file, with its version in SQLite's own `user_version`."""

from __future__ import annotations

import json
import sqlite3
import uuid
from collections.abc import Set
from pathlib import Path

from navcore.errors import StorageFailed

Row = tuple[str, str, str, str | None, float]
"""Row of the table of the sites."""

VERSION = 7
FIRST_SITE = "default"
"""Name of the first site; what a file of version 1 holds becomes this site."""
MAPS = "sites"
"""Name of the folder in the data folder that holds a folder for each site."""
TABLES = {
    # `id` stays under another name, and no other site ever has it; `folder` is the name of its
    # folder, the id except for a site of an earlier version; `world` is the world in which the
    # site was made; `chosen` is larger than that of every site that was chosen before, 0 for never.
    "sites": "id TEXT PRIMARY KEY, name TEXT NOT NULL UNIQUE COLLATE NOCASE, "
    "folder TEXT NOT NULL, world TEXT, chosen REAL NOT NULL",
    # Folders that a start deletes: that of a site whose deletion, or making, may have been
    # interrupted. No other folder is deleted.
    "obsolete_folders": "folder TEXT PRIMARY KEY",
    # What belongs to a site has its id, so that a new name concerns nothing that is being edited,
    # copied or exported. A zone is one JSON document, so that it can gain a property without a new
    # schema.
    "zones": "position INTEGER PRIMARY KEY AUTOINCREMENT, site TEXT NOT NULL, "
    "id TEXT NOT NULL, zone TEXT NOT NULL, UNIQUE (site, id)",
    # The newest beware lists that were in force, so that edits can be undone.
    "beware_lists": "position INTEGER PRIMARY KEY AUTOINCREMENT, site TEXT NOT NULL, "
    "version INTEGER NOT NULL, list TEXT NOT NULL",
    # JSON documents that belong to a site, by kind and name: zone sets, saved missions, the goals
    # of the present mission, the accepted map.
    "documents": "site TEXT NOT NULL, kind TEXT NOT NULL, name TEXT NOT NULL, "
    "document TEXT NOT NULL, PRIMARY KEY (site, kind, name)",
    # The time series of a report are most of it; the list of all runs is read without them.
    "runs": "id TEXT PRIMARY KEY, summary TEXT NOT NULL, series TEXT",
    "users": "name TEXT PRIMARY KEY, role TEXT NOT NULL, password_hash TEXT NOT NULL, "
    "token_hash TEXT, language TEXT",
    "audit": "id INTEGER PRIMARY KEY AUTOINCREMENT, at TEXT NOT NULL, entry TEXT NOT NULL",
    # The event log, numbered by its writer; `start` counts the starts of the console.
    "events": "id INTEGER PRIMARY KEY, start INTEGER NOT NULL, stamp_s REAL NOT NULL, "
    "unix_s REAL NOT NULL, kind TEXT NOT NULL, text TEXT NOT NULL, x_m REAL, y_m REAL",
}
"""Tables and their columns."""
PER_SITE = {
    "zones": ("id", "zone"),
    "beware_lists": ("version", "list"),
    "documents": ("kind", "name", "document"),
}
"""Tables of what belongs to a site, and their columns that a copy of the site has, too; the order
is that of `rowid`."""
INDICES = ("events_by_kind ON events (kind, id)",)


def is_of_an_earlier_version(database: sqlite3.Connection) -> bool:
    """Whether `create_schema` would convert the tables of a file."""
    return 1 <= _version(database) < VERSION


def create_schema(database: sqlite3.Connection) -> None:
    """Create the tables of a new file, or bring those of an earlier version up to
    date, all or nothing.

    Raises `StorageFailed` for a file of another version, or of another program, and leaves it as
    it is.
    """
    if _version(database) == VERSION:
        return
    database.execute("BEGIN IMMEDIATE")
    try:
        version = _version(database)
        if version == VERSION:  # another process was faster
            database.execute("COMMIT")
            return
        if is_of_an_earlier_version(database):
            _bring_up(database, version)
        else:
            _require_new(database)
            for table in TABLES:
                _create(database, table)
            for index in INDICES:
                database.execute(f"CREATE INDEX {index}")
        database.execute(f"PRAGMA user_version = {VERSION}")
        database.execute("COMMIT")
    except BaseException:
        database.execute("ROLLBACK")
        raise


def _create(database: sqlite3.Connection, table: str) -> None:
    database.execute(f"CREATE TABLE {table} ({TABLES[table]}) STRICT")


def _bring_up(database: sqlite3.Connection, version: int) -> None:
    """Bring the tables of an earlier version up to date."""
    _create(database, "obsolete_folders")
    if version < 3:
        database.execute("ALTER TABLE users ADD COLUMN language TEXT")
    if version < 4:
        _split_runs(database)
    if version < 6:
        _store_by_id(database, version)


def _store_by_id(database: sqlite3.Connection, version: int) -> None:
    """Store what belongs to a site by its id; it was stored by its name, or was that of no site."""
    sites = _first_site() if version == 1 else _sites_before(database, version)
    _create(database, "sites")
    database.executemany("INSERT INTO sites VALUES (?, ?, ?, ?, ?)", sites)
    for table, columns in PER_SITE.items():
        database.execute(f"ALTER TABLE {table} RENAME TO former")
        _create(database, table)
        ours = "" if version == 1 else " ON sites.name = former.site"
        database.execute(
            f"INSERT INTO {table} (site, {', '.join(columns)}) "
            f"SELECT sites.id, {', '.join(f'former.{column}' for column in columns)} "
            f"FROM former JOIN sites{ours} ORDER BY former.rowid"
        )
        database.execute("DROP TABLE former")


def _split_runs(database: sqlite3.Connection) -> None:
    """Store the time series of each report apart from the rest of it."""
    database.execute("ALTER TABLE runs RENAME TO whole_runs")
    _create(database, "runs")
    for run_id, text in database.execute("SELECT id, report FROM whole_runs ORDER BY rowid"):
        report = json.loads(text)
        series = report.pop("series", None)
        database.execute(
            "INSERT INTO runs VALUES (?, ?, ?)",
            (run_id, json.dumps(report), None if series is None else json.dumps(series)),
        )
    database.execute("DROP TABLE whole_runs")


def _first_site() -> list[Row]:
    """Return the row of the site that a file of version 1, which had no sites, becomes."""
    site_id = uuid.uuid4().hex
    return [(site_id, FIRST_SITE, site_id, None, 1.0)]


def _sites_before(database: sqlite3.Connection, version: int) -> list[Row]:
    """Return the rows of the sites of an earlier version, whose table is dropped. Each keeps its
    folder, which had the name of the site."""
    chosen = "chosen" if version > 3 else "chosen_unix_s"
    site_id = "id" if version > 4 else "lower(hex(randomblob(16)))"
    rows = database.execute(
        f"SELECT {site_id}, name, renamed_from, world, {chosen} FROM sites"
    ).fetchall()
    database.execute("DROP TABLE sites")
    maps = _path(database).parent / MAPS
    names = {name.lower() for _, name, *_ in rows}
    return [
        (site_id, name, _folder_before(maps, name, renamed_from, names), world, chosen)
        for site_id, name, renamed_from, world, chosen in rows
    ]


def _folder_before(maps: Path, name: str, renamed_from: str | None, names: Set[str]) -> str:
    """Return the name of the folder of a site, whose folder was to get a new name with it: that may
    have failed. Of two folders the newer one."""
    if renamed_from is None or renamed_from.lower() in names - {name.lower()}:
        return name
    return max((name, renamed_from), key=lambda folder: _changed_s(maps / folder))


def _changed_s(folder: Path) -> float:
    """Return the time at which a map was last kept in a folder; 0 without one."""
    try:
        return folder.stat().st_mtime
    except OSError:
        return 0.0


def _path(database: sqlite3.Connection) -> Path:
    (_, _, path), *_ = database.execute("PRAGMA database_list").fetchall()
    return Path(path)


def _version(database: sqlite3.Connection) -> int:
    (version,) = database.execute("PRAGMA user_version").fetchone()
    return int(version)


def _require_new(database: sqlite3.Connection) -> None:
    """Raise `StorageFailed` for a file that has a version or tables."""
    version = _version(database)
    (tables,) = database.execute("SELECT count(*) FROM sqlite_master").fetchone()
    if version or tables:
        raise StorageFailed(
            f"{_path(database)} has schema version {version}, this program needs version "
            f"{VERSION}; move the file away, or give another data folder"
        )
