"""Sites of a data folder: their names, their contents, and what an interrupted step leaves."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.storage import Store, sites
from app.storage.schema import FIRST_SITE
from app.storage.site_store import SiteStore
from app.storage.sites import MAX_SITES, checked_name
from navcore.errors import BadConfiguration, NotKnown, Refused, StorageFailed
from navcore.files import write_whole
from navcore.mission.beware_list import default_beware_list
from navcore.mission.zone import Zone
from web.auth.roles import Role
from web.auth.users import User

CORNERS = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
VERSION_1 = (
    "CREATE TABLE zones (position INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE, "
    "zone TEXT NOT NULL) STRICT",
    "CREATE TABLE beware_lists (position INTEGER PRIMARY KEY AUTOINCREMENT, "
    "version INTEGER NOT NULL, list TEXT NOT NULL) STRICT",
    "CREATE TABLE runs (id TEXT PRIMARY KEY, report TEXT NOT NULL) STRICT",
    "CREATE TABLE documents (kind TEXT NOT NULL, name TEXT NOT NULL, document TEXT NOT NULL, "
    "PRIMARY KEY (kind, name)) STRICT",
    "CREATE TABLE users (name TEXT PRIMARY KEY, role TEXT NOT NULL, password_hash TEXT NOT NULL, "
    "token_hash TEXT) STRICT",
    "CREATE TABLE audit (id INTEGER PRIMARY KEY AUTOINCREMENT, at TEXT NOT NULL, "
    "entry TEXT NOT NULL) STRICT",
    "CREATE TABLE events (id INTEGER PRIMARY KEY, start INTEGER NOT NULL, stamp_s REAL NOT NULL, "
    "unix_s REAL NOT NULL, kind TEXT NOT NULL, text TEXT NOT NULL, x_m REAL, y_m REAL) STRICT",
    "CREATE INDEX events_by_kind ON events (kind, id)",
    "PRAGMA user_version = 1",
)
"""Schema of the data folders before sites."""


VERA = User(name="vera", role=Role.ADMIN, password_hash="-")


def zone(name: str) -> Zone:
    return Zone(id=name, name=name, polygon=CORNERS)


def names(store: Store) -> list[str]:
    return [row.name for row in store.sites.all()]


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    opened = Store(tmp_path)
    yield opened
    opened.close()


def write_map(site: SiteStore, data: bytes, *, at_s: float | None = None) -> None:
    site.folder.mkdir(parents=True, exist_ok=True)
    site.map_file.write_bytes(data)
    if at_s is not None:
        os.utime(site.map_file, (at_s, at_s))


def fill(store: Store, site: str, *, mark: bytes = b"map") -> None:
    contents = store.sites.open(site)
    contents.save_zone(zone("wet"))
    contents.save_document("mission", "round", {"goals": [], "loop": False})
    contents.save_beware(default_beware_list().edited("cup", margin_m=0.3))
    write_map(contents, mark)


def test_two_sites_hold_the_same_names_and_ids_apart(store: Store) -> None:
    store.sites.make("hall")
    fill(store, "default")
    hall = store.sites.open("hall")
    assert (hall.zones(), hall.documents("mission"), hall.beware()) == ((), {}, None)
    hall.save_zone(zone("wet"))
    hall.change_zones([], ["wet"])
    assert store.site.zones() == (zone("wet"),)


def test_a_copy_has_everything_and_goes_its_own_way(store: Store) -> None:
    fill(store, "default")
    copied = store.sites.copy("default", "Day 2")
    assert copied.zones() == (zone("wet"),) and copied.map_file.read_bytes() == b"map"
    assert copied.documents("mission") == store.site.documents("mission")
    assert copied.beware_versions() == store.site.beware_versions()
    copied.change_zones([], ["wet"])
    write_map(copied, b"other")
    assert store.site.zones() == (zone("wet"),) and store.site.map_file.read_bytes() == b"map"


def test_a_renamed_site_keeps_its_contents_and_its_old_name_is_free(store: Store) -> None:
    fill(store, "default")
    renamed = store.sites.rename("default", "Hall")
    assert renamed.zones() == (zone("wet"),) and renamed.map_file.read_bytes() == b"map"
    assert renamed.folder.name == "Hall" and names(store) == ["Hall"]
    assert store.sites.rename("Hall", "hall").map_file.read_bytes() == b"map"
    assert store.sites.make("default").zones() == ()


def test_a_site_is_called_by_one_id_under_every_name_and_no_other_site_is(store: Store) -> None:
    ids = [store.site.id, store.sites.copy("default", "Day 2").id, store.sites.make("hall").id]
    assert store.sites.rename("hall", "nave").id == ids[2] == store.sites.open("nave").id
    store.sites.delete("nave")
    ids.append(store.sites.make("nave").id)
    assert len(set(ids)) == 4 and all(ids)


def test_a_deleted_site_is_gone_with_its_map(store: Store) -> None:
    store.sites.make("hall")
    fill(store, "hall")
    folder = store.sites.open("hall").folder
    store.sites.delete("hall")
    assert names(store) == ["default"] and not folder.exists()
    with pytest.raises(NotKnown, match="'hall'"):
        store.sites.open("hall")
    again = store.sites.make("hall")
    assert (again.zones(), again.beware(), again.map_file.exists()) == ((), None, False)


def test_a_name_that_is_taken_is_refused_whatever_its_case(store: Store) -> None:
    store.sites.make("Hall")
    acts: tuple[Callable[[], object], ...] = (
        lambda: store.sites.make("hall"),
        lambda: store.sites.copy("default", "HALL"),
        lambda: store.sites.rename("default", "hall"),
    )
    for act in acts:
        with pytest.raises(Refused, match="already"):
            act()
    assert names(store) == ["default", "Hall"]


def test_the_number_of_sites_is_bounded(store: Store) -> None:
    for number in range(MAX_SITES - 1):
        store.sites.make(f"site {number}")
    with pytest.raises(Refused, match="at most"):
        store.sites.make("one more")


@given(text=st.text(max_size=60))
def test_every_name_that_is_allowed_is_a_plain_file_name(text: str) -> None:
    try:
        name = checked_name(text)
    except BadConfiguration:
        return
    assert Path(name).name == name and name.isascii() and name.isprintable()
    assert name[0] not in ".-" and name == name.strip() and len(name) <= 40


@pytest.mark.parametrize("name", ["", "..", "a/b", "a\\b", "\x00", ".a", "a ", "-a", "x" * 41])
def test_a_name_that_could_leave_the_folder_is_refused(store: Store, name: str) -> None:
    acts: tuple[Callable[[], object], ...] = (
        lambda: store.sites.make(name),
        lambda: store.sites.copy("default", name),
        lambda: store.sites.rename("default", name),
    )
    for act in acts:
        with pytest.raises(BadConfiguration, match="expected 1 to 40"):
            act()


def test_a_renaming_that_was_killed_is_finished_at_the_next_start(tmp_path: Path) -> None:
    store = Store(tmp_path)
    fill(store, "default")
    folder = store.site.folder
    store.sites.rename("default", "hall")
    # As if the process had died between the rows and the folder.
    (folder.parent / "hall").rename(folder)
    store._database.write("UPDATE sites SET renamed_from = 'default' WHERE name = 'hall'")
    store.close()
    with closing(Store(tmp_path)) as again:
        assert again.site.name == "hall" and again.site.map_file.read_bytes() == b"map"


def test_a_folder_that_cannot_be_renamed_is_used_on_and_renamed_at_the_next_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    store = Store(tmp_path)
    fill(store, "default")
    with monkeypatch.context() as broken:
        broken.setattr(Path, "rename", fail)
        renamed = store.sites.rename("default", "hall")
    assert names(store) == ["hall"] and renamed.name == "hall"
    assert renamed.map_file.read_bytes() == b"map" and renamed.zones() == (zone("wet"),)
    write_map(store.sites.open("hall"), b"newer map")
    # The folder of that name is in use still.
    with pytest.raises(Refused, match="already"):
        store.sites.make("default")
    store.close()
    with closing(Store(tmp_path)) as again:
        hall = again.sites.open("hall")
        assert hall.folder.name == "hall" and hall.map_file.read_bytes() == b"newer map"
        assert again.sites.make("default").map_file.exists() is False


def test_a_renaming_whose_last_note_is_not_stored_has_succeeded(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill(store, "default")
    write = store._database.write

    def fail(statement: str, values: tuple[object, ...] = ()) -> None:
        if "renamed_from = NULL" in statement:
            raise StorageFailed("the disk is full")
        write(statement, values)

    monkeypatch.setattr(store._database, "write", fail)
    renamed = store.sites.rename("default", "hall")
    assert renamed.folder.name == store.sites.open("hall").folder.name == "hall"
    assert renamed.map_file.read_bytes() == b"map"
    monkeypatch.undo()
    # Back again, while the note of the first renaming is still there.
    assert store.sites.rename("hall", "default").map_file.read_bytes() == b"map"


@pytest.mark.parametrize("newer", ["default", "hall"])
def test_of_two_folders_of_a_renamed_site_the_newer_map_is_kept(tmp_path: Path, newer: str) -> None:
    store = Store(tmp_path)
    fill(store, "default")
    store.sites.rename("default", "hall")
    for name in ("default", "hall"):
        site = SiteStore(store._database, name, tmp_path / "sites" / name, "id")
        write_map(site, name.encode(), at_s=2e9 if name == newer else 1e9)
    store._database.write("UPDATE sites SET renamed_from = 'default' WHERE name = 'hall'")
    store.close()
    with closing(Store(tmp_path)) as again:
        assert again.site.map_file.read_bytes() == newer.encode()
        assert again.site.folder.name == "hall"


def test_a_map_is_written_before_the_transaction_and_a_draft_of_before_is_deleted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(tmp_path)
    fill(store, "default")

    def check(path: Path, data: bytes) -> None:
        assert not store._database._connection.in_transaction
        write_whole(path, data)

    monkeypatch.setattr(sites, "write_whole", check)
    assert store.sites.copy("default", "hall").map_file.read_bytes() == b"map"
    draft = tmp_path / "sites" / f"{sites.DRAFT}killed"
    draft.mkdir()
    store.close()
    with closing(Store(tmp_path)):
        folders = sorted(path.name for path in (tmp_path / "sites").iterdir())
        assert folders == ["default", "hall"]


def test_a_site_whose_making_fails_halfway_is_not_there(store: Store) -> None:
    with pytest.raises(StorageFailed, match="full"), store.sites.making("hall", b"map") as site:
        site.save_zone(zone("wet"))
        raise StorageFailed("the disk is full")
    assert names(store) == ["default"] and not (store.path.parent / "sites" / "hall").exists()
    assert store.sites.make("hall").zones() == ()


def test_the_newest_site_is_that_chosen_last_whatever_the_clock_says(tmp_path: Path) -> None:
    with closing(Store(tmp_path)) as store:
        store.use("default")
        # A console of before, with a clock that was years ahead.
        store._database.write("UPDATE sites SET chosen = 4e9")
        store.sites.make("hall")
        store.use("hall", world="office")
    with closing(Store(tmp_path)) as again:
        assert again.site.name == "hall" and again.sites.last_of("office") == "hall"


def test_the_site_that_was_used_last_in_a_world_is_used_again(store: Store) -> None:
    assert store.sites.last_of("office") == "default"
    store.use("default", world="office")
    assert store.sites.last_of("office") == "default"
    assert store.sites.last_of("my world.v2") == "my-world-v2"
    store.sites.make("upstairs")
    store.use("upstairs", world="office")
    assert store.sites.last_of("office") == "upstairs"
    store.sites.make("indoor")
    store.use("indoor", world="office")
    assert store.sites.last_of("indoor") == "indoor-2"


def test_a_data_folder_of_before_becomes_the_site_default(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / "console.sqlite")) as before:
        for statement in VERSION_1:
            before.execute(statement)
    with closing(Store(tmp_path)) as now:
        # What a console of before stored, in the same words.
        fill(now, FIRST_SITE)
        now.save_run({"id": "a"})
        rows = {
            table: now._database.rows(f"SELECT * FROM {table}")
            for table in ("zones", "beware_lists", "documents")
        }
    old = tmp_path / "old"
    old.mkdir()
    with closing(sqlite3.connect(old / "console.sqlite")) as before:
        for statement in VERSION_1:
            before.execute(statement)
        before.execute("""INSERT INTO runs VALUES ('a', '{"id": "a", "series": {"t_s": [0]}}')""")
        before.execute("INSERT INTO users VALUES ('vera', 'admin', '-', NULL)")
        for _, _, *row in rows["zones"]:
            before.execute("INSERT INTO zones (id, zone) VALUES (?, ?)", row)
        for _, _, *row in rows["beware_lists"]:
            before.execute("INSERT INTO beware_lists (version, list) VALUES (?, ?)", row)
        for _, *row in rows["documents"]:
            before.execute("INSERT INTO documents VALUES (?, ?, ?)", row)
        before.commit()
    with closing(Store(old)) as moved, closing(Store(tmp_path)) as now:
        assert names(moved) == [FIRST_SITE] and moved.site.name == FIRST_SITE
        assert moved.site.zones() == now.site.zones() == (zone("wet"),)
        assert moved.site.beware() == now.site.beware()
        assert moved.site.documents("mission") == now.site.documents("mission")
        assert moved.runs() == ({"id": "a"},)
        assert moved.run("a") == {"id": "a", "series": {"t_s": [0]}}
        assert moved.users.all() == (VERA,) and moved.users.all()[0].language is None
    with closing(Store(old)) as again:
        assert again.site.zones() == (zone("wet"),)


def test_the_users_of_a_data_folder_of_before_gain_a_language(tmp_path: Path) -> None:
    with closing(Store(tmp_path)) as before:
        fill(before, FIRST_SITE)
        before.users.add(VERA)
        before._database.write("ALTER TABLE users DROP COLUMN language")
        before._database.write("ALTER TABLE sites DROP COLUMN id")
        before._database.write("ALTER TABLE sites RENAME COLUMN chosen TO chosen_unix_s")
        before._database.write("DROP TABLE runs")
        before._database.write("CREATE TABLE runs (id TEXT PRIMARY KEY, report TEXT NOT NULL)")
        before._database.write("PRAGMA user_version = 2")
    with closing(Store(tmp_path)) as now:
        assert now.users.all() == (VERA,) and now.site.zones() == (zone("wet"),)
        assert now.users.change("vera", language="de").language == "de"
        site_id = now.site.id
        assert site_id
    with closing(Store(tmp_path)) as again:
        assert again.users.all()[0].language == "de" and again.site.id == site_id


def test_the_sites_of_a_data_folder_of_before_gain_ids(tmp_path: Path) -> None:
    with closing(Store(tmp_path)) as before:
        before.sites.make("hall")
        fill(before, FIRST_SITE)
        before._database.write("ALTER TABLE sites DROP COLUMN id")
        before._database.write("PRAGMA user_version = 4")
    with closing(Store(tmp_path)) as now:
        ids = {row.id for row in now.sites.all()}
        assert len(ids) == 2 and all(ids) and now.site.zones() == (zone("wet"),)
