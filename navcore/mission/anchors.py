"""Anchors: zones and goals that were drawn while mapping belong to the poses beside which they were
drawn, and move with them when those are corrected.

The move is rigid and always computed from the item as it was drawn, so that corrections to and fro
bring it back exactly, and that any state of the map, also an older one, tells where the item is in
it. Items far from every pose, or beside a pose of the loaded map, have no anchor and stay.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np
import shapely

from navcore.geometry.arrays import Points
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.mission.mission import Goal
from navcore.mission.zone import Zone
from navcore.mission.zone_shapes import Circle, Shape

Item = TypeVar("Item", Zone, Goal)
Outline = tuple[tuple[float, float], ...]
"""Corners (x, y) of a zone in metres of the map frame."""
Spot = tuple[float, float, float | None]
"""x and y in metres and heading in radians of a goal."""

REACH_M = 6.0
"""Distance in metres from an item within which a pose is beside it: about as far
as the camera measures."""
MOST_POSES = 5
"""Number of the nearest poses that an item belongs to."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Anchor:
    """Poses beside which an item was drawn."""

    poses: tuple[tuple[int, Pose2], ...]
    """Pose ID and T_map_base at that time, the nearest first."""
    centre: tuple[float, float]
    """Middle (x, y) of the item in metres of the map frame at that time."""

    def motion(self, poses: Sequence[Pose2]) -> Pose2:
        """Return the rigid motion of the map frame since the item was drawn, from the present poses
        by ID: the mean of the motions of the anchor's poses at the item's middle. Those that a
        map does not have yet are left out; without any there is no motion."""
        middle, identity = np.array(self.centre), True
        moved, turns = [], []
        for pose_id, then in self.poses:
            if pose_id >= len(poses):
                continue
            now = poses[pose_id]
            identity = identity and now == then
            moved.append((now @ then.inverse()).to_parent(middle))
            turns.append(wrap_angle(now.yaw_rad - then.yaw_rad))
        if identity:  # of none, too
            return Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
        turn = math.atan2(sum(map(math.sin, turns)), sum(map(math.cos, turns)))
        rotation = Pose2(x_m=0.0, y_m=0.0, yaw_rad=turn)
        x, y = np.mean(moved, axis=0) - rotation.to_parent(middle)
        return Pose2(x_m=float(x), y_m=float(y), yaw_rad=turn)


@dataclass(frozen=True, slots=True, kw_only=True)
class Anchored(Generic[Item]):
    """Zone or goal as it was drawn, with the poses that it belongs to."""

    item: Item
    """Item as drawn."""
    anchor: Anchor
    """Poses beside it at that time."""

    def at(self, poses: Sequence[Pose2]) -> Item:
        """Return the item for the present poses by ID."""
        return moved(self.item, self.anchor.motion(poses))


LEAST_M = 0.01
"""Distance in metres below which an item stays where it is, from where its poses have it: a
correction that moves it less adds to the next."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Anchors:
    """Zones and goals with their anchors, by where they are now. By outline and position, so that
    edits, sets and missions that hold the same one move with it, and one that was edited does
    not."""

    numbering: str = ""
    """Numbering of the poses, `PoseIds.numbering`."""
    zones: Mapping[Outline, Anchored[Zone] | None] = field(default_factory=dict)
    """By outline; None for one that stays."""
    goals: Mapping[Spot, Anchored[Goal] | None] = field(default_factory=dict)
    """By position and heading; None for one that stays."""

    def zone_at(self, zone: Zone, poses: Sequence[Pose2]) -> Zone:
        """Return a zone for the poses of a map by ID; the same one where it stays."""
        held = self.zones.get(zone.polygon)
        if held is None:
            return zone
        as_drawn = dataclasses.replace(zone, polygon=held.item.polygon, drawn=held.item.drawn)
        return _unless_still(zone, dataclasses.replace(held, item=as_drawn).at(poses))

    def goal_at(self, goal: Goal, poses: Sequence[Pose2]) -> Goal:
        """Return a goal for the poses of a map by ID; the same one where it stays."""
        held = self.goals.get(spot_of(goal))
        if held is None:
            return goal
        as_queued = dataclasses.replace(held.item, id=goal.id, name=goal.name)
        return _unless_still(goal, dataclasses.replace(held, item=as_queued).at(poses))


def spot_of(goal: Goal) -> Spot:
    """Return position and heading of a goal."""
    return goal.x_m, goal.y_m, goal.yaw_rad


def anchored(
    item: Item, poses: Sequence[Pose2], frozen: int, reach_m: float = REACH_M
) -> Anchored[Item] | None:
    """Return an item, which is drawn now, with its anchor; None if no pose is within `reach_m`, or
    the nearest one is a constant.

    `poses`: T_map_base by pose ID. `frozen`: number of the first of them that are constants, those
    of a loaded map.
    """
    if not poses:
        return None
    corners = corners_of(item)
    area = shapely.Point(*corners[0]) if len(corners) == 1 else shapely.Polygon(corners)
    away = shapely.distance(area, shapely.points([(pose.x_m, pose.y_m) for pose in poses]))
    nearest = np.argsort(away, kind="stable")[:MOST_POSES].tolist()
    if nearest[0] < frozen:
        return None
    beside = tuple((n, poses[n]) for n in nearest if n >= frozen and away[n] <= reach_m)
    if not beside:
        return None
    x, y = ((corners.min(axis=0) + corners.max(axis=0)) / 2).tolist()
    return Anchored(item=item, anchor=Anchor(poses=beside, centre=(x, y)))


def moved(item: Item, motion: Pose2) -> Item:
    """Return an item after a rigid motion of the map frame; the same one for no motion."""
    if motion == Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0):
        return item
    if isinstance(item, Goal):
        x, y = motion.to_parent(np.array([item.x_m, item.y_m])).tolist()
        yaw = None if item.yaw_rad is None else wrap_angle(item.yaw_rad + motion.yaw_rad)
        return dataclasses.replace(item, x_m=x, y_m=y, yaw_rad=yaw)
    if item.drawn is not None:
        shape = _moved_shape(item.drawn, motion)
        return dataclasses.replace(item, drawn=shape, polygon=shape.outline())
    return dataclasses.replace(item, polygon=_pairs(motion.to_parent(np.array(item.polygon))))


def _unless_still(item: Item, there: Item) -> Item:
    return item if moved_m(item, there) < LEAST_M else there


def moved_m(before: Item, after: Item) -> float:
    """Return the largest distance in metres between a corner of an item, or a goal, at two
    places."""
    return float(np.linalg.norm(corners_of(after) - corners_of(before), axis=1).max())


def corners_of(item: Zone | Goal) -> Points:
    """Return the (N, 2) corners of a zone, or the one position of a goal, metres of the map
    frame."""
    corners = ((item.x_m, item.y_m),) if isinstance(item, Goal) else item.polygon
    return np.array(corners, dtype=np.float64)


def _moved_shape(shape: Shape, motion: Pose2) -> Shape:
    if isinstance(shape, Circle):
        (centre,) = _pairs(motion.to_parent(np.array([shape.centre])))
        return dataclasses.replace(shape, centre=centre)
    return dataclasses.replace(shape, line=_pairs(motion.to_parent(np.array(shape.line))))


def _pairs(points: Points) -> tuple[tuple[float, float], ...]:
    return tuple((float(x), float(y)) for x, y in points)
