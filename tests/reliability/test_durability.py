"""What was acknowledged survives kills, disks that refuse and new layouts; names, journals and
users keep their rules."""

from __future__ import annotations

import dataclasses
import json
import sqlite3
from contextlib import closing, nullcontext
from pathlib import Path

import pytest

from app.storage import Store
from app.storage.schema import STEPS
from navcore.errors import NotKnown, Refused, StorageFailed
from navcore.mission.beware_list import as_table, default_beware_list
from navcore.mission.zone import Zone
from tests.app.storage.test_store import SQUARE, zone
from tests.reliability import storage as keeping_figures
from tests.reliability.storage import kills, refusing_disks
from web.access.roles import Role
from web.access.users import User


def test_no_acknowledged_zone_is_lost_when_the_process_is_killed() -> None:
    figure = kills(8)
    assert figure.met, figure.measured


def test_a_plain_file_loses_them() -> None:
    assert not kills(30, kind="file").met


def test_a_disk_that_is_full_read_only_or_locked_refuses_and_loses_nothing() -> None:
    figure = refusing_disks(3)
    assert figure.met, figure.measured


def test_a_disk_without_trouble_refuses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """The control of the test above."""
    monkeypatch.setattr(keeping_figures, "_troubled", lambda store, number: nullcontext())
    assert not refusing_disks(1).met


FIRST_LAYOUT = """
CREATE TABLE zones (id TEXT PRIMARY KEY, name TEXT NOT NULL, polygon TEXT NOT NULL, enabled INTEGER NOT NULL,
    margin_m REAL NOT NULL, version INTEGER NOT NULL) STRICT;
CREATE TABLE beware (only INTEGER PRIMARY KEY CHECK (only = 1), list TEXT NOT NULL) STRICT;
CREATE TABLE runs (id TEXT PRIMARY KEY, report TEXT NOT NULL) STRICT;
"""


def test_a_file_of_the_first_layout_is_read_and_brought_to_the_present_one(tmp_path: Path) -> None:
    edited = default_beware_list().edited("cup", enabled=False)
    document = json.dumps(
        {"version": edited.version, "classes": [as_table(entry) for entry in edited.classes]}
    )
    with closing(sqlite3.connect(tmp_path / "console.sqlite", isolation_level=None)) as old:
        old.executescript(FIRST_LAYOUT)
        old.execute("INSERT INTO zones VALUES ('b', 'floor', ?, 0, 0.3, 4)", (json.dumps(SQUARE),))
        old.execute("INSERT INTO zones VALUES ('a', 'desk', ?, 1, 0.1, 1)", (json.dumps(SQUARE),))
        old.execute("INSERT INTO beware VALUES (1, ?)", (document,))
        old.execute("INSERT INTO runs VALUES ('r', '{\"id\": \"r\"}')")
    for _ in range(2):
        store = Store(tmp_path)
        assert store.zones() == (
            Zone(id="b", name="floor", polygon=SQUARE, enabled=False, margin_m=0.3, version=4),
            Zone(id="a", name="desk", polygon=SQUARE, margin_m=0.1),
        )
        assert store.beware() == edited and store.run("r") == {"id": "r"}
        store.close()
    with closing(sqlite3.connect(tmp_path / "console.sqlite")) as new:
        assert new.execute("PRAGMA user_version").fetchone() == (len(STEPS),)


def test_a_file_of_a_later_version_is_refused_and_left_alone(tmp_path: Path) -> None:
    Store(tmp_path).close()
    with closing(sqlite3.connect(tmp_path / "console.sqlite")) as later:
        later.execute("PRAGMA user_version = 999")
    with pytest.raises(StorageFailed, match="later version"):
        Store(tmp_path)


def test_every_beware_list_is_kept(tmp_path: Path) -> None:
    store = Store(tmp_path)
    first = default_beware_list().edited("cup", enabled=False)
    second = first.edited("book", margin_m=0.2)
    for edited in (first, second):
        store.save_beware(edited)
    assert store.beware_versions() == (second, first)
    store.close()


def test_what_is_kept_under_a_name_is_there_again_and_kinds_do_not_mix(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.keep("zone set", "night", [1])
    store.keep("mission", "night", {"goals": []})
    store.keep("zone set", "night", [2])
    store.keep("zone set", "day", [3])
    store.close()
    store = Store(tmp_path)
    assert store.kept("zone set") == {"day": [3], "night": [2]}
    store.keep("zone set", "night", None)
    assert store.kept("zone set") == {"day": [3]}
    assert store.kept("mission") == {"night": {"goals": []}}
    store.close()


def test_several_zones_change_as_one_step(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.save_zone(zone(1))
    store.change_zones([zone(3), zone(2)], [zone(1).id])
    assert store.zones() == (zone(3), zone(2))
    broken = dataclasses.replace(zone(4), name=object())  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        store.change_zones([zone(5), broken], [zone(3).id])
    assert store.zones() == (zone(3), zone(2))
    store.close()


def test_a_journal_gives_the_newest_first_and_goes_on_where_it_ended(tmp_path: Path) -> None:
    store = Store(tmp_path)
    for number in range(5):
        store.audit.add({"who": "anna", "number": number})
    newest = store.audit.newest(2)
    assert [entry["number"] for entry in newest] == [4, 3] and newest[0]["at"].endswith("+00:00")
    assert [entry["number"] for entry in store.audit.newest(9, before=newest[-1]["id"])] == [
        2,
        1,
        0,
    ]
    store.close()


def test_there_is_always_an_admin(tmp_path: Path) -> None:
    store = Store(tmp_path)
    admin = User(name="admin", role=Role.ADMIN, password_hash="-")
    store.users.add(admin)
    with pytest.raises(Refused, match="already"):
        store.users.add(admin)
    with pytest.raises(Refused, match="last admin"):
        store.users.remove("admin")
    with pytest.raises(Refused, match="last admin"):
        store.users.change(admin.name, role=Role.VIEWER)
    assert store.users.all() == (admin,)
    with pytest.raises(NotKnown):
        store.users.remove("nobody")
    store.close()
