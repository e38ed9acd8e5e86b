"""The site in use: another one is entered as a whole, or not at all."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from app.console.mission.zone_editor import ZoneEditor
from app.console.site.sites import LiveSites, last_place_of, mission_of
from app.runtime.control.operator_state import OperatorState
from app.runtime.control.robot_controller import RobotController
from app.runtime.record.map_keeper import MapKeeper
from app.storage import Store
from app.storage.site_store import SiteStore
from navcore.config.mapping import MappingConfig
from navcore.config.navigator import NavigatorConfig
from navcore.errors import BadConfiguration, Outdated, Refused, StorageFailed
from navcore.geometry.transform import Pose2
from navcore.grid.cell_mask import CellMask
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.erasing import Erasable
from navcore.mapping.storage import map_file
from navcore.mission.mission import Mission, Phase
from navcore.navigator import Navigator
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.robot.profile import HUSKY
from tests.app.console.state import beware_editor
from tests.navcore.scene import RED_LIST, SPEC, Paint, picture
from web.interface.drafts import ZoneDraft
from web.interface.sites import SiteChanges, Tag
from web.interface.snapshots import TickSnapshot

SECOND = 1_000_000_000
FRAMES = [picture(Paint(x=(1.5, 2.0), y=(-0.3, 0.3)), stamp_ns=n * SECOND) for n in (1, 2)]
SQUARE = ZoneDraft(name="wet", polygon=((0.0, 4.0), (1.0, 4.0), (1.0, 5.0)))


class Desk:
    """A robot that is ticked by hand, with its store, its editors and its sites."""

    picture: TickSnapshot | None = None
    pose = FRAMES[0].pose
    """T_odom_base of the next tick."""

    def __init__(self, folder: Path) -> None:
        self.store = Store(folder)
        self.store.site.save_beware(RED_LIST)
        navigator = Navigator(
            spec=SPEC, profile=HUSKY, segmenter=ColourSegmenter(), config=NavigatorConfig()
        )
        intent = OperatorState(mission=Mission(), beware=RED_LIST)
        self.controller = RobotController(navigator=navigator, profile=HUSKY, intent=intent)
        self.keeper = MapKeeper(self.store.site.map_file, {})
        self.enter_site(self.store.site)
        self.sites = LiveSites(
            self.store,
            controller=self.controller,
            view=self,
            keeper=self.keeper,
            user=self,
            config=MappingConfig(),
            world="hall",
        )
        self._ticks = 0

    @contextmanager
    def leaving_site(self, keep_map: Callable[[], None]) -> Iterator[None]:
        """Hold the edits, those of the zones once the map is kept."""
        with self.beware.retired():
            keep_map()
            with self.zones.retired():
                yield

    @contextmanager
    def holding_edits(self) -> Iterator[None]:
        """Hold the edits."""
        with self.beware.held(), self.zones.held():
            yield

    def enter_site(self, site: SiteStore) -> None:
        """Edit another site."""
        self.zones = ZoneEditor(self.controller, store=site)
        self.beware = beware_editor(site, holder=self.controller)

    def tick(self) -> None:
        """Run one tick as the think thread does."""
        self._ticks += 1
        frame = dataclasses.replace(FRAMES[0], pose=self.pose, stamp_ns=self._ticks * SECOND)
        self.controller.trust_pose()
        self.controller.think(frame, clock=lambda: frame.stamp_ns)
        self.keeper.note_tick(self.controller.navigator.map, RED_LIST.names, frame.stamp_ns)

    @contextmanager
    def ticking(self) -> Iterator[None]:
        """Tick in a thread during the block."""
        ended = threading.Event()

        def run() -> None:
            while not ended.is_set():
                self.tick()

        thread = threading.Thread(target=run)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()

    def choose(self, name: str) -> None:
        """Enter a site, while ticks go on, and run one more."""
        with self.ticking():
            self.sites.choose(name)
        self.tick()

    @property
    def points(self) -> int:
        """Number of points of the live map."""
        return len(self.controller.navigator.map.points.class_ids)


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    opened = Desk(tmp_path)
    with closing(opened.store):
        opened.tick()
        opened.sites.make("hall")
        opened.store.sites.open("hall").save_beware(RED_LIST)
        yield opened


def points_in(site: SiteStore) -> int:
    return len(map_file.load(site.map_file).state.points.class_ids)


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

    def start_meanwhile(*given: Any) -> None:
        written(*given)
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

    def write_while_edits_wait(*given: Any) -> None:
        def edit() -> None:
            with pytest.raises(Refused, match="another site"):
                desk.beware.edit(desk.beware.list.classes[0].name, {"enabled": False})

        desk.zones.add(SQUARE)  # a tick may have to move the zones
        late.append(threading.Thread(target=edit))
        late[0].start()
        written(*given)
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
    def refuse(*_: object) -> None:
        raise Refused("the robot moves")

    def fail(*_: object) -> None:
        raise StorageFailed("the disk is full")

    choose = desk.store.sites.choose
    monkeypatch.setattr(desk.controller, "enter_site", refuse)
    monkeypatch.setattr(
        desk.store.sites, "choose", lambda name, world: (choose if world else fail)(name, world)
    )
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


def test_the_site_in_use_is_renamed_with_its_map(desk: Desk) -> None:
    with desk.ticking():
        desk.sites.export("default")
        desk.sites.change("default", SiteChanges(name="Ward 3"))
        desk.sites.export("Ward 3")
    assert desk.sites.chosen == "Ward 3"
    assert not (desk.store.site.folder.parent / "default").exists()
    assert points_in(desk.store.site) > 10
    desk.zones.add(SQUARE)
    assert len(desk.store.sites.open("Ward 3").zones()) == 1


@pytest.mark.parametrize("name", ["default", "hall"])
def test_a_name_and_a_dock_are_stored_together_or_not_at_all(
    desk: Desk, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    def fail(*_: object) -> None:
        raise StorageFailed("the disk is full")

    desk.store.sites.open(name).folder.mkdir(parents=True, exist_ok=True)
    changes = SiteChanges(name="Ward 3", dock=Pose2(x_m=1.0, y_m=0.0, yaw_rad=0.0))
    with monkeypatch.context() as broken:
        broken.setattr(SiteStore, "save_document", fail)
        with pytest.raises(StorageFailed, match="disk is full"):
            desk.sites.change(name, changes)
    assert sorted(site.name for site in desk.sites.all()) == ["default", "hall"]
    assert desk.sites.chosen == "default"
    assert desk.store.sites.open(name).folder.name == name
    changed = desk.sites.change(name, changes)
    assert (changed.name, changed.dock) == ("Ward 3", changes.dock)
    assert desk.store.sites.open("Ward 3").folder.name == "Ward 3"


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


def test_a_site_in_use_whose_folder_cannot_be_renamed_goes_on_under_its_new_name(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    with desk.ticking():
        desk.sites.export("default")
        with monkeypatch.context() as broken:
            broken.setattr(Path, "rename", fail)
            assert desk.sites.change("default", SiteChanges(name="Ward 3")).name == "Ward 3"
        desk.zones.add(SQUARE)
        desk.store.site.map_file.unlink()
        desk.sites.export("Ward 3")
    assert desk.sites.chosen == "Ward 3" and points_in(desk.store.sites.open("Ward 3")) > 10
    assert len(desk.store.sites.open("Ward 3").zones()) == 1


def test_the_site_in_use_is_not_deleted(desk: Desk) -> None:
    with pytest.raises(Refused, match="choose another"):
        desk.sites.delete("default")
    desk.sites.delete("hall")
    assert [site.name for site in desk.sites.all()] == ["default"]


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
    monkeypatch.setattr(Navigator, "map_is_on_trial", True)
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
        desk.pose = desk.pose @ Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.003)
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


def test_a_map_whose_place_is_on_trial_is_not_written(tmp_path: Path) -> None:
    point_map, path = PointMap(SPEC, MappingConfig()), tmp_path / "map.npz"
    keeper = MapKeeper(path, {})
    keeper.note_tick(point_map, RED_LIST.names, SECOND, on_trial=True)
    keeper.finish(point_map, RED_LIST.names)
    assert not path.exists()
    keeper.note_tick(point_map, RED_LIST.names, 2 * SECOND)
    keeper.finish(point_map, RED_LIST.names)
    assert path.exists()


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
