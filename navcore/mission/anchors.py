"""Zones and goals that move with the map: those drawn while mapping belong to the poses beside
which they were drawn, and move with them when those are corrected.

The move is rigid and always computed from the item as it was drawn, so that corrections to and fro
bring it back exactly, and that any state of the map, also an older one on disk, tells where the
item is in it. Items far from every pose, or beside a pose of the loaded map, stay.
"""

from __future__ import annotations

import dataclasses
from typing import TypeVar

import numpy as np
import shapely

from navcore.geometry.arrays import Points
from navcore.geometry.transform import IDENTITY, Pose2, wrap_angle
from navcore.mission.anchor import Anchor, NumberedPoses, Place
from navcore.mission.mission import Goal
from navcore.mission.zone import Zone
from navcore.mission.zone_shapes import Circle, Shape

Item = TypeVar("Item", Zone, Goal)

REACH_M = 6.0
"""Distance in metres from an item within which a pose is beside it: about as far
as the camera measures."""
MOST_POSES = 5
"""Number of the nearest poses that an item belongs to."""
MOST_EARLIER = 7
"""Number of the maps before, of those that had poses beside an item, that its anchors tell of."""
LEAST_M = 0.01
"""Distance in metres below which an item stays where it is, from where its poses have it: a
correction that moves it less adds to the next."""


def anchored(item: Item, poses: NumberedPoses, reach_m: float = REACH_M) -> Item:
    """Return an item with an anchor in the numbering of the poses; the same one where it has it.

    Where no pose is within `reach_m`, and where the nearest one is a constant, the item stays. Its
    anchor in a numbering before is kept.
    """
    if is_anchored(item, poses.numbering):
        return item
    here = place_of(item)
    new = Anchor(
        numbering=poses.numbering,
        poses=tuple((n, poses.poses[n]) for n in _beside(here, poses, reach_m)),
        drawn=here,
        place=here,
    )
    earlier: tuple[Anchor, ...] = tuple(one for one in anchors_of(item) if one.poses)
    return dataclasses.replace(item, anchors=(new, *earlier[:MOST_EARLIER]))


def placed(item: Item, poses: NumberedPoses) -> Item:
    """Return an item where the poses of a map have it; the same one where it stays."""
    for one in anchors_of(item):
        known = poses.of(one.numbering) if one.poses else None
        if known is not None:
            there = moved(one.drawn, one.motion(known))
            is_still = moved_m(place_of(item), there) < LEAST_M
            return item if is_still else at_place(item, there)
    return item


def anchors_of(item: Zone | Goal) -> tuple[Anchor, ...]:
    """Return the anchors of an item, the newest first; none where an operator has put the item
    elsewhere since."""
    here = place_of(item)
    return tuple(one for one in item.anchors if one.place == here)


def is_anchored(item: Zone | Goal, numbering: str) -> bool:
    """Return whether an item has an anchor in a numbering of poses."""
    return any(one.numbering == numbering for one in anchors_of(item)[:1])


def place_of(item: Zone | Goal) -> Place:
    """Return where an item is."""
    if isinstance(item, Goal):
        return Place(outline=((item.x_m, item.y_m),), yaw_rad=item.yaw_rad)
    return Place(outline=item.polygon, shape=item.drawn)


def at_place(item: Item, place: Place) -> Item:
    """Return an item at another place, to which its poses have brought it."""
    anchors = tuple(dataclasses.replace(one, place=place) for one in anchors_of(item))
    if isinstance(item, Goal):
        ((x_m, y_m),) = place.outline
        return dataclasses.replace(item, x_m=x_m, y_m=y_m, yaw_rad=place.yaw_rad, anchors=anchors)
    return dataclasses.replace(item, polygon=place.outline, drawn=place.shape, anchors=anchors)


def moved(place: Place, motion: Pose2) -> Place:
    """Return a place after a rigid motion of the map frame; the same one for no motion."""
    if motion == IDENTITY:
        return place
    yaw = None if place.yaw_rad is None else wrap_angle(place.yaw_rad + motion.yaw_rad)
    if place.shape is not None:
        shape = _moved_shape(place.shape, motion)
        return Place(outline=shape.outline(), shape=shape, yaw_rad=yaw)
    return Place(outline=_pairs(motion.to_parent(place.corners)), yaw_rad=yaw)


def moved_m(before: Place, after: Place) -> float:
    """Return the largest distance in metres between a corner, or the position of a goal, at two
    places."""
    return float(np.linalg.norm(after.corners - before.corners, axis=1).max())


def _beside(place: Place, poses: NumberedPoses, reach_m: float) -> list[int]:
    """Return the IDs of the poses that an item belongs to, the nearest first."""
    if not poses.poses:
        return []
    corners = place.corners
    area = shapely.Point(*corners[0]) if len(corners) == 1 else shapely.Polygon(corners)
    spots = shapely.points([(pose.x_m, pose.y_m) for pose in poses.poses])
    away = shapely.distance(area, spots)
    nearest = np.argsort(away, kind="stable")[:MOST_POSES].tolist()
    if nearest[0] < poses.frozen:
        return []
    return [n for n in nearest if n >= poses.frozen and away[n] <= reach_m]


def _moved_shape(shape: Shape, motion: Pose2) -> Shape:
    if isinstance(shape, Circle):
        (centre,) = _pairs(motion.to_parent(np.array([shape.centre])))
        return dataclasses.replace(shape, centre=centre)
    return dataclasses.replace(shape, line=_pairs(motion.to_parent(np.array(shape.line))))


def _pairs(points: Points) -> tuple[tuple[float, float], ...]:
    return tuple((float(x), float(y)) for x, y in points)
