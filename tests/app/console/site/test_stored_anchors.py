"""Zones and goals are where the map that is loaded has them, whatever of both was stored last."""

from __future__ import annotations

import dataclasses
import io
import json
import zipfile
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from app.console.mission.anchored_items import AnchoredItems
from app.console.mission.saved_missions import SavedMissions
from app.console.mission.zone_editor import ZoneEditor
from app.console.site.site_archive import pack
from app.console.site.site_files import export_nav2
from app.console.site.sites import mission_of
from app.console.site.stored_anchors import ANCHORS, MISSION, save_anchors, settle
from app.runtime.control.operator_state import OperatorState
from app.storage import Store
from app.storage.site_store import SiteStore
from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import ObservationConfig
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
        if site.map_file.exists():
            self.map.restore(map_file.load(site.map_file).state)
        settle(site, self.map.pose_ids.numbering_before, self.map.pose_ids.array())
        self.holder.intent = dataclasses.replace(
            self.holder.intent, mission=mission_of(site), zones=site.zones()
        )
        self.zones = ZoneEditor(self.holder, store=site)
        self.saved = SavedMissions(site)
        self.anchored = AnchoredItems(
            lambda: self.zones,
            lambda: self.saved,
            lambda: self.holder.intent.mission,
            self.holder.change_mission,
            lambda anchors: save_anchors(site, anchors),
        )

    def see(self, x_m: float) -> None:
        """Measure the scene from another pose."""
        observe_scene(self.map, Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0))

    def tick(self, **changes: bool) -> None:
        """Do what the console does after each tick, and what it stores some time later."""
        self.anchored.note_tick(self.map.pose_ids, **changes)
        self.anchored.keep()
        self.keep_mission()

    def keep_mission(self) -> None:
        """Store the mission in progress."""
        mission = self.holder.intent.mission
        queue = [
            {"id": goal.id, "x_m": goal.x_m, "y_m": goal.y_m, "yaw_rad": goal.yaw_rad, "name": ""}
            for goal in mission.queue
        ]
        record = {"phase": "paused", "queue": queue, "reached": [], "cancelled": False}
        self.site.save_document(*MISSION, {**record, "next_id": 9, "loop": False})

    def correct(self, x_m: float, turn_rad: float = TURN_RAD) -> None:
        """Correct the poses of this session."""
        ids = self.map.pose_ids
        motion = Pose2(x_m=x_m, y_m=0.0, yaw_rad=turn_rad)
        move(ids, {n: motion @ ids[n] for n in range(ids.frozen, len(ids))})
        self.tick(is_corrected=True)

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
    session: Session, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The think thread was killed between the storing of the anchors and that of the zones."""
    session.write()
    session.zones.move = lambda _: ()  # type: ignore[method-assign, assignment]
    monkeypatch.setattr(SavedMissions, "move", lambda *_: None)
    session.holder.change_mission = lambda _: None  # type: ignore[method-assign, assignment]
    ids = session.map.pose_ids
    move(ids, {n: Pose2(x_m=0.4, y_m=0.0, yaw_rad=0.0) @ ids[n] for n in range(len(ids))})
    before = session.where()
    session.anchored.note_tick(ids, is_corrected=True)
    session.write()
    assert Session(store.site).where() == [(round(x + 0.4, 6), y) for x, y in before]


def test_where_the_stored_map_is_another_one_all_stays_as_it_was_stored(
    session: Session, store: Store
) -> None:
    other = PointMap(SPEC, MappingConfig())
    observe_scene(other)
    map_file.save(store.site.map_file, other.state(), RED_LIST.names)
    session.correct(0.4)
    assert Session(store.site).where() == session.where()


def test_what_an_operator_has_moved_since_stays_where_it_was_put(
    session: Session, store: Store
) -> None:
    session.write()
    session.correct(0.4)
    (square, _) = session.zones.stored
    elsewhere = dataclasses.replace(SQUARE, polygon=((3.0, 1.0), (4.0, 1.0), (4.0, 2.0)))
    session.zones.replace(square.id, elsewhere)
    again = Session(store.site)
    assert again.zones.stored[0].polygon == elsewhere.polygon
    assert again.zones.stored[1].drawn == CIRCLE


def test_what_was_drawn_beside_poses_that_are_not_stored_stays(
    session: Session, store: Store
) -> None:
    session.write()
    ids = session.map.pose_ids
    session.see(9.0)
    far = dataclasses.replace(SQUARE, polygon=((10.0, 1.0), (10.5, 1.0), (10.5, 2.0)))
    session.zones.add(far)
    session.tick()
    assert any(
        held is not None and min(n for n, _ in held.anchor.poses) == len(ids) - 1
        for held in session.anchored._anchors.zones.values()
    )
    assert Session(store.site).zones.stored[2].polygon == far.polygon


def test_a_map_that_is_loaded_begins_afresh(session: Session, store: Store) -> None:
    """Its poses are constants, and the IDs after them are given to other places."""
    session.write()
    again = Session(store.site)
    assert store.site.documents(ANCHORS[0]) == {}
    again.see(9.0)
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
