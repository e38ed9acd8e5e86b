"""The layout of the file, step by step: each leads from one version to the next in one transaction,
and none is ever edited.

The version is SQLite's own `user_version`. The first layout did not yet set it, so a file of it
says 0, like a new one.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable

from navcore.errors import StorageFailed


def _first_layout(database: sqlite3.Connection) -> None:
    """Zones column by column, one beware list, reports of missions."""
    database.execute(
        "CREATE TABLE IF NOT EXISTS zones (id TEXT PRIMARY KEY, name TEXT NOT NULL, polygon TEXT NOT NULL, "
        "enabled INTEGER NOT NULL, margin_m REAL NOT NULL, version INTEGER NOT NULL) STRICT"
    )
    database.execute(
        "CREATE TABLE IF NOT EXISTS beware (only INTEGER PRIMARY KEY CHECK (only = 1), list TEXT NOT NULL) STRICT"
    )
    database.execute(
        "CREATE TABLE IF NOT EXISTS runs (id TEXT PRIMARY KEY, report TEXT NOT NULL) STRICT"
    )


def _documents(database: sqlite3.Connection) -> None:
    """A zone is one JSON document, so that it can gain a property without a new layout; every
    beware list is kept."""
    old = database.execute(
        "SELECT id, name, polygon, enabled, margin_m, version FROM zones ORDER BY rowid"
    ).fetchall()
    database.execute("DROP TABLE zones")
    database.execute(
        "CREATE TABLE zones (place INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE, zone TEXT NOT NULL) STRICT"
    )
    for zone_id, name, polygon, enabled, margin_m, version in old:
        zone = {"id": zone_id, "name": name, "polygon": json.loads(polygon)}
        zone |= {"enabled": bool(enabled), "margin_m": margin_m, "version": version}
        database.execute("INSERT INTO zones (id, zone) VALUES (?, ?)", (zone_id, json.dumps(zone)))
    lists = database.execute("SELECT list FROM beware").fetchall()
    database.execute("DROP TABLE beware")
    database.execute(
        "CREATE TABLE beware_lists (place INTEGER PRIMARY KEY AUTOINCREMENT, version INTEGER NOT NULL, "
        "list TEXT NOT NULL) STRICT"
    )
    for (saved,) in lists:
        version = json.loads(saved)["version"]
        database.execute("INSERT INTO beware_lists (version, list) VALUES (?, ?)", (version, saved))


def _named_things(database: sqlite3.Connection) -> None:
    """Zone sets, saved missions and whatever else an operator keeps under a name."""
    database.execute(
        "CREATE TABLE named (kind TEXT NOT NULL, name TEXT NOT NULL, document TEXT NOT NULL, PRIMARY KEY (kind, name)) STRICT"
    )


def _people(database: sqlite3.Connection) -> None:
    """Who may log in, and who did what."""
    database.execute(
        "CREATE TABLE users (name TEXT PRIMARY KEY, role TEXT NOT NULL, password_hash TEXT NOT NULL, token_hash TEXT) STRICT"
    )
    database.execute(
        "CREATE TABLE journal (id INTEGER PRIMARY KEY AUTOINCREMENT, kind TEXT NOT NULL, at TEXT NOT NULL, "
        "entry TEXT NOT NULL) STRICT"
    )
    database.execute("CREATE INDEX journal_by_kind ON journal (kind, id)")


def _decisions(database: sqlite3.Connection) -> None:
    """The log of decisions, numbered by who writes it; `start` counts the console's starts."""
    database.execute(
        "CREATE TABLE decisions (id INTEGER PRIMARY KEY, start INTEGER NOT NULL, stamp_s REAL NOT NULL, unix_s REAL NOT NULL, "
        "kind TEXT NOT NULL, text TEXT NOT NULL, x_m REAL, y_m REAL) STRICT"
    )
    database.execute("CREATE INDEX decisions_by_kind ON decisions (kind, id)")


STEPS: tuple[Callable[[sqlite3.Connection], None], ...] = (
    _first_layout,
    _documents,
    _named_things,
    _people,
    _decisions,
)


def migrate(database: sqlite3.Connection) -> None:
    """Bring the file to the present layout; raises `StorageFailed` for one of a later version, and
    leaves it as it is."""
    (version,) = database.execute("PRAGMA user_version").fetchone()
    if version > len(STEPS):
        raise StorageFailed(
            f"it was written by a later version (layout {version}, this one knows {len(STEPS)}); update this one"
        )
    for number, step in enumerate(STEPS[version:], start=version + 1):
        database.execute("BEGIN IMMEDIATE")
        try:
            step(database)
            database.execute(f"PRAGMA user_version = {number}")
            database.execute("COMMIT")
        except BaseException:
            database.execute("ROLLBACK")
            raise
