"""The sites of a data folder: made, chosen, renamed, copied, deleted.

Rows are in the SQLite file, the map of a site is in the folder `sites/NAME`. Names are restricted
to what is a plain file name everywhere, and differ in more than case.
"""

from __future__ import annotations

import dataclasses
import logging
import re
import shutil
import uuid
from collections.abc import Callable, Collection, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.storage.database import Database
from app.storage.schema import PER_SITE
from app.storage.site_store import MAP_FILE, SiteStore
from navcore.errors import BadConfiguration, NotKnown, Refused, StorageFailed
from navcore.files import read_whole, sync_folder, write_whole
from navcore.mapping.storage.map_file import MAX_BYTES
from web.interface.sites import SITE_NAME

log = logging.getLogger(__name__)
MAX_SITES = 100
"""Largest number of sites in a data folder."""
DRAFT = ".new-"
"""Begin of the name of a folder that is to become that of a site; no site is called so."""

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
    """Name of its folder; not yet that of the site where a renaming is to be finished."""
    id: str
    """What it is called by in requests; it stays under another name, and no other site has it."""


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
        """`folder`: the data folder."""
        self._database, self._root = database, folder / "sites"

    def tidy(self) -> None:
        """Finish what an end of the console has interrupted; only while no other program uses the
        data folder. What fails is left to the next start."""
        for draft in self._root.glob(f"{DRAFT}*"):
            shutil.rmtree(draft, ignore_errors=True)
        for (name,) in self._database.rows("SELECT name FROM sites WHERE renamed_from IS NOT NULL"):
            self._move_folder(self._row(name))

    def all(self) -> tuple[SiteRow, ...]:
        """Return all sites by name."""
        rows = self._database.rows("SELECT name, world, chosen, renamed_from, id FROM sites")
        names = {row[0].lower() for row in rows}
        return tuple(
            SiteRow(
                name=name,
                world=world,
                chosen=chosen,
                folder=self._folder(name, before, names),
                id=site_id,
            )
            for name, world, chosen, before, site_id in sorted(rows, key=lambda row: row[0].lower())
        )

    def _folder(self, name: str, before: str | None, names: Collection[str]) -> str:
        """Return the name of the folder of a site; `before`: its former name, if a renaming is to
        be finished. Of two folders that of the newer map."""
        if before is None or (before.lower() in names and before.lower() != name.lower()):
            return name
        return max((name, before), key=lambda one: _kept_s(self._root / one / MAP_FILE))

    def _row(self, name: str) -> SiteRow:
        for row in self.all():
            if row.name.lower() == name.lower():
                return row
        raise NotKnown(f"no site is called {name!r:.90}")

    def open(self, name: str) -> SiteStore:
        """Return the contents of a site; raises `NotKnown`."""
        row = self._row(name)
        return SiteStore(self._database, row.name, self._root / row.folder, row.id)

    def last_of(self, world: str) -> str:
        """Return the site that was last chosen in a world, or a free name for its first one."""
        fitting = [row for row in self.all() if row.world in (None, world)]
        if fitting:
            return max(fitting, key=lambda row: row.chosen).name
        made = re.sub(r"[^A-Za-z0-9_-]+", "-", world).strip("-_")[:36] or "site"
        known = {name.lower() for row in self.all() for name in (row.name, row.folder)}
        names = (made, *(f"{made}-{number}" for number in range(2, MAX_SITES + 2)))
        return next(name for name in names if name.lower() not in known)

    def choose(self, name: str, world: str | None) -> SiteStore:
        """Note that a site is in use now, in `world`; raises `NotKnown`."""
        site = self.open(name)
        # Not the time: a robot has none before it is on a network, and may have had a wrong one.
        self._database.write(
            "UPDATE sites SET chosen = (SELECT max(chosen) + 1 FROM sites), "
            "world = coalesce(world, ?) WHERE name = ?",
            (world, site.name),
        )
        return site

    def make(self, name: str) -> SiteStore:
        """Make an empty site; raises `Refused` for a name that is taken or too many sites."""
        with self.making(name) as site:
            return site

    @contextmanager
    def making(self, name: str, map_data: bytes | None = None) -> Iterator[SiteStore]:
        """Make a site with a map file, the rest of which the block stores: all or nothing."""
        checked_name(name)
        with self._draft(map_data) as draft, self._database.writing() as connection:
            site_id = self._insert(connection.execute, name)
            self._delete_folder(name)  # of a site whose deletion was interrupted
            site = SiteStore(self._database, name, self._root / name, site_id)
            yield site
            if draft is not None:
                _rename(draft, site.folder)

    @contextmanager
    def _draft(self, map_data: bytes | None) -> Iterator[Path | None]:
        """Write a map file into a folder that is to be renamed, before the transaction: writing it
        takes seconds, in which everything else would wait for the database."""
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
            yield draft
        finally:
            shutil.rmtree(draft, ignore_errors=True)

    def copy(self, name: str, new_name: str) -> SiteStore:
        """Copy a site with everything in it."""
        source = self.open(name)
        checked_name(new_name)
        taken = read_whole(source.map_file, at_most=MAX_BYTES) if source.map_file.exists() else None
        with self.making(new_name, taken) as site, self._database.writing() as connection:
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
            return site

    def rename(self, name: str, new_name: str) -> SiteStore:
        """Rename a site, then its folder; raises `Refused` for a name that is taken. Where the
        folder cannot be renamed the site goes on with it, and the next start tries again."""
        with self.renaming(name, new_name) as site:
            return site

    @contextmanager
    def renaming(self, name: str, new_name: str) -> Iterator[SiteStore]:
        """Rename a site, of which the block stores more: all or nothing. Its folder follows at the
        end, as with `rename`; with the name that it has, only the block is done."""
        before = self._row(name)
        checked_name(new_name)
        site = SiteStore(self._database, new_name, self._root / before.folder, before.id)
        with self._database.writing() as connection:
            if new_name != before.name:
                self._give_name(connection.execute, before, new_name)
            yield site
        if new_name != before.name:
            site.folder = self._move_folder(dataclasses.replace(before, name=new_name))

    def _give_name(self, execute: Execute, before: SiteRow, new_name: str) -> None:
        """Give a site and its contents another name, within a transaction."""
        self._require_free(execute, new_name, besides=before.name)
        if new_name.lower() != before.folder.lower():
            self._delete_folder(new_name)  # of a site whose deletion was interrupted
        execute(
            "UPDATE sites SET name = ?, renamed_from = ? WHERE name = ?",
            (new_name, before.folder, before.name),
        )
        for table in PER_SITE:
            execute(f"UPDATE {table} SET site = ? WHERE site = ?", (new_name, before.name))

    def delete(self, name: str) -> None:
        """Delete a site with everything in it; raises `NotKnown`."""
        site = self._row(name)
        with self._database.writing() as connection:
            for table in PER_SITE:
                connection.execute(f"DELETE FROM {table} WHERE site = ?", (site.name,))
            connection.execute("DELETE FROM sites WHERE name = ?", (site.name,))
        with suppress(StorageFailed):  # then the next site of its name deletes it
            self._delete_folder(site.folder)

    def _insert(self, execute: Execute, name: str) -> str:
        """Add a row and return the id of the site."""
        self._require_free(execute, name)
        if execute("SELECT count(*) FROM sites").fetchone()[0] >= MAX_SITES:
            raise Refused(f"at most {MAX_SITES} sites are kept; delete one first")
        site_id = uuid.uuid4().hex
        execute("INSERT INTO sites (name, chosen, id) VALUES (?, 0, ?)", (name, site_id))
        return site_id

    @staticmethod
    def _require_free(execute: Execute, name: str, *, besides: str = "") -> None:
        """Raise `Refused` where another site has a name, or still has a folder of that name."""
        for taken in execute("SELECT name, renamed_from FROM sites WHERE name <> ?", (besides,)):
            if name.lower() in (one.lower() for one in taken if one is not None):
                raise Refused(f"a site is called {name!r} already; choose another name")

    def _move_folder(self, site: SiteRow) -> Path:
        """Give the folder of a site its name and return it. The site has its name already, so a
        failure is no failure of the renaming: the next start tries again."""
        new, old = self._root / site.name, self._root / site.folder
        try:
            if old != new and old.exists():
                if new.exists() and not new.samefile(old):
                    self._delete_folder(site.name)  # it has the older map
                _rename(old, new)
            self._database.write(
                "UPDATE sites SET renamed_from = NULL WHERE name = ?", (site.name,)
            )
        except (OSError, StorageFailed):
            log.exception("the folder of site %r is renamed at the next start", site.name)
            return old if old.exists() else new
        return new

    def _delete_folder(self, name: str) -> None:
        try:
            shutil.rmtree(self._root / checked_name(name))
        except FileNotFoundError:
            pass
        except OSError as error:
            raise StorageFailed(
                f"{self._root / name} cannot be deleted: {error.strerror}"
            ) from None


def _kept_s(path: Path) -> float:
    """Return the time at which a file was written; 0 without one."""
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


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
