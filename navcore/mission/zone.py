"""Zones: areas that the operator draws on the map.

A keep-out zone counts as a wall in every later stage, and so does all that lies outside of a
stay-inside zone; in a speed-limit zone the robot drives slowly (`control/speed_limits.py`).
"""

from __future__ import annotations

import functools
import itertools
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields
from enum import StrEnum

import numpy as np
from shapely.geometry import Polygon
from shapely.validation import explain_validity

from navcore.errors import BadGeometry, CrossedOutline
from navcore.geometry.polyline import Corners
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.mission.anchor import Anchor
from navcore.mission.zone_cells import rasterise
from navcore.mission.zone_shapes import Shape

MIN_AREA_M2 = 1e-3
"""Smallest area of a zone in square metres."""
MAX_CORNERS = 1000
"""Largest number of corners of a zone."""
FARTHEST_M = 10_000.0
"""Largest coordinate of a corner of a zone in metres."""
MAX_ZONE_MARGIN_M = 2.0
"""Largest margin of a zone in metres."""
MIN_LIMIT_MPS, MAX_LIMIT_MPS = 0.05, 5.0
"""Range of speed limits in metres per second."""
CROSSING = re.compile(r"\[(\S+) (\S+)\]")
"""The position in a reason of shapely, such as `Self-intersection[1.5 2]`."""
COLOUR = re.compile(r"#[0-9a-f]{6}")
OWN_COLOUR = "#8a929e"
"""Colour of the zones that the robot closes for itself for a while."""


class ZoneKind(StrEnum):
    """Rule that holds in a zone."""

    KEEP_OUT = "keep-out"
    """No part of the robot may be in the zone."""
    STAY_INSIDE = "stay-inside"
    """No part of the robot may be outside of the zone: the boundary of a site."""
    SPEED_LIMIT = "speed-limit"
    """The robot drives no faster than the limit while any part of it is in the zone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ZoneSpec:
    """Area of the map frame and the rule that holds in it."""

    name: str
    """Name that the operator gave it."""
    polygon: tuple[tuple[float, float], ...]
    """Corners (x, y) in metres of the map frame, in order, the first not repeated."""
    enabled: bool = True
    """Whether the rule holds; a disabled zone stays stored."""
    margin_m: float = 0.0
    """Clearance in metres beyond the robot's own margin."""
    kind: ZoneKind = ZoneKind.KEEP_OUT
    """Rule that holds in the zone."""
    max_speed_mps: float | None = None
    """Speed limit in metres per second; None for other zones."""
    colour: str | None = None
    """Colour `#rrggbb` in the console; None for the default."""
    expires_at_s: float | None = None
    """Time at which the zone is disabled, in seconds since 1970 (UTC) of the robot's calendar
    clock; None for never."""
    drawn: Shape | None = None
    """Shape that the polygon was made from; None for a zone drawn corner by corner."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Zone(ZoneSpec):
    """Stored area of the map frame in which a rule of the operator holds."""

    id: str
    """Unique id, made by the store."""
    version: int = 1
    """Version that grows with every edit; the ETag of HTTP."""
    further: tuple[Corners, ...] = ()
    """Further outlines of a zone that is grown by the uncertainty of the robot's position: those of
    the other parts of a stay-inside zone, or of the holes of another zone."""
    anchors: tuple[Anchor, ...] = field(default=(), compare=False, repr=False)
    """Poses that the zone belongs to, in the numbering of the map and of those before, the newest
    first; none before that is looked for."""

    @classmethod
    def of(cls, spec: ZoneSpec, *, zone_id: str, version: int) -> Zone:
        """Return the zone with an id, a version, and the area and rule of `spec`."""
        shared = {field.name: getattr(spec, field.name) for field in fields(ZoneSpec)}
        return cls(id=zone_id, version=version, **shared)

    @property
    def closed(self) -> bool:
        """Whether the zone forbids an area now: its inside, or all that lies outside of it."""
        return self.enabled and self.kind is not ZoneKind.SPEED_LIMIT

    @property
    def forbids_outside(self) -> bool:
        """Whether the forbidden area is all that lies outside of the zone."""
        return self.kind is ZoneKind.STAY_INSIDE

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """(left, bottom, right, top) of all outlines in metres of the map frame."""
        x, y = zip(*itertools.chain(self.polygon, *self.further), strict=True)
        return min(x), min(y), max(x), max(y)


def check_rules(zone: Zone) -> None:
    """Raise `BadGeometry` for the first value of a zone, except its polygon, that is out of
    range."""
    if not 0 <= zone.margin_m <= MAX_ZONE_MARGIN_M:
        raise BadGeometry(
            f"zone margin {zone.margin_m:g} m is out of range, allowed 0 to {MAX_ZONE_MARGIN_M:g} m"
        )
    if zone.colour is not None and COLOUR.fullmatch(zone.colour) is None:
        raise BadGeometry("zone colour must be #rrggbb in small hexadecimal digits")
    if (zone.kind is ZoneKind.SPEED_LIMIT) != (zone.max_speed_mps is not None):
        raise BadGeometry("a speed limit needs max_speed_mps, other zones have none")
    if zone.max_speed_mps is not None and not MIN_LIMIT_MPS <= zone.max_speed_mps <= MAX_LIMIT_MPS:
        raise BadGeometry(
            f"max_speed_mps {zone.max_speed_mps:g} is out of range, allowed {MIN_LIMIT_MPS:g} to "
            f"{MAX_LIMIT_MPS:g} m/s"
        )


def zone_masks(
    zones: Iterable[Zone], spec: GridSpec
) -> tuple[BoolGrid, tuple[tuple[float, BoolGrid], ...]]:
    """Return the cells that the enabled keep-out and stay-inside zones forbid: (rows, cols) of
    those without a margin, and (margin in metres, (rows, cols)) for each margin of the others."""
    plain, wide = np.zeros((spec.rows, spec.cols), dtype=np.bool_), dict[float, BoolGrid]()
    for zone in zones:
        if not zone.closed:
            continue
        mask = forbidden_cells(zone, spec)
        if zone.margin_m == 0:
            plain |= mask
        else:
            wide[zone.margin_m] = wide[zone.margin_m] | mask if zone.margin_m in wide else mask
    return plain, tuple(wide.items())


def forbidden_cells(zone: Zone, spec: GridSpec) -> BoolGrid:
    """Return the (rows, cols) cells that a zone forbids, without its margin: those that it touches,
    or those that it does not contain as a whole."""
    further = (rasterise(outline, spec, whole=True) for outline in zone.further)
    if zone.forbids_outside:
        allowed = rasterise(zone.polygon, spec, whole=True)
        return np.logical_not(functools.reduce(np.logical_or, further, allowed))
    return functools.reduce(np.greater, further, rasterise(zone.polygon, spec))


def check_polygon(
    corners: Sequence[Sequence[float]], what: str = "zone"
) -> tuple[tuple[float, float], ...]:
    """Return the corners as a simple polygon, without the closing corner; raises `BadGeometry` with
    the reason, in which `what` names what the polygon is of."""
    if len(corners) > MAX_CORNERS:
        raise BadGeometry(f"{what} has {len(corners)} corners, at most {MAX_CORNERS} are allowed")
    if any(len(corner) != 2 for corner in corners):
        raise BadGeometry(f"{what} corners must be (x, y) pairs in metres")
    points = [(float(x), float(y)) for x, y in corners]
    if not np.isfinite(np.array(points)).all():
        raise BadGeometry(f"{what} has a corner that is not finite; give metres of the map frame")
    if len(points) > 1 and points[0] == points[-1]:
        points.pop()
    if len(set(points)) < 3:
        raise BadGeometry(
            f"{what} has {len(set(points))} distinct corners, a polygon needs at least 3"
        )
    polygon = Polygon(points)
    if not polygon.is_valid:
        raise _crossed(polygon, what)
    if polygon.area < MIN_AREA_M2:
        raise BadGeometry(
            f"{what} covers {polygon.area:g} m², at least {MIN_AREA_M2:g} m² are needed"
        )
    for x_m, y_m in points:
        if max(abs(x_m), abs(y_m)) > FARTHEST_M:
            raise BadGeometry(
                f"{what} corner ({x_m:g}, {y_m:g}) is out of range, allowed {-FARTHEST_M:g} to "
                f"{FARTHEST_M:g} m"
            )
    return tuple(points)


def _crossed(polygon: Polygon, what: str) -> BadGeometry:
    """Return the refusal of an invalid polygon, with the position where its outline crosses or
    touches itself."""
    found = CROSSING.search(explain_validity(polygon))
    if found is None:
        return BadGeometry(f"the outline of the {what} crosses itself; move a corner")
    x_m, y_m = float(found[1]), float(found[2])
    return CrossedOutline(
        f"the outline of the {what} crosses itself at ({x_m:.2f}, {y_m:.2f}); move a corner",
        (x_m, y_m),
    )
