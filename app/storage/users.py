"""User accounts. Passwords and tokens are stored as hashes only."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from app.storage.database import Database
from navcore.errors import NotKnown, Refused
from web.auth.roles import Role
from web.auth.users import User


class UserTable:
    """Satisfies `web.auth.users.Users`."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def all(self) -> tuple[User, ...]:
        """Return all users, sorted by name."""
        rows = self._database.rows(
            "SELECT name, role, password_hash, token_hash, language FROM users ORDER BY name"
        )
        return tuple(
            User(
                name=name,
                role=Role(role),
                password_hash=password_hash,
                token_hash=token_hash,
                language=language,
            )
            for name, role, password_hash, token_hash, language in rows
        )

    def add(self, user: User) -> None:
        """Add a user; raises `Refused` when the name is taken."""
        with self._database.writing() as connection:
            if connection.execute("SELECT 1 FROM users WHERE name = ?", (user.name,)).fetchone():
                raise Refused(f"there is a user {user.name!r} already")
            connection.execute(
                "INSERT INTO users (name, role, password_hash, token_hash, language) "
                "VALUES (?, ?, ?, ?, ?)",
                (user.name, str(user.role), user.password_hash, user.token_hash, user.language),
            )

    def change(
        self,
        name: str,
        *,
        role: Role | None = None,
        password_hash: str | None = None,
        token_hash: str | None = None,
        language: str | None = None,
        instead_of: str | None = None,
    ) -> User:
        """Change role, password, token or language of a user.

        A field that is None keeps its stored value, so that concurrent changes of one user do not
        undo each other. With `instead_of` the change is made only while the stored password hash is
        this one. Raises `NotKnown`, and `Refused` when the last admin would lose the role.
        """
        query = (
            "UPDATE users SET role = coalesce(?, role), password_hash = coalesce(?, password_hash),"
            " token_hash = coalesce(?, token_hash), language = coalesce(?, language)"
            " WHERE name = ? AND password_hash = coalesce(?, password_hash)"
        )
        with self._keeping_an_admin() as connection:
            values = (
                None if role is None else str(role),
                password_hash,
                token_hash,
                language,
                name,
                instead_of,
            )
            changed = connection.execute(query, values)
            row = connection.execute(
                "SELECT role, password_hash, token_hash, language FROM users WHERE name = ?",
                (name,),
            ).fetchone()
            if row is None:
                raise NotKnown(f"no user is called {name!r}")
            if changed.rowcount == 0:
                raise Refused("the password has been changed meanwhile")
        return User(
            name=name,
            role=Role(row[0]),
            password_hash=row[1],
            token_hash=row[2],
            language=row[3],
        )

    def remove(self, name: str) -> None:
        """Remove a user; raises `NotKnown`, and `Refused` for the last admin."""
        with self._keeping_an_admin() as connection:
            if connection.execute("DELETE FROM users WHERE name = ?", (name,)).rowcount == 0:
                raise NotKnown(f"no user is called {name!r}")

    @contextmanager
    def _keeping_an_admin(self) -> Iterator[sqlite3.Connection]:
        """One transaction, refused where it would take the role from the last admin."""
        with self._database.writing() as connection:
            had_admin = _has_admin(connection)
            yield connection
            if had_admin and not _has_admin(connection):
                raise Refused("this is the last admin; make another one first")


def _has_admin(connection: sqlite3.Connection) -> bool:
    query = "SELECT 1 FROM users WHERE role = ?"
    return connection.execute(query, (str(Role.ADMIN),)).fetchone() is not None


@contextmanager
def user_table(folder: Path) -> Iterator[UserTable]:
    """Open the users of a data folder, also while a console runs on it."""
    with closing(Database(folder)) as database:
        yield UserTable(database)
