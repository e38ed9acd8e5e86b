"""Zones and goals that move with the map: those drawn while mapping belong to the poses beside
which they were drawn, and a correction of these poses takes them along.

Their anchors are stored with them, so that they are found where the map that is loaded has them,
whatever of both was stored last (`app.console.site.placing`).
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Protocol

from navcore.errors import OtherSite
from navcore.mapping.points.pose_ids import PoseIds
from navcore.mission.anchor import NO_POSES
from navcore.mission.anchors import (
    Item,
    anchored,
    is_anchored,
    moved_m,
    place_of,
    placed,
)
from navcore.mission.mission import Mission
from navcore.mission.zone import Zone


class ItemAnchors(Protocol):
    """What anchors an item that is drawn, and places one that was; `AnchoredItems` is one."""

    def anchored(self, item: Item) -> Item:
        """Return an item, which is drawn or saved now, with its anchor."""

    def placed(self, item: Item) -> Item:
        """Return an item that was stored where the map has it now."""


class Unanchored:
    """Leaves every item where it is."""

    def anchored(self, item: Item) -> Item:
        """Return the item."""
        return item

    def placed(self, item: Item) -> Item:
        """Return the item."""
        return item


class ZoneMoves(Protocol):
    """An editor of zones; `app.console.mission.zone_editor.ZoneEditor` is one."""

    @property
    def stored(self) -> tuple[Zone, ...]:
        """All zones."""

    def move(self, placed: Callable[[Zone], Zone]) -> tuple[tuple[Zone, Zone], ...]:
        """Move zones because the map was corrected, and return each that moved, as it was and as it
        is; `placed` returns any zone where the correction has it."""

    def anchor(self, anchored: Callable[[Zone], Zone]) -> None:
        """Give zones the anchors with which `anchored` returns them."""


class AnchoredItems:
    """Anchors zones and goals, and moves them when the map is corrected. The think thread, which
    changes the map, calls `note_tick`; the other methods are safe from any."""

    def __init__(
        self,
        zones: Callable[[], ZoneMoves],
        mission: Callable[[], Mission],
        change_mission: Callable[[Callable[[Mission], Mission]], object],
    ) -> None:
        """`zones` gives the editor of the present site."""
        self._zones, self._mission, self._change_mission = zones, mission, change_mission
        self._poses, self._is_left = NO_POSES, False
        self._seen: tuple[object, ...] = None, None, None

    def anchored(self, item: Item) -> Item:
        """Return an item, which is drawn or saved now, with its anchor in the map of the newest
        tick."""
        poses = self._poses
        return item if poses is NO_POSES else anchored(item, poses)

    def placed(self, item: Item) -> Item:
        """Return an item that was stored where the map of the newest tick has it."""
        return placed(item, self._poses)

    def note_tick(self, pose_ids: PoseIds, *, has_moved: bool = False) -> tuple[str, ...]:
        """Anchor what is new, and where the map `has_moved`, by a correction or because it was
        taken back to what it was, move what belongs to it; returns a sentence for each item that
        moved."""
        if self._is_left:
            return ()
        self._poses = pose_ids.numbered
        told = (*self._move_zones(), *self._move_goals()) if has_moved else ()
        self._anchor_new()
        return told

    def leave(self) -> None:
        """Expect another map, and other items: the tick that runs now is still on the map before,
        and what it moves stays where it is, until these are loaded again."""
        self._is_left = True

    def begin(self, *, is_new: bool) -> None:
        """Go on after `leave`, on the same map or on a new one, which the next tick is on."""
        self._is_left = False
        if is_new:
            self._poses = NO_POSES

    def _anchor_new(self) -> None:
        zones, queue, numbering = self._zones(), self._mission().queue, self._poses.numbering
        seen = numbering, zones.stored, queue
        if all(new is old for new, old in zip(seen, self._seen, strict=True)):
            return
        if not all(is_anchored(zone, numbering) for zone in zones.stored):
            with suppress(OtherSite):  # they are those of another one from the next tick on
                zones.anchor(self.anchored)
        if not all(is_anchored(goal, numbering) for goal in queue):
            self._change_mission(
                lambda mission: replace(mission, queue=tuple(map(self.anchored, mission.queue)))
            )
        self._seen = seen

    def _move_zones(self) -> list[str]:
        told = list[str]()
        with suppress(OtherSite):  # when they are loaded again, the map tells where they are
            for zone, there in self._zones().move(self.placed):
                distance_m = moved_m(place_of(zone), place_of(there))
                told.append(f"Zone “{zone.name}” moved {distance_m:.2f} m with the map.")
        return told

    def _move_goals(self) -> list[str]:
        told = []
        for goal in self._mission().queue:
            if (there := self.placed(goal)) is not goal:
                distance_m = moved_m(place_of(goal), place_of(there))
                told.append(f"Goal {goal.title} moved {distance_m:.2f} m with the map.")
        if told:
            # By where each is at that moment: an operator may have put it elsewhere.
            self._change_mission(
                lambda mission: replace(mission, queue=tuple(map(self.placed, mission.queue)))
            )
        return told
