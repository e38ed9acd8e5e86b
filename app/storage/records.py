"""Zones and goals as JSON for the store, and back. What an older version wrote stays readable:
later fields have defaults."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from navcore.mission.mission import Goal
from navcore.mission.zone import Zone, ZoneKind
from navcore.mission.zone_shapes import Circle, Corridor, Shape


def zone_record(zone: Zone) -> dict[str, Any]:
    """A zone as JSON."""
    record = {field.name: getattr(zone, field.name) for field in dataclasses.fields(Zone)}
    return {**record, "kind": str(zone.kind), "drawn": _shape_record(zone.drawn)}


def zone_of(record: Mapping[str, Any]) -> Zone:
    """The zone of a record."""
    fields = dict(record)
    fields["polygon"] = _corners(fields["polygon"])
    fields["kind"] = ZoneKind(fields.get("kind", ZoneKind.KEEP_OUT))
    fields["drawn"] = _shape_of(fields.get("drawn"))
    return Zone(**fields)


def goal_record(goal: Goal) -> dict[str, Any]:
    """A goal as JSON, but for its id."""
    return {"x_m": goal.x_m, "y_m": goal.y_m, "yaw_rad": goal.yaw_rad, "name": goal.name}


def goal_of(record: Mapping[str, Any]) -> Goal:
    """The goal of a record; it gets its id from the mission that takes it."""
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
