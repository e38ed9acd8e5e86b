"""The site in use gets another name or dock, and keeps what belongs to it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import pytest

from app.storage.site_store import SiteStore
from navcore.errors import Refused, StorageFailed
from navcore.geometry.transform import Pose2
from tests.app.console.site.desk import SQUARE, Desk, points_in
from web.interface.sites import SiteChanges


def test_the_site_in_use_is_renamed_with_its_map(desk: Desk) -> None:
    with desk.ticking():
        desk.sites.export("default")
        desk.sites.change("default", SiteChanges(name="Ward 3"))
        desk.sites.export("Ward 3")
    assert desk.sites.chosen == "Ward 3"
    assert points_in(desk.store.site) > 10
    desk.zones.add(SQUARE)
    assert len(desk.store.sites.open("Ward 3").zones()) == 1


@pytest.mark.parametrize("name", ["default", "hall"])
def test_a_name_and_a_dock_are_stored_together_or_not_at_all(
    desk: Desk, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    def fail(*_: object) -> None:
        raise StorageFailed("the disk is full")

    changes = SiteChanges(name="Ward 3", dock=Pose2(x_m=1.0, y_m=0.0, yaw_rad=0.0))
    with monkeypatch.context() as broken:
        broken.setattr(SiteStore, "save_document", fail)
        with pytest.raises(StorageFailed, match="disk is full"):
            desk.sites.change(name, changes)
    assert sorted(site.name for site in desk.sites.all()) == ["default", "hall"]
    assert desk.sites.chosen == "default"
    changed = desk.sites.change(name, changes)
    assert (changed.name, changed.dock) == ("Ward 3", changes.dock)


def test_what_can_be_undone_and_what_is_not_stored_yet_survive_a_new_name(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise StorageFailed("the disk is full")

    desk.zones.add_all([SQUARE])
    with monkeypatch.context() as broken:
        broken.setattr(desk.store.site, "change_zones", fail)
        desk.zones.move(lambda zone: dataclasses.replace(zone, margin_m=0.5))
    with desk.ticking():
        desk.sites.change("default", SiteChanges(name="Ward 3"))
    desk.zones.add(dataclasses.replace(SQUARE, name="dry"))
    stored = desk.store.sites.open("Ward 3").zones()
    assert [(one.name, one.margin_m) for one in stored] == [("wet", 0.5), ("dry", 0.0)]
    desk.zones.undo()
    desk.zones.undo()
    assert desk.store.sites.open("Ward 3").zones() == ()


def test_a_site_is_renamed_while_its_map_is_still_being_opened(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as waiting:
        waiting.setattr(
            desk.controller, "enter_site", lambda edit, replace_map: later.append(replace_map)
        )
        later: list[Callable[[], None]] = []
        with desk.ticking():
            desk.sites.choose("hall")
    desk.sites.change("hall", SiteChanges(name="Ward 3"))
    later[0]()
    with desk.ticking():
        desk.sites.export("Ward 3")
    assert points_in(desk.store.sites.open("Ward 3")) > 10


def test_the_site_in_use_is_not_deleted(desk: Desk) -> None:
    with pytest.raises(Refused, match="choose another"):
        desk.sites.delete("default")
    desk.sites.delete("hall")
    assert [site.name for site in desk.sites.all()] == ["default"]
