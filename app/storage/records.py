"""Conversion of zones and goals to JSON and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from navcore.geometry.transform import Pose2
from navcore.mission.anchor import Anchor, Place
from navcore.mission.anchors import Item, anchors_of, place_of
from navcore.mission.mission import Goal
from navcore.mission.zone import Zone, ZoneKind
from navcore.mission.zone_shapes import Circle, Corridor, Shape

ANCHORS = "anchors"
"""Key of the anchors in a record."""


def zone_record(zone: Zone) -> dict[str, Any]:
    """Convert a zone to JSON."""
    return {
        "id": zone.id,
        "name": zone.name,
        "polygon": zone.polygon,
        "enabled": zone.enabled,
        "margin_m": zone.margin_m,
        "version": zone.version,
        "kind": str(zone.kind),
        "max_speed_mps": zone.max_speed_mps,
        "colour": zone.colour,
        "expires_at_s": zone.expires_at_s,
        "drawn": _shape_record(zone.drawn),
        **_anchors_record(zone),
    }


def zone_of(record: Mapping[str, Any]) -> Zone:
    """Convert a record to a zone."""
    converted = {
        "polygon": _corners(record["polygon"]),
        "kind": ZoneKind(record["kind"]),
        "drawn": _shape_of(record["drawn"]),
    }
    plain = {name: value for name, value in record.items() if name != ANCHORS}
    return _with_anchors(Zone(**{**plain, **converted}), record)


def goal_record(goal: Goal) -> dict[str, Any]:
    """Convert a goal to JSON, without its id."""
    return {
        "x_m": goal.x_m,
        "y_m": goal.y_m,
        "yaw_rad": goal.yaw_rad,
        "name": goal.name,
        **_anchors_record(goal),
    }


def goal_of(record: Mapping[str, Any]) -> Goal:
    """Convert a record to a goal; without an id in it, the mission that takes the goal gives it
    one."""
    plain = {name: value for name, value in record.items() if name != ANCHORS}
    return _with_anchors(Goal(**{"id": 0, **plain}), record)


def _anchors_record(item: Zone | Goal) -> dict[str, Any]:
    """Return the anchors that tell where an item is, the newest first, if there are any."""
    here = place_of(item)
    anchors = [
        {
            "numbering": one.numbering,
            "poses": [[n, pose.x_m, pose.y_m, pose.yaw_rad] for n, pose in one.poses],
            # Left out where the item has not moved since.
            "drawn": None if one.drawn == here else _place_record(one.drawn),
        }
        for one in anchors_of(item)
        if one.poses
    ]
    return {ANCHORS: anchors} if anchors else {}


def _with_anchors(item: Item, record: Mapping[str, Any]) -> Item:
    here = place_of(item)
    anchors = tuple(
        Anchor(
            numbering=one["numbering"],
            poses=tuple((n, Pose2(x_m=x, y_m=y, yaw_rad=yaw)) for n, x, y, yaw in one["poses"]),
            drawn=here if one["drawn"] is None else _place_of(one["drawn"]),
            place=here,
        )
        for one in record.get(ANCHORS, ())
    )
    return replace(item, anchors=anchors)


def _place_record(place: Place) -> dict[str, Any]:
    return {
        "outline": place.outline,
        "shape": _shape_record(place.shape),
        "yaw_rad": place.yaw_rad,
    }


def _place_of(record: Mapping[str, Any]) -> Place:
    return Place(
        outline=_corners(record["outline"]),
        shape=_shape_of(record["shape"]),
        yaw_rad=record["yaw_rad"],
    )


def _shape_record(shape: Shape | None) -> dict[str, Any] | None:
    if isinstance(shape, Circle):
        return {"circle": shape.centre, "radius_m": shape.radius_m}
    return None if shape is None else {"corridor": shape.line, "width_m": shape.width_m}


def _shape_of(record: Mapping[str, Any] | None) -> Shape | None:
    if record is None:
        return None
    if "circle" in record:
        x_m, y_m = record["circle"]
        return Circle(centre=(x_m, y_m), radius_m=record["radius_m"])
    return Corridor(line=_corners(record["corridor"]), width_m=record["width_m"])


def _corners(pairs: Any) -> tuple[tuple[float, float], ...]:
    return tuple((x_m, y_m) for x_m, y_m in pairs)
