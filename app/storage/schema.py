"""The schema of the console's SQLite file, with its version in SQLite's own `user_version`."""

from __future__ import annotations

import json
import sqlite3

from navcore.errors import StorageFailed

VERSION = 5
FIRST_SITE = "default"
"""Name of the first site; what a file of version 1 holds becomes this site."""
PER_SITE = {
    # A zone is one JSON document, so that it can gain a property without a new schema.
    "zones": "position INTEGER PRIMARY KEY AUTOINCREMENT, site TEXT NOT NULL COLLATE NOCASE, "
    "id TEXT NOT NULL, zone TEXT NOT NULL, UNIQUE (site, id)",
    # The newest beware lists that were in force, so that edits can be undone.
    "beware_lists": "position INTEGER PRIMARY KEY AUTOINCREMENT, "
    "site TEXT NOT NULL COLLATE NOCASE, version INTEGER NOT NULL, list TEXT NOT NULL",
    # JSON documents that belong to a site, by kind and name: zone sets, saved missions, the goals
    # of the present mission, the accepted map.
    "documents": "site TEXT NOT NULL COLLATE NOCASE, kind TEXT NOT NULL, name TEXT NOT NULL, "
    "document TEXT NOT NULL, PRIMARY KEY (site, kind, name)",
}
"""Tables of what belongs to a site, and their columns."""
TABLES = (
    # `world` is the world in which the site was made; `chosen` is larger than that of every site
    # that was chosen before, 0 for never; `renamed_from` is the name of the folder of the site
    # until that has the new one; `id` stays under another name, and no other site ever has it.
    "sites (name TEXT PRIMARY KEY COLLATE NOCASE, world TEXT, chosen REAL NOT NULL, "
    "renamed_from TEXT, id TEXT NOT NULL DEFAULT '')",
    *(f"{table} ({columns})" for table, columns in PER_SITE.items()),
    # The time series of a report are most of it; the list of all runs is read without them.
    "runs (id TEXT PRIMARY KEY, summary TEXT NOT NULL, series TEXT)",
    "users (name TEXT PRIMARY KEY, role TEXT NOT NULL, password_hash TEXT NOT NULL, "
    "token_hash TEXT, language TEXT)",
    "audit (id INTEGER PRIMARY KEY AUTOINCREMENT, at TEXT NOT NULL, entry TEXT NOT NULL)",
    # The event log, numbered by its writer; `start` counts the starts of the console.
    "events (id INTEGER PRIMARY KEY, start INTEGER NOT NULL, stamp_s REAL NOT NULL, "
    "unix_s REAL NOT NULL, kind TEXT NOT NULL, text TEXT NOT NULL, x_m REAL, y_m REAL)",
)
INDICES = ("events_by_kind ON events (kind, id)",)
_BEFORE_SITES = {
    "zones": "position, id, zone",
    "beware_lists": "position, version, list",
    "documents": "kind, name, document",
}
"""Columns of those tables in version 1, which had no sites."""


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
        if 1 <= version < VERSION:
            _bring_up(database, version)
        else:
            _require_new(database)
            for table in TABLES:
                database.execute(f"CREATE TABLE {table} STRICT")
            for index in INDICES:
                database.execute(f"CREATE INDEX {index}")
        database.execute(f"PRAGMA user_version = {VERSION}")
        database.execute("COMMIT")
    except BaseException:
        database.execute("ROLLBACK")
        raise


def _bring_up(database: sqlite3.Connection, version: int) -> None:
    """Bring the tables of an earlier version up to date."""
    if version == 1:
        _add_sites(database)
    elif version < 4:
        database.execute("ALTER TABLE sites RENAME COLUMN chosen_unix_s TO chosen")
    if version < 3:
        database.execute("ALTER TABLE users ADD COLUMN language TEXT")
    if version < 4:
        _split_runs(database)
    if version > 1:
        database.execute("ALTER TABLE sites ADD COLUMN id TEXT NOT NULL DEFAULT ''")
    database.execute("UPDATE sites SET id = lower(hex(randomblob(16)))")


def _split_runs(database: sqlite3.Connection) -> None:
    """Store the time series of each report apart from the rest of it."""
    (table,) = (table for table in TABLES if table.startswith("runs "))
    database.execute("ALTER TABLE runs RENAME TO whole_runs")
    database.execute(f"CREATE TABLE {table} STRICT")
    for run_id, text in database.execute("SELECT id, report FROM whole_runs ORDER BY rowid"):
        report = json.loads(text)
        series = report.pop("series", None)
        database.execute(
            "INSERT INTO runs VALUES (?, ?, ?)",
            (run_id, json.dumps(report), None if series is None else json.dumps(series)),
        )
    database.execute("DROP TABLE whole_runs")


def _add_sites(database: sqlite3.Connection) -> None:
    """Make everything that a file of version 1 holds the content of the first site."""
    database.execute(f"CREATE TABLE {TABLES[0]} STRICT")
    database.execute("INSERT INTO sites (name, chosen) VALUES (?, 1)", (FIRST_SITE,))
    for table, columns in _BEFORE_SITES.items():
        database.execute(f"ALTER TABLE {table} RENAME TO before_sites")
        database.execute(f"CREATE TABLE {table} ({PER_SITE[table]}) STRICT")
        database.execute(
            f"INSERT INTO {table} (site, {columns}) SELECT ?, {columns} FROM before_sites",
            (FIRST_SITE,),
        )
        database.execute("DROP TABLE before_sites")


def _version(database: sqlite3.Connection) -> int:
    (version,) = database.execute("PRAGMA user_version").fetchone()
    return int(version)


def _require_new(database: sqlite3.Connection) -> None:
    """Raise `StorageFailed` for a file that has a version or tables."""
    version = _version(database)
    (tables,) = database.execute("SELECT count(*) FROM sqlite_master").fetchone()
    if version or tables:
        (_, _, path), *_ = database.execute("PRAGMA database_list").fetchall()
        raise StorageFailed(
            f"{path} has schema version {version}, this program needs version {VERSION}; "
            "move the file away, or give another data folder"
        )
