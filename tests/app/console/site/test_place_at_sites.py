"""Where the robot is looked for when it enters a site."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.console.site.sites import last_place_of
from navcore.errors import StorageFailed
from navcore.geometry.transform import Pose2
from navcore.navigator import Navigator
from tests.app.console.site.desk import FRAMES, Desk
from web.interface.sites import SiteChanges


def test_the_place_of_the_robot_comes_back_unless_it_was_not_known(desk: Desk) -> None:
    assert last_place_of(desk.store.site) is None
    desk.sites.keep_session()
    here = desk.controller.place.T_map_base
    assert last_place_of(desk.store.site) == here
    localisation = desk.controller.navigator.localisation
    there = Pose2(x_m=here.x_m + 1.0, y_m=here.y_m, yaw_rad=here.yaw_rad)
    desk.controller.navigator.place_robot(there, np.eye(3) * 1e-4, FRAMES[0])
    desk.tick()
    localisation.search(0)
    desk.tick()
    assert not desk.controller.place.is_known
    desk.sites.keep_session()
    assert last_place_of(desk.store.site) == here
    assert last_place_of(desk.store.sites.open("hall")) is None


def test_a_robot_that_was_just_switched_on_keeps_its_last_place_until_it_sees(
    tmp_path: Path,
) -> None:
    before = Desk(tmp_path)
    before.pose = Pose2(x_m=1.0, y_m=0.5, yaw_rad=0.2)
    before.tick()
    before.sites.keep_session()
    last = last_place_of(before.store.site)
    before.store.close()
    after = Desk(tmp_path)
    with closing(after.store):
        after.sites.keep_session()
        assert last is not None and last_place_of(after.store.site) == last


def test_a_place_on_trial_does_not_replace_the_last_known_one(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Navigator, "held_map", object())
    desk.sites.keep_session()
    assert last_place_of(desk.store.site) is None
    monkeypatch.undo()
    desk.sites.keep_session()
    assert last_place_of(desk.store.site) == desk.controller.place.T_map_base


def test_the_place_on_the_old_map_is_never_kept_for_the_new_site(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    entered, enter = desk.store.sites.open("hall"), desk.controller.enter_site

    def entering(edit: Any, replace_map: Callable[[], None]) -> None:
        def replace_and_keep() -> None:
            desk.sites.keep_session()
            replace_map()
            desk.sites.keep_session()

        enter(edit, replace_and_keep)

    monkeypatch.setattr(desk.controller, "enter_site", entering)
    assert desk.controller.place.is_known
    desk.choose("hall")
    assert last_place_of(entered) is None
    desk.sites.keep_session()
    assert last_place_of(entered) == desk.controller.place.T_map_base


def test_the_place_is_not_that_on_the_old_map_where_the_new_one_comes_in_while_it_is_looked_at(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    replaced: list[Callable[[], None]] = []
    with monkeypatch.context() as waiting:
        waiting.setattr(desk.controller, "enter_site", lambda edit, now: replaced.append(now))
        with desk.ticking():
            desk.sites.choose("hall")
    hall, save = desk.store.site, desk.store.site.save_document

    def enter_meanwhile(kind: str, name: str, value: Any) -> None:
        save(kind, name, value)
        while replaced:
            replaced.pop()()

    monkeypatch.setattr(hall, "save_document", enter_meanwhile)
    desk.controller.change_mission(lambda mission: mission.repeat(True))
    desk.sites.keep_session()
    assert not replaced and last_place_of(hall) is None


def test_a_place_that_could_not_be_stored_is_stored_when_there_is_room_again(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise StorageFailed("the disk is full")

    desk.sites.keep_session()
    navigator, there = desk.controller.navigator, Pose2(x_m=3.0, y_m=1.0, yaw_rad=0.5)
    navigator.place = dataclasses.replace(navigator.place, T_map_base=there)
    with monkeypatch.context() as full, pytest.raises(StorageFailed):
        full.setattr(desk.store.site, "save_document", fail)
        desk.sites.keep_session()
    desk.sites.keep_session()
    assert last_place_of(desk.store.site) == there


def test_a_robot_that_comes_back_is_looked_for_where_its_wheels_have_brought_it(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    navigator, expected = desk.controller.navigator, []
    adopt = navigator.adopt_map

    def adopting(last: Pose2 | None = None, **kept: Any) -> None:
        expected.append(last)
        adopt(last, **kept)

    monkeypatch.setattr(navigator, "adopt_map", adopting)
    desk.sites.keep_session()
    left = desk.controller.place.T_map_base
    desk.choose("hall")
    turned = Pose2(x_m=0.2, y_m=0.1, yaw_rad=2.0)
    desk.pose = desk.pose @ turned
    desk.tick()
    desk.choose("default")
    assert expected[0] is None  # never was at the other site
    there, found = left @ turned, expected[1]
    assert found is not None and found.distance_to(there.x_m, there.y_m) < 0.01
    assert found.yaw_rad == pytest.approx(there.yaw_rad, abs=0.01)


def test_the_gyros_drift_at_standstill_does_not_turn_a_robot_that_comes_back(desk: Desk) -> None:
    left = desk.controller.place.T_map_base
    desk.choose("hall")
    for _ in range(30):
        desk.pose = desk.pose @ Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0015)
        desk.tick()
    expected, kept = desk.sites._expected_place(desk.store.sites.open("default"))
    assert kept is not None and expected is not None
    assert expected.yaw_rad == pytest.approx(left.yaw_rad, abs=1e-6)


@pytest.mark.parametrize("again", ["deleted", "renamed"])
def test_the_place_at_a_site_is_not_taken_for_that_at_another_one_of_its_name(
    desk: Desk, monkeypatch: pytest.MonkeyPatch, again: str
) -> None:
    navigator, kept = desk.controller.navigator, []
    adopt = navigator.adopt_map

    def adopting(last: Pose2 | None = None, **given: Any) -> None:
        kept.append(given["kept"])
        adopt(last, **given)

    monkeypatch.setattr(navigator, "adopt_map", adopting)
    desk.choose("hall")
    if again == "deleted":
        desk.sites.delete("default")
    else:
        desk.sites.change("default", SiteChanges(name="ward"))
    desk.sites.make("default")
    desk.choose("default")
    assert kept == [None, None], "of the other site of this name nothing is known"
    desk.choose("hall")
    assert kept[2] is not None
    if again == "renamed":
        desk.choose("ward")
        assert kept[3] is not None, "it goes on under its new name"


@pytest.mark.parametrize("on_trial", [True, False])
def test_the_place_at_which_a_robot_has_left_a_site_on_trial_does_not_hold_when_it_comes_back(
    desk: Desk, on_trial: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    desk.sites.keep_session()
    navigator, there = desk.controller.navigator, Pose2(x_m=3.0, y_m=1.0, yaw_rad=0.5)
    navigator.place_robot(there, np.eye(3) * 1e-4, FRAMES[0])
    desk.tick()
    with monkeypatch.context() as leaving:
        leaving.setattr(Navigator, "held_map", object() if on_trial else None)
        desk.choose("hall")
    expected, kept = desk.sites._expected_place(desk.store.sites.open("default"))
    assert (kept is None) is on_trial
    assert expected is not None and expected.distance_to(there.x_m, there.y_m) < 0.05
