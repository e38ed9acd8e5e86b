"""The SQLite file: opening, reading and durable writing."""

from __future__ import annotations

import sqlite3
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from app.storage.folder_lock import lock_folder
from app.storage.schema import create_schema, is_of_an_earlier_version
from navcore.errors import StorageFailed

BUSY_S = 0.5
"""Time for which a write waits for the lock of another process before it is refused, seconds."""
FILE = "console.sqlite"


class Database:
    """One connection, safe to use from any thread. An acknowledged write is on the disk."""

    def __init__(self, folder: Path, *, locked: bool = False) -> None:
        """Open or create the file in `folder`; raises `StorageFailed` when it cannot be used.

        One of an earlier version is converted while the folder is locked, by the caller if `locked`
        is set: a console of that version would go on and acknowledge edits that are lost.
        """
        self._lock = threading.RLock()
        self.path = folder / FILE
        connection = None
        try:
            folder.mkdir(parents=True, exist_ok=True)
            connection = sqlite3.connect(
                self.path, timeout=BUSY_S, check_same_thread=False, isolation_level=None
            )
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA synchronous = FULL")
            if locked or not is_of_an_earlier_version(connection):
                create_schema(connection)
            else:
                _convert(connection, folder)
        except (OSError, sqlite3.Error, StorageFailed) as error:
            if connection is not None:
                connection.close()
            raise StorageFailed(f"the data folder {folder} cannot be used: {error}") from None
        self._connection = connection

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._connection.close()

    def rows(self, query: str, values: tuple[object, ...] = ()) -> list[tuple[Any, ...]]:
        """Return all rows of a query."""
        with self._lock:
            try:
                return self._connection.execute(query, values).fetchall()
            except sqlite3.Error as error:
                raise StorageFailed(f"the store {self.path} cannot be read: {error}") from None

    def write(self, statement: str, values: tuple[object, ...] = ()) -> None:
        """Execute one statement, which is on the disk on return; raises `StorageFailed`, and then
        nothing has changed."""
        with self.writing() as connection:
            connection.execute(statement, values)

    @contextmanager
    def writing(self) -> Iterator[sqlite3.Connection]:
        """One transaction: all its statements are on the disk at the end, or none if any fails.
        What is written within the block, by the same thread, belongs to it."""
        with self._lock:
            try:
                with self._transaction("BEGIN IMMEDIATE"):
                    yield self._connection
            except sqlite3.Error as error:
                raise StorageFailed(
                    f"not saved, what was stored before is intact: {error}"
                ) from None

    @contextmanager
    def reading(self) -> Iterator[None]:
        """One transaction: all that is read within the block, by the same thread, is of one
        moment, also where another process writes meanwhile."""
        with self._lock:
            try:
                with self._transaction("BEGIN"):
                    yield
            except sqlite3.Error as error:
                raise StorageFailed(f"the store {self.path} cannot be read: {error}") from None

    @contextmanager
    def _transaction(self, begin: str) -> Iterator[None]:
        """One transaction, or a part of the one around it."""
        if self._connection.in_transaction:
            yield
            return
        self._connection.execute(begin)
        try:
            yield
            self._connection.execute("COMMIT")
        except BaseException:
            if self._connection.in_transaction:
                self._connection.execute("ROLLBACK")
            raise


def _convert(connection: sqlite3.Connection, folder: Path) -> None:
    """Bring the file up to date while no console uses its folder."""
    try:
        lock_file = lock_folder(folder)
    except BlockingIOError:
        if not is_of_an_earlier_version(connection):
            return  # a console has converted it meanwhile
        raise StorageFailed("a console of an earlier version uses it; end that one first") from None
    with lock_file:
        create_schema(connection)
