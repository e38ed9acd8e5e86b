"""The sites of a data folder: made, chosen, renamed, copied, deleted.

Rows are in the SQLite file under the id of the site, its map is in a folder of its own, which the
row of the site names: a new name of the site changes one row and nothing else. Names are restricted
to what is a plain file name everywhere, and differ in more than case, in letters of any language.
"""

from __future__ import annotations

import re
import shutil
import unicodedata
import uuid
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.storage.database import Database
from app.storage.schema import MAPS, PER_SITE
from app.storage.site_store import MAP_FILE, SiteStore
from navcore.errors import BadConfiguration, NotKnown, Refused, StorageFailed
from navcore.files import remove_drafts, sync_folder, write_whole
from web.interface.sites import is_same_name, plain_name

MAX_NAME = 40
"""Largest number of characters of a name."""
MAX_SITES = 100
"""Largest number of sites in a data folder."""
DRAFT = ".new-"
"""Begin of the name of a folder that is to become that of a site."""

Execute = Callable[..., Any]
"""Function that executes a statement within a transaction."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SiteRow:
    """One site in the list."""

    name: str
    """Name of the site."""
    world: str | None
    """World in which it was first used; None before."""
    chosen: float
    """Number that is larger than that of each site that was chosen before; 0 for never."""
    folder: str
    """Name of its folder; it stays under another name, and no other site has it."""
    id: str
    """What it is called by in requests; it stays under another name, and no other site has it."""


def checked_name(name: str) -> str:
    """Return the `plain_name` of a site; raises `BadConfiguration` for one that is not allowed."""
    name = plain_name(name)
    kinds = [_kind(char) for char in name]
    if not (
        0 < len(name) <= MAX_NAME
        and kinds[0] in ("letter", "digit")
        and None not in kinds
        and name == name.strip()
    ):
        raise BadConfiguration(
            f"site name {name!r:.90}: expected 1 to 40 letters, digits, blanks, - and _, beginning "
            "with a letter or digit"
        )
    return name


def _kind(char: str) -> str | None:
    """Return what a character of a name is; None for one that has no place there."""
    category = unicodedata.category(char)
    if category in ("Mn", "Mc"):  # signs of the letter before them, as vowels in Indian scripts
        return "mark"
    if category.startswith("L"):
        return "letter"
    if category == "Nd":
        return "digit"
    return "sign" if char in " _-" else None


class SiteTable:
    """All sites of a data folder; safe to use from any thread."""

    def __init__(self, database: Database, folder: Path) -> None:
        """`folder`: the data folder."""
        self._database, self._root = database, folder / MAPS

    def tidy(self) -> None:
        """Delete the folders that an end of the console, or of another program, has left of a site
        that was being made or deleted, and half-written maps. What fails is left to the next start.

        A folder that the database does not know is kept: beside a new or a restored database, it
        holds the map of a site of the other one.
        """
        # Within a transaction, as a program that makes a site meanwhile gives it its folder in one.
        with suppress(StorageFailed), self._database.writing():
            for draft in self._root.glob(f"{DRAFT}*"):
                shutil.rmtree(draft, ignore_errors=True)
            for row in self.all():
                remove_drafts(self.contents(row).map_file)
            for (name,) in self._database.rows("SELECT folder FROM obsolete_folders"):
                self._delete_folder(name)

    def all(self) -> tuple[SiteRow, ...]:
        """Return all sites by name."""
        rows = self._database.rows(
            "SELECT name, world, chosen, folder, id FROM sites ORDER BY name"
        )
        return tuple(
            SiteRow(name=name, world=world, chosen=chosen, folder=folder, id=site_id)
            for name, world, chosen, folder, site_id in rows
        )

    def contents(self, row: SiteRow) -> SiteStore:
        """Return the contents of a site of the list."""
        return SiteStore(
            self._database, site_id=row.id, name=row.name, folder=self._root / row.folder
        )

    def open(self, name: str) -> SiteStore:
        """Return the contents of a site; raises `NotKnown`."""
        rows = self.all()
        # Two of an earlier version may differ in the number of blanks alone.
        for row in sorted(rows, key=lambda row: row.name != name):
            if is_same_name(row.name, name):
                return self.contents(row)
        raise NotKnown(f"no site is called {name!r:.90}")

    def last_of(self, world: str) -> str:
        """Return the site that was last chosen in a world, or a free name for its first one."""
        fitting = [row for row in self.all() if row.world in (None, world)]
        if fitting:
            return max(fitting, key=lambda row: row.chosen).name
        made = re.sub(r"[^A-Za-z0-9_-]+", "-", world).strip("-_")[:36] or "site"
        known = [row.name for row in self.all()]
        names = (made, *(f"{made}-{number}" for number in range(2, MAX_SITES + 2)))
        return next(name for name in names if not any(is_same_name(name, other) for other in known))

    def of_start(self, name: str | None, world: str) -> SiteStore:
        """Return the site of a start in a world: that of a name, else the one that was last used
        there. One that there is not yet is empty, and stored by `choose`."""
        name = name or self.last_of(world)
        try:
            return self.open(name)
        except NotKnown:
            return self._new(checked_name(name))

    def choose(self, site: SiteStore, world: str) -> None:
        """Note that a site is in use now, in `world`; raises `Refused` where it is not stored yet
        and there are too many."""
        with self._database.writing() as connection:
            if site.id not in {row.id for row in self.all()}:
                self._insert(connection.execute, site)
            # Not the time: a robot has none before it is on a network, and may have had a wrong
            # one.
            connection.execute(
                "UPDATE sites SET chosen = (SELECT max(chosen) + 1 FROM sites), "
                "world = coalesce(world, ?) WHERE id = ?",
                (world, site.id),
            )

    @contextmanager
    def choosing(self, site: SiteStore, world: str) -> Iterator[None]:
        """Note that a stored site is in use now, which is taken back where the block fails."""
        (before,) = self._database.rows("SELECT chosen, world FROM sites WHERE id = ?", (site.id,))
        self.choose(site, world)
        try:
            yield
        except BaseException:
            self._database.write(
                "UPDATE sites SET chosen = ?, world = ? WHERE id = ?", (*before, site.id)
            )
            raise

    def make(self, name: str) -> SiteStore:
        """Make an empty site; raises `Refused` for a name that is taken or too many sites."""
        with self.making(name) as site:
            return site

    @contextmanager
    def making(self, name: str, map_data: bytes | None = None) -> Iterator[SiteStore]:
        """Make a site with a map file, the rest of which the block stores: all or nothing."""
        site = self._new(checked_name(name))
        with self._draft(site.folder, map_data) as draft, self._database.writing() as connection:
            self._insert(connection.execute, site)
            yield site
            if draft is not None:
                connection.execute(
                    "DELETE FROM obsolete_folders WHERE folder = ?", (site.folder.name,)
                )
                _rename(draft, site.folder)

    def _new(self, name: str) -> SiteStore:
        """Return an empty site that is not stored yet."""
        site_id = uuid.uuid4().hex
        return SiteStore(self._database, site_id=site_id, name=name, folder=self._root / site_id)

    @contextmanager
    def _draft(self, folder: Path, map_data: bytes | None) -> Iterator[Path | None]:
        """Write a map file into a folder that is to be renamed to `folder`, before the transaction:
        writing it takes seconds, in which everything else would wait for the database."""
        if map_data is None:
            yield None
            return
        draft = self._root / f"{DRAFT}{uuid.uuid4().hex}"
        try:
            draft.mkdir(parents=True)
        except OSError as error:
            raise StorageFailed(f"{draft} cannot be made: {error.strerror}") from None
        try:
            write_whole(draft / MAP_FILE, map_data)
            # In force where the transaction ends between the renaming and its commit.
            self._database.write("INSERT INTO obsolete_folders VALUES (?)", (folder.name,))
            yield draft
        finally:
            shutil.rmtree(draft, ignore_errors=True)

    def copy(self, name: str, new_name: str) -> SiteStore:
        """Copy a site with everything in it; raises `NotKnown` also where it is deleted
        meanwhile."""
        source, new_name = self.open(name), checked_name(new_name)
        taken = source.map_data()
        with (
            self.making(new_name, taken) as site,
            self._database.writing() as connection,
            source.reading(),
        ):
            for table, columns in PER_SITE.items():
                held = ", ".join(columns)
                connection.execute(
                    f"INSERT INTO {table} (site, {held}) "
                    f"SELECT ?, {held} FROM {table} WHERE site = ? ORDER BY rowid",
                    (site.id, source.id),
                )
            return site

    def rename(self, name: str, new_name: str) -> SiteStore:
        """Rename a site; raises `Refused` for a name that is taken."""
        with self.renaming(name, new_name) as site:
            return site

    @contextmanager
    def renaming(self, name: str, new_name: str | None) -> Iterator[SiteStore]:
        """Rename a site, of which the block stores more: all or nothing. None keeps its name."""
        if new_name is not None:
            new_name = checked_name(new_name)
        with self._database.writing() as connection:
            site = self.open(name)
            if new_name is not None:
                self._require_free(new_name, site.id)
                connection.execute("UPDATE sites SET name = ? WHERE id = ?", (new_name, site.id))
                site = self.open(new_name)
            yield site

    def delete(self, name: str) -> None:
        """Delete a site with everything in it; raises `NotKnown`."""
        with self._database.writing() as connection:
            site = self.open(name)
            for table in PER_SITE:
                connection.execute(f"DELETE FROM {table} WHERE site = ?", (site.id,))
            connection.execute("DELETE FROM sites WHERE id = ?", (site.id,))
            connection.execute("INSERT INTO obsolete_folders VALUES (?)", (site.folder.name,))
        self._delete_folder(site.folder.name)

    def _delete_folder(self, name: str) -> None:
        """Delete an obsolete folder. What fails is left to the next start."""
        folder = self._root / name
        with suppress(OSError, StorageFailed):
            if folder.exists():
                shutil.rmtree(folder)
            self._database.write("DELETE FROM obsolete_folders WHERE folder = ?", (name,))

    def _insert(self, execute: Execute, site: SiteStore) -> None:
        """Add the row of a site."""
        self._require_free(site.name, site.id)
        if execute("SELECT count(*) FROM sites").fetchone()[0] >= MAX_SITES:
            raise Refused(f"at most {MAX_SITES} sites are kept; delete one first")
        execute(
            "INSERT INTO sites (id, name, folder, chosen) VALUES (?, ?, ?, 0)",
            (site.id, site.name, site.folder.name),
        )

    def _require_free(self, name: str, site_id: str) -> None:
        """Raise `Refused` where a site of another id has a name; called within a transaction."""
        for row in self.all():
            if is_same_name(row.name, name) and row.id != site_id:
                raise Refused(f"a site is called {row.name!r} already; choose another name")


def _rename(folder: Path, new: Path) -> None:
    try:
        folder.rename(new)
        sync_folder(new.parent)
    except OSError as error:
        raise StorageFailed(f"{folder} cannot be renamed: {error.strerror}") from None


@contextmanager
def site_table(folder: Path) -> Iterator[SiteTable]:
    """Open the sites of a data folder, also while a console runs on it."""
    with closing(Database(folder)) as database:
        yield SiteTable(database, folder)
