"""What an edit of the beware list changes on the map beyond which points count: a colour rule is
applied to the points that the former one has found, and to the frames of the last minutes.

So the map after an edit is the one of the new list from the start, as far as these frames reach,
and the same computation gives the preview of an edit.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from typing import Protocol

import numpy as np

from app.console.beware.recent_frames import RecentFrame, RecentFrames
from app.console.map_reading import MapHolder, read_map
from navcore.config.navigator import NavigatorConfig
from navcore.costmap.costmap import Costmap
from navcore.geometry.arrays import FloatImage
from navcore.grid.grid import BoolGrid, GridSpec, OccupancyGrid
from navcore.mapping.layers import least_confidence
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.coloured import PastView
from navcore.mapping.points.erasing import Erased
from navcore.mapping.points.point_links import Records
from navcore.mapping.points.point_table import POINT
from navcore.mapping.views.observation import Observation, observe
from navcore.mission.beware_list import BewareClass, BewareList, ColourRule
from navcore.perception.colour_segmenter import colour_masks, disjoint_layers, matches_colour
from navcore.perception.depth_filter import heights_above_floor
from navcore.perception.ground import ground_heights
from navcore.perception.labels import Labels, LabelSource, Segmenter, only_coloured
from navcore.perception.prototype import prototype_labels
from navcore.robot.frame import Frame

NO_POINTS = np.zeros(0, dtype=POINT)


class FrameDescriber(Protocol):
    """Frames with their features; `app.console.beware.examples.LiveExamples` is one."""

    def spread(self) -> Sequence[RecentFrame]:
        """Return some of the frames of the last minutes; none where no network runs."""

    def described(self, frame: Frame) -> FloatImage:
        """Return the (h, w, D) descriptors of a frame."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class RuleChange:
    """Class whose colour rule is another one in the new list."""

    entry: BewareClass
    """Entry of the new list."""
    rule: ColourRule | None
    """Its rule; None where none is in use any more."""
    before: ColourRule | None
    """Rule in use until now; None without one."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PastLook:
    """What a frame of the last minutes shows under new rules."""

    observation: Observation
    """Its points."""
    of: RecentFrame
    """The frame."""


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
        examples: FrameDescriber,
    ) -> None:
        """`point_map` is only read here."""
        self._holder, self._map, self._recent = holder, point_map, recent
        self._segmenter, self._config, self._examples = segmenter, config, examples

    def follow(
        self, before: BewareList, after: BewareList, put_back: list[Erased] | None = None
    ) -> list[Erased]:
        """Have the map follow another list before the next tick, and get back what an undone edit
        has removed, the list that the call for that edit has returned; returns the list that will
        hold what this edit removes."""
        changes, removed = self._changes(before, after), list[Erased]()
        new = self._new_examples(before, after)
        if not changes and put_back is None and not new:
            return removed
        seen = self._seen(_ruled(changes)) + self._seen_by_example(new)

        def edit(point_map: PointMap) -> None:
            past = self._past_view(point_map, seen)
            removed.extend(
                point_map.edits.forget_coloured(
                    change.entry.class_id, change.rule, change.before, past
                )
                for change in changes
            )
            # Only now: the map may not have followed the undone edit when this one was asked for.
            for erased in put_back or ():
                point_map.edits.put_back(erased)
            point_map.edits.add_past(past.points)

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
        seen = self._seen(_ruled(changes))
        seen += self._seen_by_example(self._new_examples(before, after))

        def copy(point_map: PointMap) -> tuple[Costmap, Records, PastView] | None:
            costmap = occupancy()
            if costmap is None or costmap.spec != point_map.spec:
                return None
            return costmap, point_map.edits.beware_points, self._past_view(point_map, seen)

        costmap, points, past = read_map(self._holder, copy)
        stays = np.ones(len(points), dtype=np.bool_)
        for change in changes:
            found = (points["class_id"] == change.entry.class_id) & (points["confidence"] >= 1)
            stays[found] = self._map.edits.is_taken(points[found], change.rule, change.before, past)
        points = np.concatenate([points[stays], past.points])
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
            if (rule := self._rule_of(entry)) != old.get(entry.class_id)
        ]

    def _rule_of(self, entry: BewareClass) -> ColourRule | None:
        """Return the colour rule of an entry if it is in use."""
        source = self._segmenter.source_of(entry)
        return entry.colour if source in (LabelSource.COLOUR, LabelSource.BOTH) else None

    def _past_view(self, point_map: PointMap, seen: list[PastLook]) -> PastView:
        """Return the recent frames on the present map, which another site may have replaced, and
        the points that they show."""
        poses = point_map.poses
        frames = tuple(one.placed(poses) for one in self._recent.all if one.pose_id < len(poses))
        points = [
            point_map.edits.past_points(
                look.observation, look.of.pose_id, look.of.T_map_id, look.of.erasures
            )
            for look in seen
            if look.of.pose_id < len(poses)
        ]
        return PastView(frames=frames, points=np.concatenate([NO_POINTS, *points]))

    def _seen(self, entries: list[BewareClass]) -> list[PastLook]:
        """Return what the recent frames show of the colour rules of some entries, oldest first: a
        voxel belongs to the first pose that measured it."""
        poses, config = self._map.poses, self._config
        beware, seen = BewareList(classes=tuple(entries)), []
        for one in self._recent.all[::-1] if entries else ():
            if one.pose_id >= len(poses) or not any(
                entry.colour is not None and matches_colour(one.frame.rgb, entry.colour).any()
                for entry in entries
            ):
                continue
            frame = one.frame
            masks = colour_masks(frame, heights_above_floor(frame), entries, config.perception)
            if not masks:
                continue
            layers = disjoint_layers(masks, frame.depth_m.shape)
            labels = only_coloured(dataclasses.replace(layers[0], hypotheses=layers), frame)
            seen.append(PastLook(observation=self._observed(one, labels, beware), of=one))
        return seen

    def _new_examples(self, before: BewareList, after: BewareList) -> list[BewareClass]:
        """Return the entries whose example is new; those that come back have their points still."""
        old = {entry.class_id: entry.prototype for entry in before.classes}
        known = before.names
        return [
            entry
            for entry in after.classes
            if self._segmenter.source_of(entry) is LabelSource.PROTOTYPE
            and entry.prototype != old.get(entry.class_id)
            and (entry.class_id in old or entry.class_id not in known)
        ]

    def _seen_by_example(self, entries: list[BewareClass]) -> list[PastLook]:
        """Return what some of the recent frames show of entries by example."""
        beware, seen, poses = BewareList(classes=tuple(entries)), [], self._map.poses
        for one in self._examples.spread() if entries else ():
            if one.pose_id >= len(poses):
                continue
            frame, settings = one.frame, self._config.perception.prototype
            labels = prototype_labels(frame, self._examples.described(frame), entries, settings)
            if labels.class_ids.any():
                seen.append(PastLook(observation=self._observed(one, labels, beware), of=one))
        return seen

    def _observed(self, one: RecentFrame, labels: Labels, beware: BewareList) -> Observation:
        """Return what labels of a frame put on the map, at its capture, but for what is rejected
        now."""
        config, frame = self._config, one.frame
        labels = self._map.rejections.without(one.placed(self._map.poses), labels)
        ground_m = ground_heights(frame, config.points.max_slope, config.perception.ground)
        return observe(frame, labels, beware, self._map.spec, config.points, ground_m)


def _ruled(changes: Iterable[RuleChange]) -> list[BewareClass]:
    return [change.entry for change in changes if change.rule is not None]


def _cells_of(points: Records, class_id: int, spec: GridSpec) -> BoolGrid:
    """Return the (rows, cols) cells that hold points of a class."""
    cells = np.zeros(spec.rows * spec.cols, dtype=np.bool_)
    cells[points["cell"][points["class_id"] == class_id]] = True
    return cells.reshape(spec.rows, spec.cols)
