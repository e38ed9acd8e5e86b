"""Acknowledged data survives kills, failing disks and new layouts; names, logs and users keep their
rules."""

from __future__ import annotations

import dataclasses
import sqlite3
from contextlib import closing, nullcontext
from pathlib import Path

import pytest

from app.storage import Store
from navcore.errors import NotKnown, Refused, StorageFailed
from navcore.mission.beware_list import default_beware_list
from tests.app.storage.test_store import zone
from tests.reliability import storage
from tests.reliability.storage import kills, refusing_disks
from web.auth.roles import Role
from web.auth.users import User, first_admin


def test_no_acknowledged_zone_is_lost_when_the_process_is_killed() -> None:
    measurement = kills(8)
    assert measurement.met, measurement.measured


def test_a_plain_file_loses_them() -> None:
    assert not kills(30, kind="file").met


def test_a_disk_that_is_full_read_only_or_locked_refuses_and_loses_nothing() -> None:
    measurement = refusing_disks(3)
    assert measurement.met, measurement.measured


def test_a_disk_without_trouble_refuses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """The control of the test above."""
    monkeypatch.setattr(storage, "_failing_disk", lambda store, number: nullcontext())
    assert not refusing_disks(1).met


@pytest.mark.parametrize("version", [0, 999])
def test_a_file_of_another_version_is_refused_by_name_and_left_alone(
    tmp_path: Path, version: int
) -> None:
    store = Store(tmp_path)
    store.site.save_zone(zone(1))
    store.close()
    file = tmp_path / "console.sqlite"
    with closing(sqlite3.connect(file)) as other:
        other.execute(f"PRAGMA user_version = {version}")
    with pytest.raises(StorageFailed, match=rf"{file} has schema version {version}.*move the file"):
        Store(tmp_path)
    with closing(sqlite3.connect(file)) as other:
        assert other.execute("PRAGMA user_version").fetchone() == (version,)
        assert other.execute("SELECT count(*) FROM zones").fetchone() == (1,)


def test_every_beware_list_is_kept(tmp_path: Path) -> None:
    store = Store(tmp_path)
    first = default_beware_list().edited("cup", enabled=False)
    second = first.edited("book", margin_m=0.2)
    for edited in (first, second):
        store.site.save_beware(edited)
    assert [one.list for one in store.site.beware_versions()] == [second, first]
    store.close()


def test_what_is_kept_under_a_name_is_there_again_and_kinds_do_not_mix(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.site.save_document("zone set", "night", [1])
    store.site.save_document("mission", "night", {"goals": []})
    store.site.save_document("zone set", "night", [2])
    store.site.save_document("zone set", "day", [3])
    store.close()
    store = Store(tmp_path)
    assert store.site.documents("zone set") == {"day": [3], "night": [2]}
    store.site.save_document("zone set", "night", None)
    assert store.site.documents("zone set") == {"day": [3]}
    assert store.site.documents("mission") == {"night": {"goals": []}}
    store.close()


def test_several_zones_change_as_one_step(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.site.save_zone(zone(1))
    store.site.change_zones([zone(3), zone(2)], [zone(1).id])
    assert store.site.zones() == (zone(3), zone(2))
    broken = dataclasses.replace(zone(4), name=object())  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        store.site.change_zones([zone(5), broken], [zone(3).id])
    assert store.site.zones() == (zone(3), zone(2))
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
        store.users.remove("stranger")
    store.close()


def test_without_an_admin_accounts_can_be_changed_and_the_console_makes_one(
    tmp_path: Path,
) -> None:
    with closing(Store(tmp_path)) as store:
        for name in ("admin", "bob"):
            store.users.add(User(name=name, role=Role.VIEWER, password_hash="-"))
        store.users.change("bob", password_hash="+")
        store.users.remove("bob")
        made = first_admin(store.users)
        assert made is not None and made[0] == "admin-2"
        assert first_admin(store.users) is None
        assert {user.name: user.role for user in store.users.all()} == {
            "admin": Role.VIEWER,
            "admin-2": Role.ADMIN,
        }
