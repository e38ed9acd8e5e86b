"""Zones and goals drawn while mapping move with the poses beside which they were drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from app.console.mission.anchored_items import AnchoredItems
from navcore.geometry.transform import Pose2
from navcore.localisation.map_correction import AppliedCorrection
from navcore.mapping.points.pose_ids import PoseIds
from navcore.mission.mission import Goal, Mission
from navcore.mission.zone import Zone
from tests.navcore.mapping.points.moved_poses import move

ZONE = Zone(id="z", name="Wet floor", polygon=((2.0, 0.0), (3.0, 0.0), (3.0, 1.0), (2.0, 1.0)))
FAR = Zone(id="f", name="Far", polygon=((42.0, 0.0), (43.0, 0.0), (43.0, 1.0)))


class Held:
    """Zones and mission in memory."""

    def __init__(self) -> None:
        self.stored: tuple[Zone, ...] = (ZONE, FAR)
        self.mission = Mission(queue=(Goal(id=1, x_m=2.0, y_m=1.0, name="Dock"),))
        self.has_unmoved_sets = False

    def move(self, placed: Callable[[Zone], Zone]) -> tuple[tuple[Zone, Zone], ...]:
        """Move zones."""
        self.placed, before = placed, self.stored
        self.stored = tuple(map(placed, before))
        return tuple((was, now) for was, now in zip(before, self.stored, strict=True) if now != was)

    def change(self, edit: Callable[[Mission], Mission]) -> None:
        """Edit the mission."""
        self.mission = edit(self.mission)


def shifted(pose_ids: PoseIds, x_m: float) -> AppliedCorrection:
    before = pose_ids.poses
    there = {i: replace(p, x_m=p.x_m + x_m) for i, p in enumerate(before)}
    move(pose_ids, there)
    motion = Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0)
    return AppliedCorrection(before=before, after=pose_ids.poses, motion=motion, loops=1)


@pytest.fixture
def pose_ids() -> PoseIds:
    ids = PoseIds(0.25, 10.0)
    for step in range(8):
        ids.id_of(Pose2(x_m=0.5 * step, y_m=0.0, yaw_rad=0.0))
    return ids


def test_a_correction_takes_zones_and_goals_along_and_says_so(pose_ids: PoseIds) -> None:
    held = Held()
    items = AnchoredItems(lambda: held, lambda: held.mission, held.change)
    assert items.note_tick(None, pose_ids) == ()
    told = items.note_tick(shifted(pose_ids, 0.4), pose_ids)
    assert held.stored[0].polygon[0] == pytest.approx((2.4, 0.0))
    assert held.stored[1] == FAR
    assert held.mission.queue[0].x_m == pytest.approx(2.4)
    assert told == (
        "Zone “Wet floor” moved 0.40 m with the map.",
        "Goal “Dock” moved 0.40 m with the map.",
    )
    assert held.placed(ZONE).polygon[0] == pytest.approx((2.4, 0.0)), "as undone edits hold it"
    assert held.placed(FAR) is FAR
    items.note_tick(shifted(pose_ids, -0.4), pose_ids)
    assert held.stored[0].polygon[0] == pytest.approx((2.0, 0.0))


def test_a_goal_keeps_the_heading_that_it_was_given_later(pose_ids: PoseIds) -> None:
    held = Held()
    items = AnchoredItems(lambda: held, lambda: held.mission, held.change)
    items.note_tick(None, pose_ids)
    turned = replace(held.mission.queue[0], yaw_rad=1.0)
    held.mission = replace(held.mission, queue=(turned,))
    items.note_tick(None, pose_ids)
    items.note_tick(shifted(pose_ids, 0.4), pose_ids)
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

    items = AnchoredItems(lambda: held, lambda: Mission(queue=(goal,)), change)
    items.note_tick(None, pose_ids)
    items.note_tick(shifted(pose_ids, 0.4), pose_ids)
    (found,) = held.mission.queue
    assert {"x_m": pytest.approx(found.x_m), "name": found.name} == there


@pytest.mark.parametrize(("unmoved", "x_m"), [(True, 2.6), (False, 2.0)])
def test_sets_that_could_not_be_moved_keep_their_anchors(
    pose_ids: PoseIds, unmoved: bool, x_m: float
) -> None:
    held = Held()
    items = AnchoredItems(lambda: held, lambda: held.mission, held.change)
    items.note_tick(None, pose_ids)
    held.has_unmoved_sets = unmoved
    items.note_tick(shifted(pose_ids, 0.4), pose_ids)
    items.note_tick(shifted(pose_ids, 0.2), pose_ids)
    assert held.placed(ZONE).polygon[0] == pytest.approx((x_m, 0.0))  # as a set holds it


def test_corrections_that_are_too_small_by_themselves_add_up(pose_ids: PoseIds) -> None:
    held = Held()
    items = AnchoredItems(lambda: held, lambda: held.mission, held.change)
    items.note_tick(None, pose_ids)
    told = [text for _ in range(12) for text in items.note_tick(shifted(pose_ids, 0.008), pose_ids)]
    assert held.stored[0].polygon[0] == pytest.approx((2.0 + 12 * 0.008, 0.0), abs=0.01)
    assert held.mission.queue[0].x_m == pytest.approx(2.0 + 12 * 0.008, abs=0.01)
    assert told.count("Zone “Wet floor” moved 0.02 m with the map.") == 6


def test_what_edits_hold_moves_with_the_zone_and_not_with_poses_that_came_by_later(
    pose_ids: PoseIds,
) -> None:
    """The robot comes back beside the zone with drift, and the loop moves these poses alone."""
    held = Held()
    items = AnchoredItems(lambda: held, lambda: held.mission, held.change)
    items.note_tick(None, pose_ids)
    old = len(pose_ids.poses)
    for step in range(5):
        pose_ids.id_of(Pose2(x_m=2.1 + 0.3 * step, y_m=0.4, yaw_rad=0.0))
    renamed = replace(ZONE, name="Spill", version=2)
    held.stored = (renamed, FAR)
    items.note_tick(None, pose_ids)
    before = pose_ids.poses
    later = {i: p for i, p in enumerate(before) if i >= old}
    move(pose_ids, {i: replace(p, y_m=p.y_m + 0.5) for i, p in later.items()})
    motion = Pose2(x_m=0.0, y_m=0.5, yaw_rad=0.0)
    correction = AppliedCorrection(before=before, after=pose_ids.poses, motion=motion, loops=1)
    assert items.note_tick(correction, pose_ids) == ()
    assert held.stored == (renamed, FAR)
    assert held.placed(ZONE) is ZONE


def test_what_belongs_to_a_loaded_map_stays(pose_ids: PoseIds) -> None:
    held = Held()
    before = pose_ids.poses
    pose_ids.freeze()
    items = AnchoredItems(lambda: held, lambda: held.mission, held.change)
    items.note_tick(None, pose_ids)
    after = tuple(Pose2(x_m=p.x_m + 1, y_m=p.y_m, yaw_rad=p.yaw_rad) for p in before)
    moved = AppliedCorrection(
        before=before, after=after, motion=Pose2(x_m=1.0, y_m=0.0, yaw_rad=0.0), loops=1
    )
    assert items.note_tick(moved, pose_ids) == ()
    assert held.stored == (ZONE, FAR)
