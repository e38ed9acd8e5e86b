"""Sites of a data folder: their names, their contents, and what an interrupted step leaves."""

from __future__ import annotations

import os
import sqlite3
import unicodedata
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.storage import Store, sites
from app.storage.schema import FIRST_SITE, PER_SITE
from app.storage.site_store import MAP_FILE, SiteStore
from app.storage.sites import MAX_SITES, checked_name
from app.storage.users import user_table
from navcore.errors import BadConfiguration, NotKnown, Refused, StorageFailed
from navcore.files import read_whole, write_whole
from navcore.mission.beware_list import default_beware_list
from navcore.mission.zone import Zone
from web.auth.roles import Role
from web.auth.users import User
from web.schemas.sites import SiteIn

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
VERSION_6 = ("DROP TABLE obsolete_folders", "PRAGMA user_version = 6")
"""Way back to the schema that did not record which folders are to be deleted."""
VERSION_5 = (
    *VERSION_6,
    "ALTER TABLE sites RENAME TO now",
    "CREATE TABLE sites (name TEXT PRIMARY KEY COLLATE NOCASE, world TEXT, chosen REAL NOT NULL, "
    "renamed_from TEXT, id TEXT NOT NULL DEFAULT '') STRICT",
    "INSERT INTO sites SELECT name, world, chosen, NULL, id FROM now",
    "DROP TABLE now",
    *(
        f"UPDATE {table} SET site = (SELECT name FROM sites WHERE sites.id = site)"
        for table in PER_SITE
    ),
    "PRAGMA user_version = 5",
)
"""Way back to the schema in which everything of a site was stored under its name."""
VERSION_4 = (*VERSION_5, "ALTER TABLE sites DROP COLUMN id", "PRAGMA user_version = 4")
VERSION_3 = (
    *VERSION_4,
    "ALTER TABLE sites RENAME COLUMN chosen TO chosen_unix_s",
    "DROP TABLE runs",
    "CREATE TABLE runs (id TEXT PRIMARY KEY, report TEXT NOT NULL)",
    "PRAGMA user_version = 3",
)
VERSION_2 = (*VERSION_3, "ALTER TABLE users DROP COLUMN language", "PRAGMA user_version = 2")
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


def write_map(site: SiteStore, data: bytes) -> None:
    site.folder.mkdir(parents=True, exist_ok=True)
    site.map_file.write_bytes(data)


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
    assert names(store) == ["Hall"]
    assert store.sites.rename("Hall", "hall").map_file.read_bytes() == b"map"
    again = store.sites.make("default")
    assert again.zones() == () and not again.map_file.exists()


def test_what_is_stored_at_a_site_that_was_opened_under_its_former_name_is_its_own(
    store: Store,
) -> None:
    opened = store.site
    store.sites.rename("default", "hall")
    fill(store, store.sites.make("default").name)
    opened.save_document("mission", "night round", {})
    opened.save_zone(zone("dry"))
    write_map(opened, b"newer")
    hall = store.sites.open("hall")
    assert list(hall.documents("mission")) == ["night round"] and hall.zones() == (zone("dry"),)
    assert hall.map_file.read_bytes() == b"newer"
    assert list(store.sites.open("default").documents("mission")) == ["round"]


def test_a_site_that_is_renamed_while_it_is_copied_is_copied_whole(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill(store, "default")

    def read_and_rename(path: Path, *, at_most: int) -> bytes:
        store.sites.rename("default", "hall")
        return read_whole(path, at_most=at_most)

    monkeypatch.setattr("app.storage.site_store.read_whole", read_and_rename)
    copied = store.sites.copy("default", "Day 2")
    assert copied.zones() == (zone("wet"),) and copied.map_file.read_bytes() == b"map"


def test_a_site_that_is_deleted_while_it_is_copied_is_no_empty_copy(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    store.sites.make("hall")
    fill(store, "hall")

    def read_and_delete(path: Path, *, at_most: int) -> bytes:
        data = read_whole(path, at_most=at_most)
        store.sites.delete("hall")
        return data

    monkeypatch.setattr("app.storage.site_store.read_whole", read_and_delete)
    with pytest.raises(NotKnown, match="'hall'"):
        store.sites.copy("hall", "Day 2")
    assert names(store) == ["default"]


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


def test_letters_of_any_language_are_told_apart_in_more_than_case(store: Store) -> None:
    for name in ("Küche", "Almacén 2", "倉庫", "हिन्दी"):
        assert store.sites.make(name).name == name
        assert store.sites.open(name.upper()).name == name
    in_parts = unicodedata.normalize("NFD", "küche")
    assert in_parts != "küche"
    for again in ("KÜCHE", in_parts, "almacén  2"):
        with pytest.raises(Refused, match="already"):
            store.sites.make(again)
    for bad in ("Lager 20 m²", "Halle ½", "①", "\u0901a"):
        with pytest.raises(BadConfiguration, match="1 to 40 letters"):
            store.sites.make(bad)
    assert store.sites.rename("almacén 2", unicodedata.normalize("NFD", "Süd")).name == "Süd"


def test_of_two_names_that_look_alike_the_one_that_is_given_is_meant(store: Store) -> None:
    """An earlier version allowed several blanks."""
    one, other = store.sites.make("Ward 3"), store.sites.make("Ward 4")
    store._database.write("UPDATE sites SET name = 'Ward  3' WHERE id = ?", (other.id,))
    assert store.sites.open("Ward 3").id == one.id
    assert store.sites.open("Ward  3").id == other.id
    store.sites.delete("Ward 3")
    assert store.sites.open("ward 3").id == other.id


@given(text=st.text(max_size=45))
def test_the_api_takes_every_name_that_is_allowed(text: str) -> None:
    try:
        name = checked_name(text)
    except BadConfiguration:
        return
    assert SiteIn(name=name).name == name


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
    assert Path(name).name == name and name.isprintable()
    assert name[0] not in ".-" and name == name.strip() and len(name) <= 40


@pytest.mark.parametrize(
    "name",
    ["", "..", "a/b", "a\\b", "\x00", ".a", "a ", "-a", "_a", "x" * 41, "a\u200eb", "a\nb", "★"],
)
def test_a_name_that_could_leave_the_folder_is_refused(store: Store, name: str) -> None:
    acts: tuple[Callable[[], object], ...] = (
        lambda: store.sites.make(name),
        lambda: store.sites.copy("default", name),
        lambda: store.sites.rename("default", name),
    )
    for act in acts:
        with pytest.raises(BadConfiguration, match="1 to 40 letters"):
            act()


def test_a_map_is_written_before_the_transaction_and_a_draft_of_before_is_deleted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(tmp_path)
    fill(store, "default")

    def check(path: Path, data: bytes) -> None:
        assert not store._database._connection.in_transaction
        write_whole(path, data)

    monkeypatch.setattr(sites, "write_whole", check)
    copied = store.sites.copy("default", "hall")
    assert copied.map_file.read_bytes() == b"map"
    folders = tmp_path / "sites"
    (folders / f"{sites.DRAFT}killed").mkdir()
    kept = {copied.folder.name, store.site.folder.name}
    store.close()
    with closing(Store(tmp_path)):
        assert {path.name for path in folders.iterdir()} == kept


def test_a_new_database_beside_the_folders_of_another_one_costs_no_map(tmp_path: Path) -> None:
    with closing(Store(tmp_path)) as store:
        fill(store, "default")
    file = tmp_path / "console.sqlite"
    file.rename(tmp_path / "away")
    with closing(Store(tmp_path)) as new:
        assert not new.site.map_file.exists()
    (tmp_path / "away").rename(file)
    with closing(Store(tmp_path)) as again:
        assert again.site.map_file.read_bytes() == b"map"


@pytest.mark.parametrize("folder", ["0" * 32, "Hall"])
def test_a_start_deletes_the_folder_of_a_site_whose_deletion_was_interrupted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str
) -> None:
    with closing(Store(tmp_path)) as store, monkeypatch.context() as patch:
        store.sites.make("hall")
        store._database.write("UPDATE sites SET folder = ? WHERE name = 'hall'", (folder,))
        fill(store, "hall")
        patch.setattr(sites.SiteTable, "_delete_folder", lambda *_: None)
        store.sites.delete("hall")
    assert (tmp_path / "sites" / folder).exists()
    with closing(Store(tmp_path)) as again:
        assert not any((tmp_path / "sites").iterdir())
        assert again._database.rows("SELECT * FROM obsolete_folders") == []


def test_a_start_deletes_the_folder_of_a_site_whose_making_was_interrupted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def rename_and_end(draft: Path, folder: Path) -> None:
        draft.rename(folder)
        raise KeyboardInterrupt

    with closing(Store(tmp_path)) as store, monkeypatch.context() as patch:
        patch.setattr(sites, "_rename", rename_and_end)
        with pytest.raises(KeyboardInterrupt), store.sites.making("hall", b"map"):
            pass
        assert any((tmp_path / "sites").iterdir())
    with closing(Store(tmp_path)) as again:
        assert names(again) == ["default"] and not any((tmp_path / "sites").iterdir())
        with again.sites.making("hall", b"map"):
            pass
    with closing(Store(tmp_path)) as last:
        assert last.sites.open("hall").map_file.read_bytes() == b"map"


def test_a_site_whose_making_fails_halfway_is_not_there(store: Store) -> None:
    with pytest.raises(StorageFailed, match="full"), store.sites.making("hall", b"map") as site:
        site.save_zone(zone("wet"))
        raise StorageFailed("the disk is full")
    assert names(store) == ["default"] and not any((store.path.parent / "sites").iterdir())
    assert store.sites.make("hall").zones() == ()


def test_the_next_start_deletes_what_a_kill_has_left_of_a_map_that_was_written(
    tmp_path: Path,
) -> None:
    with closing(Store(tmp_path)) as store:
        folder = store.site.folder
    folder.mkdir(parents=True)
    for name in ("map.npz", ".map.npz.bewarenav-draft-x7_kq0ab"):
        (folder / name).touch()
    with closing(Store(tmp_path)):
        assert [file.name for file in folder.iterdir()] == ["map.npz"]


def use(store: Store, name: str | None, world: str = "office") -> None:
    with store.using(store.sites.of_start(name, world), world):
        pass


def test_a_start_that_is_refused_stores_nothing(store: Store) -> None:
    use(store, "default")
    store.sites.make("wood")
    before = store.sites.all()
    for name, world in (("wood", "office"), ("new", "office"), (None, "forest")):
        site = store.sites.of_start(name, world)
        with pytest.raises(BadConfiguration), store.using(site, world):
            site.save_zone(zone("wet"))
            raise BadConfiguration("the map does not fit")
        assert store.site.name == "default" and not site.zones()
        assert store.sites.all() == before
    use(store, None, "forest")
    assert store.site.name == "wood"


def test_the_newest_site_is_that_chosen_last_whatever_the_clock_says(tmp_path: Path) -> None:
    with closing(Store(tmp_path)) as store:
        use(store, "default")
        # A console of before, with a clock that was years ahead.
        store._database.write("UPDATE sites SET chosen = 4e9")
        store.sites.make("hall")
        use(store, "hall")
    with closing(Store(tmp_path)) as again:
        assert again.site.name == "hall" and again.sites.last_of("office") == "hall"


def test_the_site_that_was_used_last_in_a_world_is_used_again(store: Store) -> None:
    assert store.sites.last_of("office") == "default"
    use(store, "default")
    assert store.sites.last_of("office") == "default"
    assert store.sites.last_of("my world.v2") == "my-world-v2"
    store.sites.make("upstairs")
    use(store, "upstairs")
    assert store.sites.last_of("office") == "upstairs"
    store.sites.make("indoor")
    use(store, "indoor")
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


@pytest.mark.parametrize("way_back", [VERSION_2, VERSION_3, VERSION_4, VERSION_5])
def test_a_data_folder_of_an_earlier_version_keeps_its_sites_and_its_users(
    tmp_path: Path, way_back: tuple[str, ...]
) -> None:
    with closing(Store(tmp_path)) as before:
        hall = before.sites.make("Hall")
        use(before, "Hall")
        before.users.add(VERA)
        for name in ("default", "Hall"):
            fill(before, name, mark=name.encode())
            before.sites.open(name).folder.rename(tmp_path / "sites" / name)
        hall.save_zone(zone("dry"))
        for statement in way_back:
            before._database.write(statement)
        # Left by a renaming of before, and of no site any more.
        before._database.write("INSERT INTO documents VALUES ('old', 'mission', 'lost', '{}')")
    with closing(Store(tmp_path)) as now:
        ids = {row.name: row.id for row in now.sites.all()}
        assert (
            list(ids) == ["default", "Hall"] and all(ids.values()) and len(set(ids.values())) == 2
        )
        assert (ids["Hall"] == hall.id) is (way_back is VERSION_5)
        assert now.site.name == now.sites.last_of("office") == "Hall"
        assert [one.name for one in now.site.zones()] == ["wet", "dry"]
        for name in ids:
            site = now.sites.open(name)
            assert site.zones()[0] == zone("wet") and list(site.documents("mission")) == ["round"]
            assert site.beware() == default_beware_list().edited("cup", margin_m=0.3)
            assert site.map_file.read_bytes() == name.encode()
        assert now.users.all() == (VERA,)
        assert now.users.change("vera", language="de").language == "de"
        now.sites.rename("Hall", "nave")
        assert now.sites.make("Hall").documents("mission") == {}
        assert now.sites.make("old").documents("mission") == {}
    with closing(Store(tmp_path)) as again:
        assert again.users.all()[0].language == "de" and again.site.id == ids["Hall"]
        assert again.site.name == "nave" and again.site.map_file.read_bytes() == b"Hall"


def test_a_data_folder_of_the_version_before_is_opened_as_it_is(tmp_path: Path) -> None:
    with closing(Store(tmp_path)) as before:
        fill(before, "default")
        for statement in VERSION_6:
            before._database.write(statement)
    with closing(Store(tmp_path)) as now:
        assert now.site.id == before.site.id and now.site.map_file.read_bytes() == b"map"
        now.sites.copy("default", "hall")
        now.sites.delete("default")
        assert names(now) == ["hall"] and not now.site.folder.exists()


def test_a_data_folder_is_not_converted_under_a_console_of_an_earlier_version(
    tmp_path: Path,
) -> None:
    with closing(Store(tmp_path)) as running:
        fill(running, "default")
        with sites.site_table(tmp_path) as beside:  # that of the same version may run
            assert len(beside.all()) == 1
        for statement in VERSION_5:
            running._database.write(statement)
        for opened in (sites.site_table, user_table):
            with pytest.raises(StorageFailed, match="earlier version uses it"), opened(tmp_path):
                pass
        assert running._database.rows("PRAGMA user_version") == [(5,)]
    with sites.site_table(tmp_path) as converted:
        assert converted.open("default").zones() == (zone("wet"),)
        with closing(Store(tmp_path)) as now:  # the lock was that of the conversion
            assert now.site.zones() == (zone("wet"),)


@pytest.mark.parametrize("there", [("default",), ("hall",), ("hall", "default")])
def test_a_renaming_that_an_earlier_version_has_not_finished_costs_no_map(
    tmp_path: Path, there: tuple[str, ...]
) -> None:
    with closing(Store(tmp_path)) as before:
        before.sites.rename("default", "hall")
        for statement in (*VERSION_5, "UPDATE sites SET renamed_from = 'default'"):
            before._database.write(statement)
    for age, name in enumerate(there):
        folder = tmp_path / "sites" / name
        folder.mkdir(parents=True)
        (folder / MAP_FILE).write_text(name)
        os.utime(folder, (1e9 + age, 1e9 + age))
    with closing(Store(tmp_path)) as now:
        assert now.site.name == "hall" and now.site.map_file.read_text() == there[-1]
        assert not now.sites.make("default").map_file.exists()
