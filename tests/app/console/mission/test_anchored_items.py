"""Zones and goals drawn while mapping move with the poses beside which they were drawn."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from app.console.mission.anchored_items import AnchoredItems
from app.console.mission.saved_missions import SavedMissions
from navcore.errors import StorageFailed
from navcore.geometry.transform import Pose2
from navcore.mapping.points.pose_ids import PoseIds
from navcore.mission.anchors import Anchors, spot_of
from navcore.mission.mission import Goal, Mission
from navcore.mission.zone import Zone
from tests.navcore.mapping.points.moved_poses import move

ZONE = Zone(id="z", name="Wet floor", polygon=((2.0, 0.0), (3.0, 0.0), (3.0, 1.0), (2.0, 1.0)))
FAR = Zone(id="f", name="Far", polygon=((42.0, 0.0), (43.0, 0.0), (43.0, 1.0)))


class Held:
    """Zones and missions in memory, and what is stored."""

    def __init__(self) -> None:
        self.stored: tuple[Zone, ...] = (ZONE, FAR)
        self.mission = Mission(queue=(Goal(id=1, x_m=2.0, y_m=1.0, name="Dock"),))
        self.has_unmoved_sets = False
        self.stored_anchors: list[Anchors] = []
        self.kept: dict[str, dict[str, Any]] = {}
        self.saved = SavedMissions(self)
        self.saved.save("round", self.mission, replace=False)

    def documents(self, kind: str) -> dict[str, Any]:
        """Return what was stored."""
        documents: dict[str, Any] = json.loads(json.dumps(self.kept.get(kind, {})))
        return documents

    def save_document(self, kind: str, name: str, value: Any) -> None:
        """Store a document."""
        self.kept = {kind: {} if value is None else {name: value}}

    def move(self, placed: Callable[[Zone], Zone]) -> tuple[tuple[Zone, Zone], ...]:
        """Move zones."""
        self.placed, before = placed, self.stored
        self.stored = tuple(map(placed, before))
        return tuple((was, now) for was, now in zip(before, self.stored, strict=True) if now != was)

    def change(self, edit: Callable[[Mission], Mission]) -> None:
        """Edit the mission."""
        self.mission = edit(self.mission)


def items_of(held: Held) -> AnchoredItems:
    return AnchoredItems(
        lambda: held,
        lambda: held.saved,
        lambda: held.mission,
        held.change,
        held.stored_anchors.append,
    )


def shifted(items: AnchoredItems, pose_ids: PoseIds, x_m: float) -> tuple[str, ...]:
    """Correct all poses, and return what is told."""
    move(pose_ids, {i: replace(p, x_m=p.x_m + x_m) for i, p in enumerate(pose_ids.poses)})
    return items.note_tick(pose_ids, is_corrected=True)


@pytest.fixture
def pose_ids() -> PoseIds:
    ids = PoseIds(0.25, 10.0)
    for step in range(8):
        ids.id_of(Pose2(x_m=0.5 * step, y_m=0.0, yaw_rad=0.0))
    return ids


def test_a_correction_takes_zones_and_goals_along_and_says_so(pose_ids: PoseIds) -> None:
    held = Held()
    items = items_of(held)
    assert items.note_tick(pose_ids) == ()
    told = shifted(items, pose_ids, 0.4)
    assert held.stored[0].polygon[0] == pytest.approx((2.4, 0.0))
    assert held.stored[1] == FAR
    assert held.mission.queue[0].x_m == pytest.approx(2.4)
    assert told == (
        "Zone “Wet floor” moved 0.40 m with the map.",
        "Goal “Dock” moved 0.40 m with the map.",
    )
    assert held.placed(ZONE).polygon[0] == pytest.approx((2.4, 0.0)), "as undone edits hold it"
    assert held.placed(FAR) is FAR
    shifted(items, pose_ids, -0.4)
    assert held.stored[0].polygon[0] == pytest.approx((2.0, 0.0))


def test_a_goal_keeps_the_heading_that_it_was_given_later(pose_ids: PoseIds) -> None:
    held = Held()
    items = items_of(held)
    items.note_tick(pose_ids)
    turned = replace(held.mission.queue[0], yaw_rad=1.0)
    held.mission = replace(held.mission, queue=(turned,))
    items.note_tick(pose_ids)
    shifted(items, pose_ids, 0.4)
    assert held.mission.queue[0].yaw_rad == pytest.approx(1.0)
    assert held.mission.queue[0].x_m == pytest.approx(2.4)


@pytest.mark.parametrize(
    ("edit", "there"),
    [
        ({"x_m": 5.0}, {"x_m": 5.0, "name": "Dock"}),
        ({"name": "Door"}, {"x_m": 2.4, "name": "Door"}),
    ],
)
def test_a_goal_that_an_operator_edits_at_the_moment_of_a_correction_keeps_the_edit(
    edit: dict[str, Any], there: dict[str, Any], pose_ids: PoseIds
) -> None:
    held = Held()
    (goal,) = held.mission.queue

    def change(moved: Callable[[Mission], Mission]) -> None:
        held.mission = moved(replace(held.mission, queue=(replace(goal, **edit),)))

    items = AnchoredItems(
        lambda: held, lambda: held.saved, lambda: Mission(queue=(goal,)), change, lambda _: None
    )
    items.note_tick(pose_ids)
    shifted(items, pose_ids, 0.4)
    (found,) = held.mission.queue
    assert {"x_m": pytest.approx(found.x_m), "name": found.name} == there


@pytest.mark.parametrize(("unmoved", "x_m"), [(True, 2.6), (False, 2.0)])
def test_sets_that_could_not_be_moved_keep_their_anchors(
    pose_ids: PoseIds, unmoved: bool, x_m: float
) -> None:
    held = Held()
    items = items_of(held)
    items.note_tick(pose_ids)
    held.has_unmoved_sets = unmoved
    shifted(items, pose_ids, 0.4)
    shifted(items, pose_ids, 0.2)
    assert held.placed(ZONE).polygon[0] == pytest.approx((x_m, 0.0))  # as a set holds it


def test_corrections_that_are_too_small_by_themselves_add_up(pose_ids: PoseIds) -> None:
    held = Held()
    items = items_of(held)
    items.note_tick(pose_ids)
    told = [text for _ in range(12) for text in shifted(items, pose_ids, 0.008)]
    assert held.stored[0].polygon[0] == pytest.approx((2.0 + 12 * 0.008, 0.0), abs=0.01)
    assert held.mission.queue[0].x_m == pytest.approx(2.0 + 12 * 0.008, abs=0.01)
    assert told.count("Zone “Wet floor” moved 0.02 m with the map.") == 6


def test_what_edits_hold_moves_with_the_zone_and_not_with_poses_that_came_by_later(
    pose_ids: PoseIds,
) -> None:
    """The robot comes back beside the zone with drift, and the loop moves these poses alone."""
    held = Held()
    items = items_of(held)
    items.note_tick(pose_ids)
    old = len(pose_ids.poses)
    for step in range(5):
        pose_ids.id_of(Pose2(x_m=2.1 + 0.3 * step, y_m=0.4, yaw_rad=0.0))
    renamed = replace(ZONE, name="Spill", version=2)
    held.stored = (renamed, FAR)
    items.note_tick(pose_ids)
    before = pose_ids.poses
    later = {i: p for i, p in enumerate(before) if i >= old}
    move(pose_ids, {i: replace(p, y_m=p.y_m + 0.5) for i, p in later.items()})
    assert items.note_tick(pose_ids, is_corrected=True) == ()
    assert held.stored == (renamed, FAR)
    assert held.placed(ZONE) is ZONE


def test_what_belongs_to_a_loaded_map_stays(pose_ids: PoseIds) -> None:
    held = Held()
    pose_ids.freeze()
    items = items_of(held)
    items.note_tick(pose_ids)
    assert shifted(items, pose_ids, 1.0) == ()
    assert held.stored == (ZONE, FAR)


def test_saved_missions_move_with_the_map(pose_ids: PoseIds) -> None:
    held = Held()
    items = items_of(held)
    items.note_tick(pose_ids)
    held.mission = Mission()
    items.note_tick(pose_ids)
    shifted(items, pose_ids, 0.4)
    assert held.saved.named("round").goals[0].x_m == pytest.approx(2.4)
    shifted(items, pose_ids, 0.2)
    assert held.saved.named("round").goals[0].x_m == pytest.approx(2.6)
    held.saved.delete("round")
    shifted(items, pose_ids, 0.2)
    assert not items._anchors.goals, "of none that is queued or saved"


def test_what_a_place_on_trial_has_moved_is_moved_back_with_the_map(pose_ids: PoseIds) -> None:
    held, before = Held(), pose_ids.array()
    items = items_of(held)
    items.note_tick(pose_ids)
    shifted(items, pose_ids, 0.4)
    pose_ids.restore(before, pose_ids.numbering)
    told = items.note_tick(pose_ids, taken_back=True)
    assert held.stored[0].polygon[0] == pytest.approx((2.0, 0.0))
    assert held.mission.queue[0].x_m == pytest.approx(2.0)
    assert told[0] == "Zone “Wet floor” moved 0.40 m with the map."
    assert shifted(items, pose_ids, 0.4) == (), "the poses of before are constants now"


def test_anchors_are_stored_before_anything_moves_by_the_places_of_before_and_after(
    pose_ids: PoseIds,
) -> None:
    held = Held()
    items = items_of(held)
    items.note_tick(pose_ids)
    items.keep()
    items.keep()
    assert [set(stored.zones) for stored in held.stored_anchors] == [{ZONE.polygon, FAR.polygon}]
    moves, stored_at_move = held.move, list[Anchors]()

    def move_zones(placed: Callable[[Zone], Zone]) -> tuple[tuple[Zone, Zone], ...]:
        stored_at_move.append(held.stored_anchors[-1])
        return moves(placed)

    held.move = move_zones  # type: ignore[method-assign]
    shifted(items, pose_ids, 0.4)
    (stored,) = stored_at_move
    assert stored.numbering == pose_ids.numbering
    assert {ZONE.polygon, held.stored[0].polygon} <= stored.zones.keys()
    assert {(2.0, 1.0, None), spot_of(held.mission.queue[0])} <= stored.goals.keys()
    items.keep()
    assert ZONE.polygon not in held.stored_anchors[-1].zones


def test_zones_move_though_their_anchors_cannot_be_stored_and_these_are_stored_later(
    pose_ids: PoseIds,
) -> None:
    held = Held()
    items, stored = items_of(held), held.stored_anchors.append

    def refuse(_: Anchors) -> None:
        raise StorageFailed("disk full")

    items._store = refuse
    items.note_tick(pose_ids)
    shifted(items, pose_ids, 0.4)
    assert held.stored[0].polygon[0] == pytest.approx((2.4, 0.0))
    with pytest.raises(StorageFailed):
        items.keep()
    items._store = stored
    items.keep()
    assert held.stored[0].polygon in held.stored_anchors[-1].zones


def test_goals_of_long_ago_are_forgotten_but_not_saved_ones(
    pose_ids: PoseIds, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.console.mission.anchored_items.MOST_GOALS", 5)
    held = Held()
    items = items_of(held)
    for step in range(20):
        held.mission = Mission(queue=(Goal(id=step, x_m=2.0, y_m=1.0 + 0.1 * step),))
        items.note_tick(pose_ids)
        assert (2.0, 1.0, None) in items._anchors.goals, "of the saved mission"
        assert spot_of(held.mission.queue[0]) in items._anchors.goals
        assert len(items._anchors.goals) <= 5
