"""Zones and goals that move with the map: those drawn while mapping belong to the poses beside
which they were drawn, and a correction of these poses takes them along."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

from navcore.localisation.map_correction import AppliedCorrection
from navcore.mapping.points.pose_ids import PoseIds
from navcore.mission.anchors import Anchored, anchored, moved_m
from navcore.mission.mission import Goal, Mission
from navcore.mission.zone import Zone

LEAST_M = 0.01
"""Distance in metres below which an item stays where it is, from where its poses have it: a
correction that moves it less adds to the next."""
Outline = tuple[tuple[float, float], ...]
GoalKey = tuple[int, float, float, float | None]


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


class AnchoredItems:
    """Keeps the anchors of zones and goals, and moves them when the map is corrected; called by the
    think thread."""

    def __init__(
        self,
        zones: Callable[[], ZoneMoves],
        mission: Callable[[], Mission],
        change_mission: Callable[[Callable[[Mission], Mission]], object],
    ) -> None:
        """`zones` gives the editor of the present site."""
        self._zones, self._mission, self._change_mission = zones, mission, change_mission
        self._zone_anchors: dict[Outline, Anchored[Zone] | None] = {}
        self._goal_anchors: dict[GoalKey, Anchored[Goal] | None] = {}

    def note_tick(self, correction: AppliedCorrection | None, pose_ids: PoseIds) -> tuple[str, ...]:
        """Move what a correction of the map has moved, and anchor what is new; returns a sentence
        for each item that moved."""
        told: list[str] = []
        if correction is not None:
            of_goals = self._move_goals(correction)
            told = [*self._move_zones(correction), *of_goals]
        poses, frozen = pose_ids.poses, pose_ids.frozen
        # By outline, so that edits and zone sets that hold the same one move with it.
        for zone in self._zones().stored:
            if zone.polygon not in self._zone_anchors:
                self._zone_anchors[zone.polygon] = anchored(zone, poses, frozen)
        goals = {_key(goal): goal for goal in self._mission().queue}
        if goals.keys() != self._goal_anchors.keys():
            self._goal_anchors = {
                key: self._goal_anchors[key]
                if key in self._goal_anchors
                else anchored(goal, poses, frozen)
                for key, goal in goals.items()
            }
        return tuple(told)

    def forget(self) -> None:
        """Forget all anchors: the map, with the poses that they belong to, is another one now."""
        self._zone_anchors, self._goal_anchors = {}, {}

    def _move_zones(self, correction: AppliedCorrection) -> list[str]:
        anchors, still_held = self._zone_anchors, dict[Outline, Anchored[Zone] | None]()

        def placed(zone: Zone) -> Zone:
            there, held = zone, anchors.get(zone.polygon)
            if held is not None:
                as_drawn = replace(zone, polygon=held.item.polygon, drawn=held.item.drawn)
                there = replace(held, item=as_drawn).at(correction.after)
                if moved_m(zone, there) < LEAST_M:
                    there = zone
            if zone.polygon in anchors:
                still_held[there.polygon] = held
            return there

        told = []
        for zone, there in self._zones().move(placed):
            distance_m = moved_m(zone, there)
            told.append(f"Zone “{zone.name}” moved {distance_m:.2f} m with the map.")
        if self._zones().has_unmoved_sets:
            for outline, held in anchors.items():
                still_held.setdefault(outline, held)
        # The others belong to no zone, edit or set any more.
        self._zone_anchors = still_held
        return told

    def _move_goals(self, correction: AppliedCorrection) -> list[str]:
        moved: dict[GoalKey, Goal] = {}
        told = []
        for goal in self._mission().queue:
            held = self._goal_anchors.get(_key(goal))
            if held is None:
                continue
            as_queued = replace(held.item, id=goal.id, name=goal.name)
            there = replace(held, item=as_queued).at(correction.after)
            if (distance_m := moved_m(goal, there)) >= LEAST_M:
                moved[_key(goal)] = there
                self._goal_anchors[_key(there)] = held
                told.append(f"Goal {goal.title} moved {distance_m:.2f} m with the map.")
        if moved:

            def follow(goal: Goal) -> Goal:
                """Return the goal where it is now, unless an operator has put it elsewhere since it
                was read."""
                there = moved.get(_key(goal))
                return goal if there is None else replace(there, name=goal.name)

            self._change_mission(
                lambda mission: replace(mission, queue=tuple(map(follow, mission.queue)))
            )
        return told


def _key(goal: Goal) -> GoalKey:
    return goal.id, goal.x_m, goal.y_m, goal.yaw_rad
