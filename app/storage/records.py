"""Conversion of zones and goals to JSON and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from navcore.mission.mission import Goal
from navcore.mission.zone import Zone, ZoneKind
from navcore.mission.zone_shapes import Circle, Corridor, Shape


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
    }


def zone_of(record: Mapping[str, Any]) -> Zone:
    """Convert a record to a zone."""
    converted = {
        "polygon": _corners(record["polygon"]),
        "kind": ZoneKind(record["kind"]),
        "drawn": _shape_of(record["drawn"]),
    }
    return Zone(**{**record, **converted})


def goal_record(goal: Goal) -> dict[str, Any]:
    """Convert a goal to JSON, without its id."""
    return {"x_m": goal.x_m, "y_m": goal.y_m, "yaw_rad": goal.yaw_rad, "name": goal.name}


def goal_of(record: Mapping[str, Any]) -> Goal:
    """Convert a record to a goal; the mission that takes the goal gives it an id."""
    return Goal(id=0, **record)


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
