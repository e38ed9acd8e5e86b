"""Zones and goals are where the map that is loaded has them, whatever of both was stored last."""

from __future__ import annotations

import dataclasses
import io
import json
import uuid
import zipfile
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from app.console.mission.anchored_items import AnchoredItems
from app.console.mission.saved_missions import SavedMissions
from app.console.mission.zone_editor import ZoneEditor
from app.console.site.placing import MISSION, numbered, settle
from app.console.site.site_archive import pack
from app.console.site.site_files import export_nav2
from app.console.site.sites import mission_of
from app.runtime.control.operator_state import OperatorState
from app.storage import Store
from app.storage.records import goal_record
from app.storage.site_store import SiteStore
from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.errors import StorageFailed
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.mapping.point_map import PointMap
from navcore.mapping.storage import map_file
from navcore.mapping.views.observation import observe
from navcore.mission.mission import Mission
from navcore.mission.zone import ZoneKind
from navcore.mission.zone_shapes import Circle
from navcore.perception.colour_segmenter import ColourSegmenter
from tests.navcore.mapping.points.moved_poses import move
from tests.navcore.scene import RED_LIST, SPEC, Paint, picture
from web.interface.drafts import ZoneDraft

SQUARE = ZoneDraft(name="wet", polygon=((1.0, 1.0), (2.0, 1.0), (2.0, 2.0)))
CIRCLE = Circle(centre=(1.0, -1.0), radius_m=0.5)
POST = ZoneDraft(name="post", polygon=CIRCLE.outline(), drawn=CIRCLE)
TURN_RAD = 0.1


class Holder:
    """State of the operator in memory."""

    def __init__(self) -> None:
        self.intent = OperatorState(mission=Mission(), beware=RED_LIST)

    def change(self, edit: Any) -> OperatorState:
        """Edit the state."""
        self.intent = edit(self.intent)
        return self.intent

    def change_mission(self, edit: Any) -> None:
        """Edit the mission."""
        self.intent = dataclasses.replace(self.intent, mission=edit(self.intent.mission))


def observe_scene(point_map: PointMap, pose: Pose2 = IDENTITY) -> None:
    """Measure a red square 1.5 m before a pose."""
    frame = picture(Paint(x=(1.5, 2.0), y=(-0.3, 0.3)), pose=pose)
    labels = ColourSegmenter().segment(frame, RED_LIST)
    observation = observe(frame, labels, RED_LIST, point_map.spec, ObservationConfig())
    point_map.insert(observation, frame, labels)


class Session:
    """A console's editors at a site whose map is corrected."""

    def __init__(self, site: SiteStore) -> None:
        self.site, self.holder = site, Holder()
        self.map = PointMap(SPEC, MappingConfig())
        self.map.pose_ids.name_numberings(lambda: uuid.uuid4().hex)
        if site.map_file.exists():
            self.map.restore(map_file.load(site.map_file).state)
        pose_ids = self.map.pose_ids
        settle(site, numbered(pose_ids.loaded_numbering, pose_ids.array()))
        self.holder.intent = dataclasses.replace(
            self.holder.intent, mission=mission_of(site), zones=site.zones()
        )
        self.anchored = AnchoredItems(
            lambda: self.zones, lambda: self.holder.intent.mission, self.holder.change_mission
        )
        self.zones = ZoneEditor(self.holder, store=site, anchors=self.anchored)
        self.saved = SavedMissions(site, self.anchored)

    def see(self, x_m: float) -> None:
        """Measure the scene from another pose."""
        observe_scene(self.map, Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0))

    def tick(self, *, has_moved: bool = False) -> None:
        """Do what the console does after each tick, and what it stores some time later."""
        self.anchored.note_tick(self.map.pose_ids, has_moved=has_moved)
        self.keep_mission()

    def keep_mission(self) -> None:
        """Store the mission in progress."""
        mission = self.holder.intent.mission
        queue = [{"id": goal.id, **goal_record(goal)} for goal in mission.queue]
        record = {"phase": "paused", "queue": queue, "reached": [], "cancelled": False}
        self.site.save_document(*MISSION, {**record, "next_id": 9, "loop": False})

    def correct(self, x_m: float, turn_rad: float = TURN_RAD) -> None:
        """Correct the poses of this session."""
        ids = self.map.pose_ids
        motion = Pose2(x_m=x_m, y_m=0.0, yaw_rad=turn_rad)
        move(ids, {n: motion @ ids[n] for n in range(ids.frozen, len(ids))})
        self.tick(has_moved=True)

    def write(self) -> None:
        """Write the map."""
        map_file.save(self.site.map_file, self.map.state(), RED_LIST.names)

    def where(self) -> list[tuple[float, float]]:
        """Return a corner of each zone, of each zone of the set, and all goals."""
        return where(
            [zone.polygon[0] for zone in self.holder.intent.zones],
            [zone.polygon[0] for zone in self.zones.sets()["all"]],
            [(goal.x_m, goal.y_m) for goal in self.saved.named("round").goals],
            [(goal.x_m, goal.y_m) for goal in self.holder.intent.mission.queue],
        )


def where(*parts: Any) -> list[tuple[float, float]]:
    return [(round(x, 6), round(y, 6)) for part in parts for x, y in part]


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with closing(Store(tmp_path)) as store:
        store.site.folder.mkdir(parents=True, exist_ok=True)
        store.site.save_beware(RED_LIST)
        yield store


@pytest.fixture
def session(store: Store) -> Session:
    """Return a session with two zones, a set of them, a goal and a mission, all anchored."""
    session = Session(store.site)
    for x_m in (0.0, 0.5, 1.0):
        session.see(x_m)
    session.tick()
    session.zones.add_all([SQUARE, POST])
    session.zones.save_set("all")
    session.holder.change_mission(lambda mission: mission.add(1.0, 0.5, SPEC, yaw_rad=1.0))
    session.saved.save("round", session.holder.intent.mission, replace=False)
    session.tick()
    return session


def test_after_a_kill_before_the_corrected_map_is_stored_all_is_where_the_older_map_has_it(
    session: Session, store: Store
) -> None:
    session.write()
    drawn = session.where()
    session.correct(0.4)
    moved = session.where()
    assert all(a != b for a, b in zip(drawn, moved, strict=True))
    again = Session(store.site)
    assert again.where() == drawn
    assert again.holder.intent.zones[1].drawn == CIRCLE
    assert again.holder.intent.mission.queue[0].yaw_rad == pytest.approx(1.0)
    assert [zone.version for zone in again.zones.stored] == [3, 3]
    assert Session(store.site).where() == drawn


def test_after_a_kill_between_two_corrections_all_is_where_the_map_between_has_it(
    session: Session, store: Store
) -> None:
    session.correct(0.4)
    session.write()
    between = session.where()
    for _ in range(3):
        session.correct(0.2, -0.05)
    assert session.where() != between
    assert Session(store.site).where() == between


def test_zones_that_were_not_stored_yet_are_where_a_newer_map_has_them(
    session: Session, store: Store
) -> None:
    """The program was killed between the correction and the storing of what it moves."""
    ids, before = session.map.pose_ids, session.where()
    move(ids, {n: Pose2(x_m=0.4, y_m=0.0, yaw_rad=0.0) @ ids[n] for n in range(len(ids))})
    session.write()
    assert Session(store.site).where() == [(round(x + 0.4, 6), y) for x, y in before]


def test_what_is_drawn_after_a_correction_is_where_the_older_map_has_it(
    session: Session, store: Store
) -> None:
    """The program was killed right after it had acknowledged the zone."""
    session.write()
    session.correct(0.4, 0.0)
    beside = dataclasses.replace(SQUARE, polygon=((1.4, -2.0), (2.0, -2.0), (2.0, -1.5)))
    session.zones.add(beside)
    (square, _, _) = session.zones.stored
    bent = ((1.4, 1.0), (2.4, 1.0), (2.4, 2.5))
    session.zones.replace(square.id, dataclasses.replace(SQUARE, polygon=bent))
    bent_zone, _, new = Session(store.site).zones.stored
    assert new.polygon[0] == pytest.approx((1.0, -2.0))
    expected = [value for x, y in bent for value in (x - 0.4, y)]
    assert [value for corner in bent_zone.polygon for value in corner] == pytest.approx(expected)


def test_a_start_with_another_map_loses_no_anchor(session: Session, store: Store) -> None:
    """As by `--map FILE`, also of a copy of the map of this session."""
    session.write()
    drawn, early = session.where(), store.site.map_file.read_bytes()
    session.correct(0.4)
    session.write()
    own, late = session.where(), store.site.map_file.read_bytes()
    session.correct(0.2)
    other = PointMap(SPEC, MappingConfig())
    observe_scene(other)
    map_file.save(store.site.map_file, other.state(), RED_LIST.names)
    Session(store.site).tick()
    for data, places in ((early, drawn), (late, own), (early, drawn)):
        store.site.map_file.write_bytes(data)
        assert Session(store.site).where() == places


def test_the_own_map_tells_where_a_zone_is_also_after_two_sessions_with_another_one(
    session: Session, store: Store
) -> None:
    session.write()
    own, drawn = store.site.map_file.read_bytes(), session.zones.stored[0].polygon
    other = PointMap(SPEC, MappingConfig())
    map_file.save(store.site.map_file, other.state(), RED_LIST.names)
    for number in (1, 2, 3):
        foreign = Session(store.site)
        foreign.see(2.0)
        foreign.tick()
        foreign.correct(0.3, 0.0)
        square = foreign.zones.stored[0]
        renamed = dataclasses.replace(SQUARE, name=f"{number}", polygon=square.polygon)
        foreign.zones.replace(square.id, renamed)
        foreign.write()
    assert square.polygon != drawn
    store.site.map_file.write_bytes(own)
    assert Session(store.site).zones.stored[0].polygon == drawn


def test_a_zone_that_is_anchored_later_is_stored_with_its_anchor(
    session: Session, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was drawn before the first tick."""
    store.site.map_file.unlink(missing_ok=True)
    again = Session(store.site)
    again.zones.add(dataclasses.replace(SQUARE, name="early"))
    again.see(0.0)

    def full(*_: object) -> None:
        raise StorageFailed("disk full")

    with monkeypatch.context() as patch:
        patch.setattr(store.site, "change_zones", full)
        again.tick()
    assert not store.site.zones()[2].anchors
    again.zones.expire()
    assert store.site.zones()[2].anchors
    ids = again.map.pose_ids
    move(ids, {0: Pose2(x_m=0.4, y_m=0.0, yaw_rad=0.0)})
    again.write()
    assert Session(store.site).zones.stored[2].polygon[0] == pytest.approx((1.4, 1.0))


def test_a_set_and_a_mission_that_are_used_later_are_where_the_map_has_them(
    session: Session,
) -> None:
    drawn = session.zones.stored
    session.zones.delete(drawn[0].id)
    session.holder.change_mission(lambda mission: mission.cancel())
    session.correct(0.4)
    session.zones.use_set("all")
    post, square = session.zones.stored
    assert square.polygon[0] == pytest.approx((1.295171, 1.094838), abs=1e-6)
    assert post.drawn is not None and post.drawn != CIRCLE
    session.zones.undo()
    session.zones.undo()
    there = {zone.polygon for zone in session.zones.stored}
    assert there == {square.polygon, post.polygon}, "as undone edits bring it back"
    session.correct(-0.2, 0.0)
    (goal,) = session.saved.named("round").goals
    session.holder.change_mission(lambda mission: mission.refill([goal], loop=False))
    session.correct(0.1, 0.0)
    (queued,) = session.holder.intent.mission.queue
    assert queued.x_m == pytest.approx(goal.x_m + 0.1)


def test_a_rename_keeps_the_anchor_of_a_zone(session: Session, store: Store) -> None:
    session.write()
    session.correct(0.4)
    (square, post) = session.zones.stored
    session.zones.replace(
        square.id, dataclasses.replace(SQUARE, name="dry", polygon=square.polygon)
    )
    session.zones.delete(post.id)
    session.zones.undo()
    square, post = Session(store.site).zones.stored
    assert square.name == "dry" and square.polygon == SQUARE.polygon
    assert post.drawn == CIRCLE


def test_where_the_stored_map_is_another_one_all_stays_as_it_was_stored(
    session: Session, store: Store
) -> None:
    other = PointMap(SPEC, MappingConfig())
    observe_scene(other)
    map_file.save(store.site.map_file, other.state(), RED_LIST.names)
    session.correct(0.4)
    again, zones, queue = Session(store.site), session.zones.stored, session.holder.intent.mission
    assert again.zones.stored == zones and again.holder.intent.mission.queue == queue.queue
    assert session.zones.stored[0].polygon != SQUARE.polygon


def test_what_was_drawn_beside_poses_that_are_not_stored_stays(
    session: Session, store: Store
) -> None:
    session.write()
    ids = session.map.pose_ids
    session.see(9.0)
    session.tick()
    far = dataclasses.replace(SQUARE, polygon=((10.0, 1.0), (10.5, 1.0), (10.5, 2.0)))
    session.zones.add(far)
    session.tick()
    (anchor,) = session.zones.stored[2].anchors
    assert [n for n, _ in anchor.poses] == [len(ids) - 1]
    assert Session(store.site).zones.stored[2].polygon == far.polygon


def test_a_map_that_is_loaded_begins_afresh(session: Session, store: Store) -> None:
    """Its poses are constants, and the IDs after them are given to other places."""
    session.write()
    again = Session(store.site)
    again.see(9.0)
    again.tick()
    drawn = again.where()
    again.correct(0.4)
    assert again.where() == drawn
    again.write()
    assert Session(store.site).where() == drawn


def test_archive_copy_and_keep_out_mask_have_all_where_their_map_has_it(
    session: Session, store: Store
) -> None:
    session.write()
    drawn = session.where()
    session.correct(0.4)
    with zipfile.ZipFile(io.BytesIO(pack(store.site))) as packed:
        document = json.loads(packed.read("site.json"))
    corner = [zone["geometry"]["coordinates"][0][0] for zone in document["zones"]]
    of_set = [zone["geometry"]["coordinates"][0][0] for zone in document["zone_sets"]["all"]]
    goals = [(goal["x_m"], goal["y_m"]) for goal in document["missions"]["round"]["goals"]]
    assert where(corner, of_set, goals) == drawn[:-1]
    copied = store.sites.copy(store.site.name, "copy")
    assert Session(copied).where() == drawn
    moved = session.where()
    masks = []
    for _ in range(2):
        with zipfile.ZipFile(io.BytesIO(export_nav2(store.site, MappingConfig()))) as packed:
            masks.append([packed.read(f"keepout_mask.{kind}") for kind in ("pgm", "yaml")])
        session.write()
    assert masks[0] != masks[1] and session.where() == moved


def test_a_zone_of_any_kind_is_stored_with_its_anchor(session: Session, store: Store) -> None:
    limit = dataclasses.replace(
        SQUARE, name="slow", kind=ZoneKind.SPEED_LIMIT, max_speed_mps=0.3, margin_m=0.0
    )
    session.zones.add(limit)
    session.tick()
    session.write()
    session.correct(0.4)
    slow = Session(store.site).zones.stored[2]
    assert slow.max_speed_mps == 0.3 and slow.polygon == SQUARE.polygon
