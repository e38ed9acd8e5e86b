"""Zones and goals that move with the map: those drawn while mapping belong to the poses beside
which they were drawn, and a correction of these poses takes them along.

Their anchors are stored before anything moves, by the outline and position of before and of after.
So a program that is killed before it has stored the corrected map finds every zone and goal where
the map that it loads has them (`app.console.site.stored_anchors`).
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

from navcore.errors import StorageFailed
from navcore.geometry.transform import Pose2
from navcore.mapping.points.pose_ids import PoseIds
from navcore.mission.anchors import Anchored, Anchors, Outline, Spot, anchored, moved_m, spot_of
from navcore.mission.mission import Goal, Mission
from navcore.mission.zone import Zone

MOST_GOALS = 1000
"""Number of anchored goals from which those that are neither queued nor saved are looked for and
forgotten."""
log = logging.getLogger(__name__)


class ZoneMoves(Protocol):
    """An editor of zones; `app.console.mission.zone_editor.ZoneEditor` is one."""

    @property
    def stored(self) -> tuple[Zone, ...]:
        """All zones."""

    @property
    def has_unmoved_sets(self) -> bool:
        """Whether sets of zones could not be stored where the map has them."""

    def move(self, placed: Callable[[Zone], Zone]) -> tuple[tuple[Zone, Zone], ...]:
        """Move zones because the map was corrected, and return each that moved, as it was and as it
        is; `placed` returns any zone of before where the correction has it."""


class MissionMoves(Protocol):
    """Saved missions; `app.console.mission.saved_missions.SavedMissions` is one."""

    def move(self, placed: Callable[[Goal], Goal]) -> None:
        """Move the goals of all missions because the map was corrected; raises `StorageFailed`."""

    def spots(self) -> frozenset[Spot]:
        """Return position and heading of the goals of all missions."""


class AnchoredItems:
    """Keeps the anchors of zones and goals, and moves them when the map is corrected; called by the
    think thread, but for `keep`."""

    def __init__(
        self,
        zones: Callable[[], ZoneMoves],
        saved: Callable[[], MissionMoves],
        mission: Callable[[], Mission],
        change_mission: Callable[[Callable[[Mission], Mission]], object],
        store: Callable[[Anchors], None],
    ) -> None:
        """`zones` and `saved` give those of the present site, and `store` stores the anchors there;
        it raises `StorageFailed`."""
        self._zones, self._saved, self._mission = zones, saved, mission
        self._change_mission, self._store = change_mission, store
        self._anchors = self._kept = Anchors()
        self._keeping = threading.Lock()

    def note_tick(
        self, pose_ids: PoseIds, *, is_corrected: bool = False, taken_back: bool = False
    ) -> tuple[str, ...]:
        """Move what a correction of the map has moved, or has moved back where the map was
        `taken_back` to what it was, and anchor what is new; returns a sentence for each item that
        moved."""
        told: tuple[str, ...] = ()
        if taken_back:
            # The poses of before are constants now, and the IDs after them are given anew.
            told = self._move(pose_ids.poses[: pose_ids.frozen])
            self.forget()
        elif is_corrected:
            told = self._move(pose_ids.poses)
        self._anchor_new(pose_ids)
        return told

    def forget(self) -> None:
        """Forget all anchors: the map, with the poses that they belong to, is another one now."""
        self._anchors = Anchors()

    def keep(self) -> None:
        """Store the anchors if they have changed; raises `StorageFailed`. Safe from any thread."""
        with self._keeping:
            anchors = self._anchors
            if anchors is not self._kept:
                self._store(anchors)
                self._kept = anchors

    def _anchor_new(self, pose_ids: PoseIds) -> None:
        before, poses, frozen = self._anchors, pose_ids.poses, pose_ids.frozen
        if before.numbering != pose_ids.numbering:
            before = Anchors(numbering=pose_ids.numbering)
        zones = {zone.polygon: zone for zone in self._zones().stored}
        goals = {spot_of(goal): goal for goal in self._mission().queue}
        if zones.keys() <= before.zones.keys() and goals.keys() <= before.goals.keys():
            return
        held_zones, held_goals = dict(before.zones), dict(before.goals)
        for outline in zones.keys() - held_zones.keys():
            held_zones[outline] = anchored(zones[outline], poses, frozen)
        for spot in goals.keys() - held_goals.keys():
            held_goals[spot] = anchored(goals[spot], poses, frozen)
        if len(held_goals) > MOST_GOALS:
            used = goals.keys() | self._saved().spots()
            held_goals = {spot: held for spot, held in held_goals.items() if spot in used}
        self._anchors = replace(before, zones=held_zones, goals=held_goals)

    def _move(self, poses: Sequence[Pose2]) -> tuple[str, ...]:
        """Move all zones and goals to where the poses of the map, by ID, have them now."""
        anchors = self._anchors
        self._anchors = _with_places_after(anchors, poses)
        try:
            self.keep()
        except StorageFailed:  # `keep` is called again, and tells
            log.exception("what zones and goals belong to is not stored yet")
        zones, told = self._move_zones(anchors, poses)
        goals, told_goals = self._move_goals(anchors, poses)
        self._anchors = replace(anchors, zones=zones, goals=goals)
        return (*told, *told_goals)

    def _move_zones(
        self, anchors: Anchors, poses: Sequence[Pose2]
    ) -> tuple[dict[Outline, Anchored[Zone] | None], list[str]]:
        """Move the zones; return the anchors of those that are held, and what to tell."""
        still_held = dict[Outline, Anchored[Zone] | None]()

        def placed(zone: Zone) -> Zone:
            there = anchors.zone_at(zone, poses)
            if zone.polygon in anchors.zones:
                still_held[there.polygon] = anchors.zones[zone.polygon]
            return there

        told = []
        for zone, there in self._zones().move(placed):
            distance_m = moved_m(zone, there)
            told.append(f"Zone “{zone.name}” moved {distance_m:.2f} m with the map.")
        if self._zones().has_unmoved_sets:
            return {**anchors.zones, **still_held}, told
        return still_held, told  # the others belong to no zone, edit or set any more

    def _move_goals(
        self, anchors: Anchors, poses: Sequence[Pose2]
    ) -> tuple[dict[Spot, Anchored[Goal] | None], list[str]]:
        """Move the goals; return the anchors of those that are held, and what to tell."""
        still_held = dict[Spot, Anchored[Goal] | None]()

        def placed(goal: Goal) -> Goal:
            there = anchors.goal_at(goal, poses)
            if spot_of(goal) in anchors.goals:
                still_held[spot_of(there)] = anchors.goals[spot_of(goal)]
            return there

        told = []
        for goal in self._mission().queue:
            if (there := placed(goal)) is not goal:
                distance_m = moved_m(goal, there)
                told.append(f"Goal {goal.title} moved {distance_m:.2f} m with the map.")
        if told:
            # By where each is at that moment: an operator may have put it elsewhere.
            self._change_mission(
                lambda mission: replace(mission, queue=tuple(map(placed, mission.queue)))
            )
        try:
            self._saved().move(placed)
        except StorageFailed:
            log.exception("saved missions could not be moved with the map yet")
            return {**anchors.goals, **still_held}, told
        return still_held, told


def _with_places_after(anchors: Anchors, poses: Sequence[Pose2]) -> Anchors:
    """Return anchors by the outlines and positions of before and of after a move."""
    zones, goals = dict(anchors.zones), dict(anchors.goals)
    for held in anchors.zones.values():
        if held is not None:
            zones[held.at(poses).polygon] = held
    for of_goal in anchors.goals.values():
        if of_goal is not None:
            goals[spot_of(of_goal.at(poses))] = of_goal
    return replace(anchors, zones=zones, goals=goals)
