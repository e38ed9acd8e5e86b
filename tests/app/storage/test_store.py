"""An acknowledged write is stored; a refused one changes nothing."""

from __future__ import annotations

import json
import math
import sqlite3
from datetime import datetime, timedelta, timezone
from pathlib import Path

import pytest

from app.storage import Store
from navcore.errors import NotKnown, StorageFailed
from navcore.mission.beware_list import default_beware_list
from navcore.mission.zone import Zone

SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.1 + 0.2, 1 / 3))


def zone(number: int, **changes: object) -> Zone:
    return Zone(**{"id": f"z{number}", "name": f"zone {number}", "polygon": SQUARE, **changes})  # type: ignore[arg-type]


def test_zones_come_back_exactly_and_in_order(tmp_path: Path) -> None:
    stored = (zone(2, enabled=False), zone(1, margin_m=0.25, version=7))
    store = Store(tmp_path)
    for one in stored:
        store.site.save_zone(one)
    store.close()
    store = Store(tmp_path)
    assert store.site.zones() == stored
    store.site.save_zone(zone(2, name="renamed", version=2))
    assert [one.name for one in store.site.zones()] == ["renamed", "zone 1"]
    store.site.change_zones([], ["z2"])
    assert store.site.zones() == stored[1:]
    store.close()


def test_the_beware_list_comes_back_with_its_version(tmp_path: Path) -> None:
    store = Store(tmp_path)
    assert store.site.beware() is None
    edited = default_beware_list().edited("cup", enabled=False, margin_m=0.3)
    edited = edited.replaced(entry for entry in edited.classes if entry.name != "spill")
    assert edited.retired == (("spill", 9),)
    store.site.save_beware(edited)
    store.close()
    store = Store(tmp_path)
    assert store.site.beware() == edited
    store.close()


def test_runs_are_listed_newest_first_and_an_unknown_one_is_named(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.save_run({"id": "a", "distance_m": 1.5, "series": {"t_s": [0.0, 1.0]}})
    store.save_run({"id": "b"})
    assert [run["id"] for run in store.runs()] == ["b", "a"]
    assert store.runs()[1] == {"id": "a", "distance_m": 1.5}
    store.save_run({"id": "c", "min_clearance_m": math.inf, "series": {}})
    assert store.runs()[0] == {"id": "c", "min_clearance_m": math.inf}
    assert store.run("a")["series"] == {"t_s": [0.0, 1.0]}
    with pytest.raises(NotKnown, match="'x'"):
        store.run("x")
    store.close()


def test_a_locked_database_refuses_the_save_and_keeps_what_was_stored(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.site.save_zone(zone(1))
    other = sqlite3.connect(store.path, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    with pytest.raises(StorageFailed, match="not saved"):
        store.site.save_zone(zone(2))
    assert [one.id for one in store.site.zones()] == ["z1"]
    other.execute("ROLLBACK")
    other.close()
    store.site.save_zone(zone(2))
    assert [one.id for one in store.site.zones()] == ["z1", "z2"]
    store.close()


def test_a_folder_serves_one_console_at_a_time(tmp_path: Path) -> None:
    store = Store(tmp_path)
    with pytest.raises(StorageFailed, match="another console"):
        Store(tmp_path)
    store.close()
    Store(tmp_path).close()


def test_a_data_folder_that_is_a_file_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageFailed, match="file"):
        Store(tmp_path / "file")


def test_polygons_are_stored_as_plain_json(tmp_path: Path) -> None:
    """Nothing that is read back could be executed."""
    store = Store(tmp_path)
    store.site.save_zone(zone(1))
    store.close()
    database = sqlite3.connect(tmp_path / "console.sqlite")
    (stored,) = database.execute("SELECT zone FROM zones").fetchone()
    database.close()
    assert json.loads(stored)["polygon"] == [list(corner) for corner in SQUARE]


@pytest.mark.parametrize("shift", [14, -14])
def test_a_time_that_utc_cannot_name_bounds_the_audit_log(tmp_path: Path, shift: int) -> None:
    store, zone_of_time = Store(tmp_path), timezone(timedelta(hours=shift))
    number = store.audit.add({"who": "vera"})
    since = datetime.min.replace(tzinfo=zone_of_time)
    until = datetime.max.replace(tzinfo=zone_of_time)
    assert [entry["id"] for entry in store.audit.newest(since=since, until=until)] == [number]
    assert store.audit.newest(until=since) == store.audit.newest(since=until) == ()
    store.close()
