"""The schema of the console's SQLite file, with its version in SQLite's own `user_version`."""

from __future__ import annotations

import sqlite3

from navcore.errors import StorageFailed

VERSION = 3
FIRST_SITE = "default"
"""Name of the first site; what a file of version 1 holds becomes this site."""
PER_SITE = {
    # A zone is one JSON document, so that it can gain a property without a new schema.
    "zones": "position INTEGER PRIMARY KEY AUTOINCREMENT, site TEXT NOT NULL COLLATE NOCASE, "
    "id TEXT NOT NULL, zone TEXT NOT NULL, UNIQUE (site, id)",
    # Every beware list that was ever in force, so that edits can be undone.
    "beware_lists": "position INTEGER PRIMARY KEY AUTOINCREMENT, "
    "site TEXT NOT NULL COLLATE NOCASE, version INTEGER NOT NULL, list TEXT NOT NULL",
    # JSON documents that belong to a site, by kind and name: zone sets, saved missions, the goals
    # of the present mission, the accepted map.
    "documents": "site TEXT NOT NULL COLLATE NOCASE, kind TEXT NOT NULL, name TEXT NOT NULL, "
    "document TEXT NOT NULL, PRIMARY KEY (site, kind, name)",
}
"""Tables of what belongs to a site, and their columns."""
TABLES = (
    # `world` is the world in which the site was made; `renamed_from` is set until the folder of the
    # site has its new name.
    "sites (name TEXT PRIMARY KEY COLLATE NOCASE, world TEXT, chosen_unix_s REAL NOT NULL, "
    "renamed_from TEXT)",
    *(f"{table} ({columns})" for table, columns in PER_SITE.items()),
    "runs (id TEXT PRIMARY KEY, report TEXT NOT NULL)",
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
        if version in (1, 2):
            if version == 1:
                _add_sites(database)
            database.execute("ALTER TABLE users ADD COLUMN language TEXT")
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


def _add_sites(database: sqlite3.Connection) -> None:
    """Make everything that a file of version 1 holds the content of the first site."""
    database.execute(f"CREATE TABLE {TABLES[0]} STRICT")
    database.execute("INSERT INTO sites VALUES (?, NULL, 1, NULL)", (FIRST_SITE,))
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
