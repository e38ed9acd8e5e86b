"""What an edit of the beware list changes on the map beyond which points count: a colour rule is
applied to the points that the former one has found, and to the frames of the last minutes.

So the map after an edit is the one of the new list from the start, as far as these frames reach,
and the same computation gives the preview of an edit.
"""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable, Iterable
from typing import Protocol

import numpy as np

from app.console.recent_frames import RecentFrames
from navcore.config.navigator import NavigatorConfig
from navcore.costmap.costmap import Costmap
from navcore.errors import Refused
from navcore.grid.grid import BoolGrid, GridSpec, OccupancyGrid
from navcore.mapping.layers import least_confidence
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.coloured import is_taken
from navcore.mapping.points.erasing import Erased
from navcore.mapping.points.point_links import Records
from navcore.mapping.views.observation import Observation, observe
from navcore.mission.beware_list import BewareClass, BewareList, ColourRule
from navcore.perception.colour_segmenter import colour_masks, disjoint_layers, matches_colour
from navcore.perception.depth_filter import heights_above_floor
from navcore.perception.ground import ground_heights
from navcore.perception.labels import LabelSource, Segmenter

WAIT_S = 3.0
"""Longest wait of a preview for the thread of the map, seconds."""


class MapHolder(Protocol):
    """A holder of the map; `app.runtime.robot_controller.RobotController` is one."""

    def edit_map(self, edit: Callable[[PointMap], None]) -> None:
        """Have the thread of the map edit it, after the edits before."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class RuleChange:
    """Class whose colour rule is another one in the new list."""

    entry: BewareClass
    """Entry of the new list."""
    rule: ColourRule
    """Its rule."""
    before: ColourRule | None
    """Rule in use until now; None without one."""


class BewareMap:
    """Lets the map follow the colour rules, and previews that."""

    def __init__(
        self,
        holder: MapHolder,
        *,
        point_map: PointMap,
        recent: RecentFrames,
        segmenter: Segmenter,
        config: NavigatorConfig,
    ) -> None:
        """`point_map` is only read here."""
        self._holder, self._map, self._recent = holder, point_map, recent
        self._segmenter, self._config = segmenter, config

    def follow(
        self, before: BewareList, after: BewareList, put_back: Iterable[Erased] = ()
    ) -> list[Erased]:
        """Have the map follow another list before the next tick, and get back what an undone edit
        has removed; returns the list that will hold what this edit removes."""
        changes, restored = self._changes(before, after), tuple(put_back)
        removed: list[Erased] = []
        if not changes and not restored:
            return removed
        seen = self._seen([change.entry for change in changes])

        def edit(point_map: PointMap) -> None:
            removed.extend(
                point_map.forget_coloured(change.entry.class_id, change.rule, change.before)
                for change in changes
            )
            for erased in restored:
                point_map.put_back(erased)
            for past in _placed(point_map, seen):
                point_map.add_past(past)

        self._holder.edit_map(edit)
        return removed

    def grids(
        self, occupancy: Callable[[], Costmap | None], before: BewareList, after: BewareList
    ) -> tuple[OccupancyGrid, OccupancyGrid]:
        """Return the occupied cells of the newest map with the list in force and with another one.

        The thread of the map only copies the points of the list's classes; the rest is computed
        here. `occupancy` gives the costmap of the newest tick. Raises `Refused` without one.
        """
        changes = self._changes(before, after)
        seen = self._seen([change.entry for change in changes])
        taken: list[tuple[Costmap, Records, list[Records]]] = []
        done = threading.Event()

        def copy(point_map: PointMap) -> None:
            costmap = occupancy()
            if costmap is not None and costmap.spec == point_map.spec:
                taken.append((costmap, point_map.beware_points, _placed(point_map, seen)))
            done.set()

        self._holder.edit_map(copy)
        if not done.wait(WAIT_S) or not taken:
            raise Refused("there is no map now; the camera delivers no image")
        costmap, points, past = taken[0]
        stays = np.ones(len(points), dtype=np.bool_)
        for change in changes:
            found = (points["class_id"] == change.entry.class_id) & (points["confidence"] >= 1)
            stays[found] = is_taken(points[found], change.rule, change.before)
        points = np.concatenate([points[stays], *past])
        least = least_confidence(after, self._config.map.confidence.certain)
        counts = (points["cell"] >= 0) & (points["confidence"] >= least[points["class_id"]])
        points, present = points[counts], costmap.grid
        layers = {
            entry.class_id: _cells_of(points, entry.class_id, present.spec)
            for entry in after.enabled
        }
        margins_m = {entry.class_id: entry.margin_m for entry in after.enabled}
        return present, dataclasses.replace(present, beware=layers, margins_m=margins_m)

    def _changes(self, before: BewareList, after: BewareList) -> list[RuleChange]:
        old = {entry.class_id: self._rule_of(entry) for entry in before.classes}
        return [
            RuleChange(entry=entry, rule=rule, before=old.get(entry.class_id))
            for entry in after.classes
            if (rule := self._rule_of(entry)) is not None and rule != old.get(entry.class_id)
        ]

    def _rule_of(self, entry: BewareClass) -> ColourRule | None:
        """Return the colour rule of an entry if it is in use."""
        source = self._segmenter.source_of(entry)
        return entry.colour if source in (LabelSource.COLOUR, LabelSource.BOTH) else None

    def _seen(self, entries: list[BewareClass]) -> list[tuple[Observation, int]]:
        """Return what the recent frames show of the colour rules of some entries, each with the
        pose ID of its frame."""
        poses, spec, config = self._map.poses, self._map.spec, self._config
        beware, seen = BewareList(classes=tuple(entries)), []
        for one in self._recent.all if entries else ():
            if one.pose_id >= len(poses) or not any(
                entry.colour is not None and matches_colour(one.frame.rgb, entry.colour).any()
                for entry in entries
            ):
                continue
            frame = one.placed(poses)
            masks = colour_masks(frame, heights_above_floor(frame), entries, config.perception)
            if not masks:
                continue
            layers = disjoint_layers(masks, frame.depth_m.shape)
            labels = dataclasses.replace(layers[0], hypotheses=layers)
            labels = self._map.rejections.without(frame, labels)
            ground_m = ground_heights(frame, config.points.max_slope, config.perception.ground)
            observation = observe(frame, labels, beware, spec, config.points, ground_m)
            seen.append((observation, one.pose_id))
        return seen


def _placed(point_map: PointMap, seen: list[tuple[Observation, int]]) -> list[Records]:
    """Return the points of past frames on the present map, which another site may have replaced."""
    known = len(point_map.poses)
    return [point_map.past_points(*one) for one in seen if one[1] < known]


def _cells_of(points: Records, class_id: int, spec: GridSpec) -> BoolGrid:
    """Return the (rows, cols) cells that hold points of a class."""
    cells = np.zeros(spec.rows * spec.cols, dtype=np.bool_)
    cells[points["cell"][points["class_id"] == class_id]] = True
    return cells.reshape(spec.rows, spec.cols)
