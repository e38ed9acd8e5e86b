"""Who may log in. Passwords and tokens come here as hashes only."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from app.storage.database import Database
from navcore.errors import NotKnown, Refused
from web.access.roles import Role
from web.access.users import User


class UserTable:
    """Satisfies `web.access.users.Users`."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def all(self) -> tuple[User, ...]:
        """By name."""
        rows = self._database.rows("SELECT name, role, password_hash, token_hash FROM users ORDER BY name")
        return tuple(User(name=row[0], role=Role(row[1]), password_hash=row[2], token_hash=row[3]) for row in rows)

    def add(self, user: User) -> None:
        """Raises `Refused` when the name is taken."""
        with self._database.writing() as connection:
            if connection.execute("SELECT 1 FROM users WHERE name = ?", (user.name,)).fetchone():
                raise Refused(f"there is a user {user.name!r} already")
            values = (user.name, str(user.role), user.password_hash, user.token_hash)
            connection.execute("INSERT INTO users (name, role, password_hash, token_hash) VALUES (?, ?, ?, ?)", values)

    def replace(self, user: User) -> None:
        """Role, password and token of an existing one; raises `NotKnown`, and `Refused` for the last admin's loss of it."""
        with self._database.writing() as connection:
            values = (str(user.role), user.password_hash, user.token_hash, user.name)
            query = "UPDATE users SET role = ?, password_hash = ?, token_hash = ? WHERE name = ?"
            if connection.execute(query, values).rowcount == 0:
                raise NotKnown(f"no user is called {user.name!r}")
            _need_an_admin(connection)

    def remove(self, name: str) -> None:
        """Raises `NotKnown`, and `Refused` for the last admin."""
        with self._database.writing() as connection:
            if connection.execute("DELETE FROM users WHERE name = ?", (name,)).rowcount == 0:
                raise NotKnown(f"no user is called {name!r}")
            _need_an_admin(connection)


def _need_an_admin(connection: sqlite3.Connection) -> None:
    if not connection.execute("SELECT 1 FROM users WHERE role = ?", (str(Role.ADMIN),)).fetchone():
        raise Refused("this is the last admin; make another one first")


@contextmanager
def user_table(folder: Path) -> Iterator[UserTable]:
    """The users of a data folder, beside a console that may be running on it."""
    with closing(Database(folder)) as database:
        yield UserTable(database)
