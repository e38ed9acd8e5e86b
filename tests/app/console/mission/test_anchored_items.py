"""Zones and goals drawn while mapping move with the poses beside which they were drawn."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from app.console.mission.anchored_items import AnchoredItems
from navcore.geometry.transform import Pose2
from navcore.mapping.points.pose_ids import PoseIds
from navcore.mission.anchors import is_anchored
from navcore.mission.mission import Goal, Mission
from navcore.mission.zone import Zone
from tests.navcore.mapping.points.moved_poses import move
from web.interface.sites import at_another_site

ZONE = Zone(id="z", name="Wet floor", polygon=((2.0, 0.0), (3.0, 0.0), (3.0, 1.0), (2.0, 1.0)))
FAR = Zone(id="f", name="Far", polygon=((42.0, 0.0), (43.0, 0.0), (43.0, 1.0)))


class Held:
    """Zones and mission in memory."""

    def __init__(self) -> None:
        self.stored: tuple[Zone, ...] = (ZONE, FAR)
        self.mission = Mission(queue=(Goal(id=1, x_m=2.0, y_m=1.0, name="Dock"),))

    def move(self, placed: Callable[[Zone], Zone]) -> tuple[tuple[Zone, Zone], ...]:
        """Move zones."""
        before = self.stored
        self.stored = tuple(map(placed, before))
        return tuple((was, now) for was, now in zip(before, self.stored, strict=True) if now != was)

    def anchor(self, anchored: Callable[[Zone], Zone]) -> None:
        """Anchor zones."""
        self.stored = tuple(map(anchored, self.stored))

    def change(self, edit: Callable[[Mission], Mission]) -> None:
        """Edit the mission."""
        self.mission = edit(self.mission)


def items_of(held: Held) -> AnchoredItems:
    return AnchoredItems(lambda: held, lambda: held.mission, held.change)


def shifted(items: AnchoredItems, pose_ids: PoseIds, x_m: float) -> tuple[str, ...]:
    """Correct all poses, and return what is told."""
    move(pose_ids, {i: replace(p, x_m=p.x_m + x_m) for i, p in enumerate(pose_ids.poses)})
    return items.note_tick(pose_ids, has_moved=True)


@pytest.fixture
def pose_ids() -> PoseIds:
    ids = PoseIds(0.25, 10.0)
    ids.name_numberings(map(str, itertools.count(1)).__next__)
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

    def change(moved: Callable[[Mission], Mission]) -> None:
        held.mission = moved(replace(held.mission, queue=(replace(goal, **edit),)))

    items = items_of(held)
    items.note_tick(pose_ids)
    (goal,) = held.mission.queue
    items._change_mission = change
    shifted(items, pose_ids, 0.4)
    (found,) = held.mission.queue
    assert {"x_m": pytest.approx(found.x_m), "name": found.name} == there


def test_corrections_that_are_too_small_by_themselves_add_up(pose_ids: PoseIds) -> None:
    held = Held()
    items = items_of(held)
    items.note_tick(pose_ids)
    told = [text for _ in range(12) for text in shifted(items, pose_ids, 0.008)]
    assert held.stored[0].polygon[0] == pytest.approx((2.0 + 12 * 0.008, 0.0), abs=0.01)
    assert held.mission.queue[0].x_m == pytest.approx(2.0 + 12 * 0.008, abs=0.01)
    assert told.count("Zone “Wet floor” moved 0.02 m with the map.") == 6


def test_a_zone_does_not_move_with_poses_that_came_by_later(pose_ids: PoseIds) -> None:
    """The robot comes back beside the zone with drift, and the loop moves these poses alone."""
    held = Held()
    items = items_of(held)
    items.note_tick(pose_ids)
    old = len(pose_ids.poses)
    for step in range(5):
        pose_ids.id_of(Pose2(x_m=2.1 + 0.3 * step, y_m=0.4, yaw_rad=0.0))
    renamed = replace(held.stored[0], name="Spill", version=2)
    held.stored = (renamed, FAR)
    items.note_tick(pose_ids)
    later = {i: p for i, p in enumerate(pose_ids.poses) if i >= old}
    move(pose_ids, {i: replace(p, y_m=p.y_m + 0.5) for i, p in later.items()})
    assert items.note_tick(pose_ids, has_moved=True) == ()
    assert held.stored == (renamed, FAR)


def test_what_belongs_to_a_loaded_map_stays(pose_ids: PoseIds) -> None:
    held = Held()
    pose_ids.freeze()
    items = items_of(held)
    items.note_tick(pose_ids)
    assert shifted(items, pose_ids, 1.0) == ()
    assert held.stored == (ZONE, FAR)


def test_what_a_place_on_trial_has_moved_is_moved_back_with_the_map(pose_ids: PoseIds) -> None:
    held, before = Held(), pose_ids.array()
    items = items_of(held)
    items.note_tick(pose_ids)
    shifted(items, pose_ids, 0.4)
    pose_ids.restore(before, pose_ids.numbering)
    told = items.note_tick(pose_ids, has_moved=True)
    assert held.stored[0].polygon[0] == pytest.approx((2.0, 0.0))
    assert held.mission.queue[0].x_m == pytest.approx(2.0)
    assert told[0] == "Zone “Wet floor” moved 0.40 m with the map."
    anchor = held.stored[0].anchors[0]
    assert anchor.numbering == pose_ids.numbering
    assert anchor.poses == (), "the poses of before are constants now"


def test_nothing_is_looked_for_again_while_zones_and_goals_are_the_same(
    pose_ids: PoseIds, monkeypatch: pytest.MonkeyPatch
) -> None:
    held, asked = Held(), list[object]()
    items = items_of(held)
    for _ in range(2):  # at the second tick they are found to have theirs
        items.note_tick(pose_ids)
    zones, mission = held.stored, held.mission
    plain = held.anchor

    def anchor(anchored: Callable[[Zone], Zone]) -> None:
        asked.append(anchored)
        plain(anchored)

    monkeypatch.setattr(held, "anchor", anchor)
    items.note_tick(pose_ids)
    assert held.stored is zones and held.mission is mission and not asked
    held.stored = (*zones, replace(ZONE, id="n", polygon=((4.0, 0.0), (5.0, 0.0), (5.0, 1.0))))
    items.note_tick(pose_ids)
    assert len(asked) == 1 and is_anchored(held.stored[2], pose_ids.numbering)


def test_a_site_that_is_being_left_keeps_its_zones_where_they_are(pose_ids: PoseIds) -> None:
    class Left(Held):
        def move(self, placed: Callable[[Zone], Zone]) -> tuple[tuple[Zone, Zone], ...]:
            raise at_another_site()

        def anchor(self, anchored: Callable[[Zone], Zone]) -> None:
            raise at_another_site()

    items = items_of(Left())
    items.note_tick(pose_ids)
    assert shifted(items, pose_ids, 0.4) == ("Goal “Dock” moved 0.40 m with the map.",)


def test_what_is_drawn_between_two_ticks_belongs_to_the_map_of_the_newest(
    pose_ids: PoseIds,
) -> None:
    items = items_of(Held())
    assert items.anchored(ZONE) is ZONE, "there is no map yet"
    items.note_tick(pose_ids)
    drawn = items.anchored(ZONE)
    assert is_anchored(drawn, pose_ids.numbering)
    shifted(items, pose_ids, 0.4)
    assert items.placed(drawn).polygon[0] == pytest.approx((2.4, 0.0))
    items.begin(is_new=True)
    assert items.anchored(ZONE) is ZONE and items.placed(drawn) is drawn


def test_a_tick_that_ends_while_the_site_is_changed_moves_nothing(pose_ids: PoseIds) -> None:
    held = Held()
    items = items_of(held)
    items.note_tick(pose_ids)
    items.leave()
    assert shifted(items, pose_ids, 0.4) == () and held.stored == (ZONE, FAR)
    items.begin(is_new=False)
    assert shifted(items, pose_ids, 0.2)[0] == "Zone “Wet floor” moved 0.60 m with the map."
