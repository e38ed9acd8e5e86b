"""Documents that an operator keeps under a name: sets of zones, missions. Every change says which version it was made from."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from app.storage.database import Database
from navcore.errors import NotKnown, Outdated


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """One of them."""

    name: str
    """Unique among those of its kind."""
    version: int
    """1 when it is new, one more with every change."""
    content: dict[str, Any]
    """What is kept; JSON."""


class Named:
    """All documents of one kind."""

    def __init__(self, database: Database, kind: str) -> None:
        self._database, self._kind = database, kind

    def all(self) -> tuple[Document, ...]:
        """By name."""
        query = "SELECT name, version, document FROM named WHERE kind = ? ORDER BY name"
        return tuple(_document(row) for row in self._database.rows(query, (self._kind,)))

    def get(self, name: str) -> Document:
        """One of them; raises `NotKnown`."""
        rows = self._database.rows("SELECT name, version, document FROM named WHERE kind = ? AND name = ?", (self._kind, name))
        if not rows:
            raise NotKnown(f"no {self._kind} is called {name!r}")
        return _document(rows[0])

    def save(self, name: str, content: dict[str, Any], *, expected_version: int | None = None) -> Document:
        """Store or overwrite; raises `Outdated` when the stored version is not the expected one (0: it must be new)."""
        with self._database.writing() as connection:
            version = self._expect(connection, name, expected_version) + 1
            values = (self._kind, name, version, json.dumps(content))
            connection.execute("INSERT OR REPLACE INTO named (kind, name, version, document) VALUES (?, ?, ?, ?)", values)
        return Document(name=name, version=version, content=content)

    def delete(self, name: str, *, expected_version: int | None = None) -> None:
        """Forget; raises `NotKnown`, or `Outdated`."""
        with self._database.writing() as connection:
            if self._expect(connection, name, expected_version) == 0:
                raise NotKnown(f"no {self._kind} is called {name!r}")
            connection.execute("DELETE FROM named WHERE kind = ? AND name = ?", (self._kind, name))

    def _expect(self, connection: Any, name: str, expected: int | None) -> int:
        row = connection.execute("SELECT version FROM named WHERE kind = ? AND name = ?", (self._kind, name)).fetchone()
        version = int(row[0]) if row else 0
        if expected is not None and expected != version:
            raise Outdated(f"the {self._kind} {name!r} is at version {version}, the edit was made on {expected}")
        return version


def _document(row: tuple[Any, ...]) -> Document:
    return Document(name=row[0], version=row[1], content=json.loads(row[2]))
