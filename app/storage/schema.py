"""The schema of the console's SQLite file, with its version in SQLite's own `user_version`."""

from __future__ import annotations

import sqlite3

from navcore.errors import StorageFailed

VERSION = 1
TABLES = (
    # A zone is one JSON document, so that it can gain a property without a new schema.
    "zones (position INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE, "
    "zone TEXT NOT NULL)",
    # Every beware list that was ever in force, so that edits can be undone.
    "beware_lists (position INTEGER PRIMARY KEY AUTOINCREMENT, version INTEGER NOT NULL, "
    "list TEXT NOT NULL)",
    "runs (id TEXT PRIMARY KEY, report TEXT NOT NULL)",
    # JSON documents that operators keep under a name: zone sets, saved missions.
    "documents (kind TEXT NOT NULL, name TEXT NOT NULL, document TEXT NOT NULL, "
    "PRIMARY KEY (kind, name))",
    "users (name TEXT PRIMARY KEY, role TEXT NOT NULL, password_hash TEXT NOT NULL, "
    "token_hash TEXT)",
    "audit (id INTEGER PRIMARY KEY AUTOINCREMENT, at TEXT NOT NULL, entry TEXT NOT NULL)",
    # The event log, numbered by its writer; `start` counts the starts of the console.
    "events (id INTEGER PRIMARY KEY, start INTEGER NOT NULL, stamp_s REAL NOT NULL, "
    "unix_s REAL NOT NULL, kind TEXT NOT NULL, text TEXT NOT NULL, x_m REAL, y_m REAL)",
)
INDICES = ("events_by_kind ON events (kind, id)",)


def create_schema(database: sqlite3.Connection) -> None:
    """Create the tables of a new file.

    Raises `StorageFailed` for a file of another version, or of another program, and leaves it as
    it is.
    """
    if _version(database) == VERSION:
        return
    database.execute("BEGIN IMMEDIATE")
    try:
        if _version(database) == VERSION:  # another process was faster
            database.execute("COMMIT")
            return
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
