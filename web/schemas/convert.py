"""Snapshots of the system as answers of the API."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from navcore.mission.beware_list import BewareClass, BewareList
from navcore.mission.mission import Goal
from navcore.mission.zone import Zone
from navcore.mission.zone_shapes import Circle, Shape
from web.images import palette
from web.interface.operations import RobotService
from web.interface.snapshots import State
from web.schemas.responses import (
    BewareClassOut,
    BewareOut,
    CircleOut,
    ColourRuleOut,
    CorridorOut,
    GoalOut,
    MissionOut,
    PolygonOut,
    PoseOut,
    ReasonOut,
    StateOut,
    TwistOut,
    ZoneOut,
    ZonePropertiesOut,
    ZonesOut,
)

MAX_TRACK = 2000
"""Points of a polyline in an answer; a longer one is thinned, its ends kept."""


def state_of(operations: RobotService) -> StateOut:
    """The newest state, and which versions of the large values belong to it."""
    state, picture = operations.state(), operations.picture()
    small = {
        field.name: getattr(state, field.name)
        for field in dataclasses.fields(State)
        if field.name not in ("reasons", "pose", "twist", "command", "queue", "reached", "phase")
    }
    return StateOut(
        **small,
        phase=str(state.phase),
        reasons=[ReasonOut(code=reason.cause, text=reason.text) for reason in state.reasons],
        pose=PoseOut(x_m=state.pose.x_m, y_m=state.pose.y_m, yaw_rad=state.pose.yaw_rad),
        twist=TwistOut(v_mps=state.twist.v_mps, w_radps=state.twist.w_radps),
        command=TwistOut(v_mps=state.command.v_mps, w_radps=state.command.w_radps),
        queue=goals(state.queue),
        reached=goals(state.reached),
        picture_serial=picture.serial if picture else None,
        grid_version=picture.grid_version if picture else None,
    )


def mission_of(state: State) -> MissionOut:
    """The goals of a state."""
    return MissionOut(
        phase=str(state.phase),
        queue=goals(state.queue),
        reached=goals(state.reached),
        loop=state.loop,
    )


def goals(values: Iterable[Goal]) -> list[GoalOut]:
    """Goals in order."""
    return [
        GoalOut(id=goal.id, x_m=goal.x_m, y_m=goal.y_m, yaw_rad=goal.yaw_rad, name=goal.name)
        for goal in values
    ]


def zone_of(zone: Zone) -> ZoneOut:
    """A GeoJSON Feature, ring closed."""
    return ZoneOut(
        id=zone.id,
        geometry=PolygonOut(coordinates=[[*zone.polygon, zone.polygon[0]]]),
        properties=ZonePropertiesOut(
            name=zone.name,
            enabled=zone.enabled,
            margin_m=zone.margin_m,
            kind=str(zone.kind),
            max_speed_mps=zone.max_speed_mps,
            colour=zone.colour,
            expires_at_s=zone.expires_at_s,
            drawn=_drawn(zone.drawn),
            version=zone.version,
        ),
    )


def zones_of(operations: RobotService) -> ZonesOut:
    """All zones as a FeatureCollection, and what can be taken back."""
    history = operations.zones.history
    return ZonesOut(
        features=[zone_of(zone) for zone in operations.zones.stored],
        undo=history.undo,
        redo=history.redo,
    )


def _drawn(shape: Shape | None) -> CircleOut | CorridorOut | None:
    if isinstance(shape, Circle):
        return CircleOut(coordinates=shape.centre, radius_m=shape.radius_m)
    return (
        None if shape is None else CorridorOut(coordinates=list(shape.line), width_m=shape.width_m)
    )


def beware_of(beware: BewareList, operations: RobotService) -> BewareOut:
    """The list with the console's colours, and what finds each class."""
    classes = [_class_of(entry, str(operations.beware.finder(entry))) for entry in beware.classes]
    return BewareOut(version=beware.version, classes=classes, can_undo=operations.beware.can_undo)


def track(points: npt.NDArray[np.float64]) -> list[tuple[float, float]]:
    """A polyline, thinned to `MAX_TRACK` points, rounded to millimetres; points that are none are
    left out."""
    if len(points) > MAX_TRACK:
        points = points[np.linspace(0, len(points) - 1, MAX_TRACK).round().astype(int)]
    finite = points[np.isfinite(points).all(axis=1)]
    return [(x, y) for x, y in np.round(finite, 3).tolist()]


def finite(value: Any) -> Any:
    """A report as JSON can carry it: figures that are none become null."""
    if isinstance(value, Mapping):
        return {str(key): finite(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _class_of(entry: BewareClass, found_by: str) -> BewareClassOut:
    rule = entry.colour
    return BewareClassOut(
        name=entry.name,
        class_id=entry.class_id,
        enabled=entry.enabled,
        margin_m=entry.margin_m,
        min_confidence=entry.min_confidence,
        colour=None if rule is None else ColourRuleOut(**dataclasses.asdict(rule)),
        min_height_m=entry.min_height_m,
        max_height_m=entry.max_height_m,
        min_size_m=entry.min_size_m,
        label=entry.label,
        display=palette.hex_colour(palette.class_colour(entry.class_id)),
        found_by=found_by,
    )
