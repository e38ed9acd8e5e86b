"""What a draft would do to the path, tried on the newest map: nothing is applied."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from navcore.errors import BadGeometry
from navcore.geometry.transform import Pose2
from navcore.grid.grid import OccupancyGrid
from navcore.mission.zone import Zone, cells_of
from navcore.planning.path import NoPath, Path
from web.drafts import PathPreview, Preview

MOST_SUSPECTS = 8
"""Zones that are lifted one by one to see which of them cuts the goal off."""
Place = tuple[float, float]
Planner = Callable[[OccupancyGrid, tuple[Zone, ...]], PathPreview]
"""Plans between the two places over a grid; the zones are those whose speed limits count."""


def under(grid: OccupancyGrid, zones: tuple[Zone, ...]) -> OccupancyGrid:
    """The grid with these zones in the place of its own."""
    plain, wide = cells_of(zones, grid.spec)
    return dataclasses.replace(grid, zones=plain, wide_zones=wide)


def compared(
    grid: OccupancyGrid,
    zones: tuple[Zone, ...],
    plan: Planner,
    *,
    draft: Zone | None,
    replaces: str | None,
) -> Preview:
    """The path under the zones and the draft beside the path under the zones as they are stored.

    `draft` is added to `zones`, in the place of the one with the id `replaces`. Without one there
    is nothing to compare with.
    """
    drafted = tuple(zone for zone in zones if zone.id != replaces)
    drafted = drafted if draft is None else (*drafted, draft)
    path = plan(under(grid, drafted), drafted)
    present = None if draft is None and replaces is None else plan(under(grid, zones), zones)
    cut_by = blocking_zones(grid, drafted, plan, draft) if isinstance(path.outcome, NoPath) else ()
    return Preview(path=path, present=present, cut_by=cut_by)


def blocking_zones(
    grid: OccupancyGrid, zones: tuple[Zone, ...], plan: Planner, draft: Zone | None
) -> tuple[str, ...]:
    """The names of the zones that cut the goal off: the draft, if without it there is a path, else
    those whose lifting alone opens one, else all that lie on the way that would be taken without
    zones; none if it is not the zones that cut it off."""

    def opens(lifted: Zone) -> bool:
        left = tuple(zone for zone in zones if zone is not lifted)
        return isinstance(plan(under(grid, left), left).outcome, Path)

    if draft is not None and draft.closed and opens(draft):
        return (draft.name,)
    free = plan(under(grid, ()), ())
    if isinstance(free.outcome, NoPath):
        return ()
    suspects = [zone for zone in zones if zone.closed and _lies_on(zone, free.points, grid)]
    alone = [zone for zone in suspects[:MOST_SUSPECTS] if opens(zone)]
    return tuple(zone.name for zone in alone or suspects)


def _lies_on(zone: Zone, points: npt.NDArray[np.float64], grid: OccupancyGrid) -> bool:
    """Whether a zone lies within a metre of a path, its own margin added: as near as any robot's
    half width and margin."""
    corners = np.array(zone.polygon)
    low, high = corners.min(axis=0) - 1.0 - zone.margin_m, corners.max(axis=0) + 1.0 + zone.margin_m
    return bool(((points >= low) & (points <= high)).all(axis=1).any())


def place_on(grid: OccupancyGrid, place: Place, what: str) -> Place:
    """A place that is on the map; raises `BadGeometry` for one that is not."""
    if not grid.spec.contains(*place):
        raise BadGeometry(
            f"the {what} ({place[0]:g}, {place[1]:g}) lies outside the map, {grid.spec.extent()}"
        )
    return place


def standing_at(place: Place) -> Pose2:
    """A pose there; for paths the heading makes no difference."""
    return Pose2(x_m=place[0], y_m=place[1], yaw_rad=0.0)
