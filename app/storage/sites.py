"""The sites of a data folder: made, chosen, renamed, copied, deleted.

Rows are in the SQLite file, the map of a site is in the folder `sites/NAME`. Names are restricted
to what is a plain file name everywhere, and differ in more than case.
"""

from __future__ import annotations

import re
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.storage.database import Database
from app.storage.schema import PER_SITE
from app.storage.site_store import MAP_FILE, SiteStore
from navcore.errors import BadConfiguration, NotKnown, Refused, StorageFailed
from navcore.files import read_whole, write_whole
from navcore.mapping.storage.map_file import MAX_BYTES
from web.interface.sites import SITE_NAME

MAX_SITES = 100
"""Largest number of sites in a data folder."""


Execute = Callable[..., Any]
"""Function that executes a statement within a transaction."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SiteRow:
    """One site in the list."""

    name: str
    """Name of the site."""
    world: str | None
    """World in which it was first used; None before."""
    chosen_unix_s: float
    """Time at which it was last chosen, seconds since 1970; 0 for never."""


def checked_name(name: str) -> str:
    """Return the name of a site; raises `BadConfiguration` for one that is not allowed."""
    if re.fullmatch(SITE_NAME[1:-1], name, re.ASCII) is None:
        raise BadConfiguration(
            f"site name {name!r:.90}: expected 1 to 40 letters, digits, blanks, - and _, "
            "beginning with a letter or digit"
        )
    return name


class SiteTable:
    """All sites of a data folder; safe to use from any thread."""

    def __init__(self, database: Database, folder: Path) -> None:
        """`folder`: the data folder. Finishes a renaming that was interrupted."""
        self._database, self._root = database, folder / "sites"
        query = "SELECT name, renamed_from FROM sites WHERE renamed_from IS NOT NULL"
        for name, before in database.rows(query):
            self._move_folder(before, name)

    def all(self) -> tuple[SiteRow, ...]:
        """Return all sites by name."""
        rows = self._database.rows("SELECT name, world, chosen_unix_s FROM sites ORDER BY name")
        return tuple(SiteRow(name=row[0], world=row[1], chosen_unix_s=row[2]) for row in rows)

    def open(self, name: str) -> SiteStore:
        """Return the contents of a site; raises `NotKnown`."""
        for row in self.all():
            if row.name.lower() == name.lower():
                return SiteStore(self._database, row.name, self._root / row.name)
        raise NotKnown(f"no site is called {name!r:.90}")

    def last_of(self, world: str) -> str:
        """Return the site that was last chosen in a world, or a free name for its first one."""
        fitting = [row for row in self.all() if row.world in (None, world)]
        if fitting:
            return max(fitting, key=lambda row: row.chosen_unix_s).name
        made = re.sub(r"[^A-Za-z0-9_-]+", "-", world).strip("-_")[:36] or "site"
        known = {row.name.lower() for row in self.all()}
        names = (made, *(f"{made}-{number}" for number in range(2, MAX_SITES + 2)))
        return next(name for name in names if name.lower() not in known)

    def choose(self, name: str, world: str | None) -> SiteStore:
        """Note that a site is in use now, in `world`; raises `NotKnown`."""
        site = self.open(name)
        self._database.write(
            "UPDATE sites SET chosen_unix_s = ?, world = coalesce(world, ?) WHERE name = ?",
            (time.time(), world, site.name),
        )
        return site

    def make(self, name: str) -> SiteStore:
        """Make an empty site; raises `Refused` for a name that is taken or too many sites."""
        checked_name(name)
        with self._database.writing() as connection:
            self._insert(connection.execute, name)
        self._delete_folder(name)  # of a site whose deletion was interrupted
        return self.open(name)

    def copy(self, name: str, new_name: str) -> SiteStore:
        """Copy a site with everything in it."""
        source = self.open(name)
        checked_name(new_name)
        taken = read_whole(source.map_file, at_most=MAX_BYTES) if source.map_file.exists() else None
        with self._database.writing() as connection:
            self._insert(connection.execute, new_name)
            for table in PER_SITE:
                columns = ", ".join(
                    column
                    for _, column, *_ in connection.execute(f"PRAGMA table_info({table})")
                    if column not in ("position", "site")
                )
                order = "" if table == "documents" else " ORDER BY position"
                connection.execute(
                    f"INSERT INTO {table} (site, {columns}) "
                    f"SELECT ?, {columns} FROM {table} WHERE site = ?{order}",
                    (new_name, source.name),
                )
            self._delete_folder(new_name)
            if taken is not None:
                self.write_map(new_name, taken)
        return self.open(new_name)

    def rename(self, name: str, new_name: str) -> SiteStore:
        """Rename a site and its folder; raises `Refused` for a name that is taken."""
        before = self.open(name).name
        checked_name(new_name)
        if new_name == before:
            return self.open(name)
        with self._database.writing() as connection:
            if new_name.lower() != before.lower():
                self._require_free(connection.execute, new_name)
                self._delete_folder(new_name)  # of a site whose deletion was interrupted
            connection.execute(
                "UPDATE sites SET name = ?, renamed_from = ? WHERE name = ?",
                (new_name, before, before),
            )
            for table in PER_SITE:
                connection.execute(
                    f"UPDATE {table} SET site = ? WHERE site = ?", (new_name, before)
                )
        self._move_folder(before, new_name)
        return self.open(new_name)

    def delete(self, name: str) -> None:
        """Delete a site with everything in it; raises `NotKnown`."""
        name = self.open(name).name
        with self._database.writing() as connection:
            for table in PER_SITE:
                connection.execute(f"DELETE FROM {table} WHERE site = ?", (name,))
            connection.execute("DELETE FROM sites WHERE name = ?", (name,))
        self._delete_folder(name)

    def write_map(self, name: str, data: bytes) -> None:
        """Write the map file of a site, atomically; the caller has checked the contents."""
        folder = self._root / checked_name(name)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StorageFailed(f"{folder} cannot be made: {error.strerror}") from None
        write_whole(folder / MAP_FILE, data)

    def _insert(self, execute: Execute, name: str) -> None:
        self._require_free(execute, name)
        if len(self._names(execute)) >= MAX_SITES:
            raise Refused(f"at most {MAX_SITES} sites are kept; delete one first")
        execute("INSERT INTO sites VALUES (?, NULL, 0, NULL)", (name,))

    def _require_free(self, execute: Execute, name: str) -> None:
        if name.lower() in self._names(execute):
            raise Refused(f"a site is called {name!r} already; choose another name")

    @staticmethod
    def _names(execute: Execute) -> set[str]:
        return {name.lower() for (name,) in execute("SELECT name FROM sites")}

    def _move_folder(self, before: str, name: str) -> None:
        old, new = self._root / checked_name(before), self._root / checked_name(name)
        if old.exists() and (old.name.lower() == new.name.lower() or not new.exists()):
            try:
                old.rename(new)
            except OSError as error:
                raise StorageFailed(f"{old} cannot be renamed: {error.strerror}") from None
        self._database.write("UPDATE sites SET renamed_from = NULL WHERE name = ?", (name,))

    def _delete_folder(self, name: str) -> None:
        with suppress(FileNotFoundError):
            shutil.rmtree(self._root / checked_name(name))


@contextmanager
def site_table(folder: Path) -> Iterator[SiteTable]:
    """Open the sites of a data folder, also while a console runs on it."""
    with closing(Database(folder)) as database:
        yield SiteTable(database, folder)
