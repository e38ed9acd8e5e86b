"""A change of site: each has its own map, zones and mission, and nothing is lost on the way."""

from __future__ import annotations

import contextvars
import dataclasses
import threading
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from app.console.site.sites import LiveSites, mission_of
from app.runtime.record.map_keeper import MapKeeper
from navcore.config.mapping import MappingConfig
from navcore.errors import BadConfiguration, OtherSite, Outdated, Refused, StorageFailed
from navcore.grid.cell_mask import CellMask
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.erasing import Erasable
from navcore.mapping.storage import map_file
from navcore.mission.mission import Phase
from tests.app.console.site.desk import SECOND, SQUARE, Desk, points_in
from tests.app.runtime.record.test_map_persistence import observe_scene
from tests.navcore.scene import RED_LIST, SPEC, Paint
from web.interface.meant_site import mean_site
from web.interface.sites import SiteChanges, Tag


def test_each_site_has_its_map_and_its_zones_and_gets_them_back(desk: Desk) -> None:
    (zone,) = desk.zones.add_all([SQUARE])
    seen = desk.points
    assert seen > 10
    version = desk.controller.intent.beware.version
    desk.choose("hall")
    assert desk.sites.chosen == "hall" and not desk.zones.stored
    assert desk.controller.intent.beware.version > version
    assert points_in(desk.store.sites.open("default")) >= 0.9 * seen
    default_map = desk.store.sites.open("default").map_file.read_bytes()
    desk.choose("default")
    assert desk.zones.stored == (zone,)
    assert desk.store.sites.open("default").map_file.read_bytes() == default_map
    assert points_in(desk.store.sites.open("hall")) > 10


def test_what_was_erased_while_a_tick_ran_is_not_in_the_map_that_is_kept(desk: Desk) -> None:
    everywhere = np.arange(SPEC.rows * SPEC.cols)
    point_map, posted = desk.controller.navigator.map, list[Callable[[PointMap], None]]()
    # The tick has taken what was asked for before.

    def erase(held: PointMap) -> None:
        held.edits.erase(everywhere, Erasable.BOTH.class_ids)

    posted.append(erase)
    keeps = threading.Thread(target=lambda: desk.keeper.write_now(posted.append))
    keeps.start()
    while len(posted) < 2:
        time.sleep(0.001)
    desk.keeper.note_tick(point_map, RED_LIST.names, SECOND)
    for edit in posted:
        edit(point_map)
    desk.keeper.note_tick(point_map, RED_LIST.names, 2 * SECOND)
    keeps.join(30.0)
    assert points_in(desk.store.site) == 0 and not keeps.is_alive()


def test_the_map_of_the_new_site_replaces_the_old_one_before_the_next_tick(desk: Desk) -> None:
    marked = PointMap(SPEC, MappingConfig()).state()
    prior = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    prior[3, 3] = True
    state = dataclasses.replace(marked, prior=CellMask.of(prior))
    hall = desk.store.sites.open("hall")
    hall.folder.mkdir(parents=True)
    map_file.save(hall.map_file, state, RED_LIST.names)
    desk.choose("hall")
    held = desk.controller.navigator.map.layers.prior
    assert held is not None and held.bools[3, 3]
    decision = desk.controller.tick_state.decision
    assert decision is not None and decision.occupancy.grid.geometric[3, 3]


def test_a_request_that_is_meant_for_the_site_changes_it_and_then_edits_it_no_more(
    desk: Desk,
) -> None:
    desk.zones.add(SQUARE)
    here = desk.sites.chosen_id

    def ask() -> None:
        mean_site(lambda: desk.sites.chosen_id == here)
        desk.zones.add(SQUARE)
        desk.choose("hall")
        with pytest.raises(OtherSite):
            desk.zones.add(SQUARE)

    contextvars.copy_context().run(ask)
    desk.zones.add(SQUARE)
    assert [len(desk.store.sites.open(name).zones()) for name in ("default", "hall")] == [2, 1]


def test_a_driving_robot_stays_at_its_site(desk: Desk) -> None:
    desk.controller.change_mission(lambda mission: mission.add(0.0, 3.0, SPEC).start())
    with pytest.raises(Refused, match="mission is driving"):
        desk.sites.choose("hall")
    assert desk.sites.chosen == "default"


def test_a_mission_that_starts_in_the_meantime_is_not_moved_to_another_site(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    desk.zones.add(SQUARE)
    written = desk.keeper.write_now

    def start_meanwhile(*given: Any, **named: Any) -> None:
        written(*given, **named)
        desk.controller.change_mission(lambda mission: mission.add(0.0, 3.0, SPEC).start())

    monkeypatch.setattr(desk.keeper, "write_now", start_meanwhile)
    with desk.ticking(), pytest.raises(Refused, match="mission is driving"):
        desk.sites.choose("hall")
    assert desk.sites.chosen == "default" and len(desk.controller.intent.zones) == 1
    desk.zones.add(SQUARE)  # edits go on
    assert max(desk.store.sites.all(), key=lambda row: row.chosen).name == "default"
    with desk.ticking():
        desk.sites.change("default", SiteChanges(name="Ward 3"))
    desk.zones.add(SQUARE)
    assert len(desk.store.sites.open("Ward 3").zones()) == 3


def test_what_an_operator_was_told_is_stored_in_the_last_moment_is_at_the_site_that_is_left(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    enter, written = desk.controller.enter_site, desk.keeper.write_now

    def add_goal(*given: Any) -> None:
        desk.controller.change_mission(lambda mission: mission.add(0.0, 3.0, SPEC))
        enter(*given)

    def write_while_edits_wait(*given: Any, **named: Any) -> None:
        def edit() -> None:
            with pytest.raises(Refused, match="another site"):
                desk.beware.edit(desk.beware.list.classes[0].name, {"enabled": False})

        desk.zones.add(SQUARE)  # a tick may have to move the zones
        late.append(threading.Thread(target=edit))
        late[0].start()
        written(*given, **named)
        late[0].join(0.05)
        assert late[0].is_alive()

    late: list[threading.Thread] = []
    monkeypatch.setattr(desk.controller, "enter_site", add_goal)
    monkeypatch.setattr(desk.keeper, "write_now", write_while_edits_wait)
    desk.choose("hall")
    late[0].join(30.0)
    assert not late[0].is_alive()
    left = desk.store.sites.open("default")
    assert [goal.y_m for goal in mission_of(left).queue] == [3.0] and len(left.zones()) == 1
    assert desk.controller.intent.mission.queue == ()


def test_a_disk_that_fails_on_the_way_back_leaves_the_robot_at_its_site(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise StorageFailed("the disk is full")

    with monkeypatch.context() as broken:

        def refuse(*_: object) -> None:
            broken.setattr(desk.store._database, "write", fail)
            raise Refused("the robot moves")

        broken.setattr(desk.controller, "enter_site", refuse)
        with desk.ticking(), pytest.raises(StorageFailed):
            desk.sites.choose("hall")
    assert desk.sites.chosen == "default"
    with desk.ticking():
        desk.sites.change("default", SiteChanges(name="Ward 3"))
    assert desk.sites.chosen == "Ward 3"


def test_an_edit_that_comes_too_late_is_refused_and_stored_nowhere(desk: Desk) -> None:
    zones, beware = desk.zones, desk.beware
    desk.choose("hall")
    with pytest.raises(Refused, match="another site now"):
        zones.add(SQUARE)
    with pytest.raises(Refused, match="another site now"):
        beware.edit("red floor", {"enabled": False})
    for name in ("default", "hall"):
        site = desk.store.sites.open(name)
        assert site.zones() == () and site.beware() == RED_LIST
    assert desk.controller.intent.zones == ()


def test_a_site_with_a_damaged_map_is_refused_and_nothing_changes(desk: Desk) -> None:
    hall = desk.store.sites.open("hall")
    hall.folder.mkdir(parents=True)
    hall.map_file.write_bytes(b"no map")
    with desk.ticking(), pytest.raises(BadConfiguration, match="no map file"):
        desk.sites.choose("hall")
    assert desk.sites.chosen == "default"


def test_a_map_in_a_file_of_its_own_holds_the_robot_at_its_site(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    with closing(desk.store):
        own = LiveSites(
            desk.store,
            controller=desk.controller,
            view=desk,
            keeper=desk.keeper,
            user=desk,
            config=MappingConfig(),
            world="hall",
            has_own_map=False,
        )
        own.make("hall")
        with pytest.raises(Refused, match="--map"):
            own.choose("hall")


def test_goals_and_mission_come_back_paused(desk: Desk) -> None:
    drive = desk.controller.change_mission(
        lambda mission: mission.add(0.0, 3.0, SPEC, name="a").add(1.0, 4.0, SPEC).repeat(True)
    )
    desk.controller.change_mission(lambda mission: mission.start())
    desk.sites.keep_session()
    back = mission_of(desk.store.site)
    assert (back.queue, back.loop, back.phase, back.restored) == (
        drive.queue,
        True,
        Phase.PAUSED,
        True,
    )
    assert not back.resume().restored and not back.cancel().restored
    desk.controller.change_mission(lambda mission: mission.cancel())
    desk.sites.keep_session()
    assert mission_of(desk.store.site).queue == ()
    desk.controller.change_mission(lambda mission: mission.add(0.0, 3.0, SPEC))
    desk.sites.keep_session()
    waiting = mission_of(desk.store.site)
    assert (waiting.phase, waiting.restored) == (Phase.IDLE, True)


def test_a_site_is_compared_with_its_own_map_and_never_with_that_of_the_site_before(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    def newest() -> Any:
        decision = desk.controller.tick_state.decision
        assert decision is not None
        grid = decision.occupancy.grid
        return SimpleNamespace(grid=grid, seen=np.ones_like(grid.geometric))

    monkeypatch.setattr(desk, "picture", newest())
    assert not desk.sites.changes().accepted
    desk.choose("hall")
    with pytest.raises(Refused, match="no map yet"):
        desk.sites.changes()
    monkeypatch.setattr(desk, "picture", newest())
    assert desk.sites.accept(None, ()).accepted


def test_without_a_tick_a_site_is_not_left(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.runtime.record.map_keeper.SNAPSHOT_WAIT_S", 0.01)
    with pytest.raises(Refused, match="delivers no image"):
        desk.sites.choose("hall")
    assert desk.sites.chosen == "default"


def test_a_listing_that_is_not_held_is_outdated(desk: Desk) -> None:
    with pytest.raises(Outdated, match="list the changes again"):
        desk.sites.accept(7, [0])
    with pytest.raises(Refused, match="no map yet"):
        desk.sites.changes()


def test_a_map_is_copied_when_it_has_changed_and_written_in_the_other_thread(
    tmp_path: Path,
) -> None:
    point_map, path = PointMap(SPEC, MappingConfig()), tmp_path / "site" / "map.npz"
    keeper = MapKeeper(path, {9: "spill"})
    for now_s in (1, 2, 6):
        keeper.note_tick(point_map, RED_LIST.names, now_s * SECOND)
        assert not path.exists()
    keeper.finish(point_map, RED_LIST.names)
    stored = map_file.load(path)
    assert stored.class_names == {9: "spill", **RED_LIST.names}


def test_a_map_on_trial_is_written_without_what_may_be_taken_back(tmp_path: Path) -> None:
    point_map, path = PointMap(SPEC, MappingConfig()), tmp_path / "map.npz"
    keeper, held = MapKeeper(path, {}), point_map.state()
    observe_scene(point_map, Paint(x=(1.5, 2.0), y=(-0.3, 0.3)))

    def stored() -> int:
        keeper._write()
        return len(map_file.load(path).state.points.pose_ids)

    keeper.note_tick(point_map, RED_LIST.names, SECOND, held=held)
    assert stored() == 0
    path.unlink()
    keeper.note_tick(point_map, RED_LIST.names, 10 * SECOND, held=held)
    keeper._write()
    assert not path.exists(), "the same map is not written again"
    keeper.finish(point_map, RED_LIST.names, held)
    assert stored() == 0
    keeper.note_tick(point_map, RED_LIST.names, 20 * SECOND)
    assert stored() == len(point_map.points.pose_ids) > 0
    keeper.note_tick(point_map, RED_LIST.names, 30 * SECOND, held=point_map.checkpoint().state)
    assert stored() > 0


def test_the_robot_is_told_of_the_tags_of_the_site_it_is_at(desk: Desk) -> None:
    def known() -> dict[int, tuple[float, float]]:
        tags = desk.controller.navigator.localisation.tags.tags
        return {number: (tag.pose.x_m, tag.pose.y_m) for number, tag in tags.items()}

    assert known() == {}
    tag = Tag(id=7, x_m=1.0, y_m=-2.0, z_m=0.6, yaw_rad=0.5, size_m=0.3)
    desk.sites.put_tag("default", tag)
    assert known() == {7: (1.0, -2.0)}
    desk.choose("hall")
    assert known() == {}


def test_the_first_tick_at_a_site_is_told_of_its_tags(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    enter, told, ticked = desk.controller.enter_site, list[list[int]](), threading.Event()
    tag = Tag(id=7, x_m=1.0, y_m=-2.0, z_m=0.6, yaw_rad=0.5, size_m=0.3)
    desk.sites.put_tag("default", tag)
    desk.sites.put_tag("hall", dataclasses.replace(tag, id=8))

    def enter_and_tick(edit: Any, replace_map: Callable[[], None]) -> None:
        def replaced() -> None:
            replace_map()
            told.append(list(desk.controller.navigator.localisation.tags.tags))
            ticked.set()

        enter(edit, replaced)
        assert ticked.wait(30.0)

    monkeypatch.setattr(desk.controller, "enter_site", enter_and_tick)
    desk.choose("hall")
    assert told == [[8]]


def test_the_folder_of_a_site_that_is_left_and_deleted_does_not_come_back(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    enter, left = desk.controller.enter_site, desk.store.site.folder

    def enter_after_more_ticks(*given: Any) -> None:
        desk.keeper._copied = desk.keeper._looked_ns = None  # the map has changed
        desk.keeper.note_tick(desk.controller.navigator.map, RED_LIST.names, 10**12)
        enter(*given)

    monkeypatch.setattr(desk.controller, "enter_site", enter_after_more_ticks)
    desk.choose("hall")
    desk.sites.delete("default")
    desk.keeper._write()
    assert not left.exists()
    desk.keeper.finish(desk.controller.navigator.map, RED_LIST.names)
    assert desk.store.site.map_file.exists(), "the map of the new site is kept"


def test_the_map_is_kept_on_where_the_site_could_not_be_changed(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise Refused("the robot moves")

    monkeypatch.setattr(desk.controller, "enter_site", refuse)
    before = desk.store.sites.all()
    with desk.ticking(), pytest.raises(Refused):
        desk.sites.choose("hall")
    assert desk.store.sites.all() == before, "it is not taken for one of this world"
    desk.store.site.map_file.unlink()
    desk.keeper.finish(desk.controller.navigator.map, RED_LIST.names)
    assert desk.store.site.map_file.exists()


def test_a_site_gets_the_list_of_the_world_when_it_is_first_used(desk: Desk) -> None:
    desk.sites._new_beware = listed = RED_LIST.edited("red floor", margin_m=0.7)
    desk.sites.make("ward")
    desk.choose("ward")
    assert desk.store.site.beware() == listed
    assert desk.controller.intent.beware.classes == listed.classes
    desk.sites._new_beware = RED_LIST
    desk.choose("default")
    desk.choose("ward")
    assert desk.store.site.beware() == listed
