"""Preview of the effect of a draft on the path, planned on the newest map; nothing is applied."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from navcore.errors import BadGeometry
from navcore.geometry.arrays import Floats, Points
from navcore.geometry.polyline import length_m
from navcore.geometry.transform import Pose2
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import GridSpec, OccupancyGrid
from navcore.grid.growth import is_possible, padded, reaching
from navcore.mission.mission import Goal, checked
from navcore.mission.zone import Zone, zone_masks
from navcore.planning.path import NoPath, Path
from navcore.planning.route import Route
from navcore.planning.unseen_parts import unseen_m, unseen_parts
from web.interface.beware import ListPreview
from web.interface.drafts import PathPreview, Preview

MAX_GOALS = 20
"""Largest number of waiting goals to which a preview of a list plans."""
MAX_SINGLE_ZONES = 8
"""Largest number of zones that are removed one by one to find those that cut the goal off."""
Position = tuple[float, float]
"""(x, y) in metres of the map frame."""
Planner = Callable[[OccupancyGrid, tuple[Zone, ...]], PathPreview]
"""Plans from start to goal on a grid; the speed limits of the zones determine the travel time."""


def measured(
    route: Route,
    zones: tuple[Zone, ...],
    travel_time_s: Callable[[Points, tuple[Zone, ...]], float],
    seen: CellMask,
    spec: GridSpec,
) -> PathPreview:
    """Return the preview of a route.

    Metres and seconds are both those of the smoothed path that the robot would follow, so that a
    path which is longer takes longer, unless a speed limit has changed. Cells would turn by 45° at
    each bend, and paths of the same length would seem to differ by seconds.
    """
    if isinstance(route.outcome, NoPath):
        return PathPreview(outcome=route.outcome, points=route.points, length_m=None, time_s=None)
    return PathPreview(
        outcome=route.outcome,
        points=route.points,
        length_m=length_m(route.track),
        time_s=travel_time_s(route.track, zones),
        unseen_m=unseen_m(route.points, unseen_parts(route.points, seen, spec)),
    )


def kept_zones(zones: tuple[Zone, ...], grown: tuple[Zone, ...]) -> tuple[Zone, ...]:
    """Return the zones as the robot keeps out of them, by those of its newest tick, which are grown
    by the uncertainty of its position; a zone that has changed since is as it was drawn."""
    known = {(zone.id, zone.version): zone for zone in grown}
    return tuple(known.get((zone.id, zone.version), zone) for zone in zones)


def with_zones(grid: OccupancyGrid, zones: tuple[Zone, ...]) -> OccupancyGrid:
    """Return the grid with these zones instead of its own."""
    plain, wide = zone_masks(zones, grid.spec)
    return dataclasses.replace(grid, zones=plain, wide_zones=wide)


def compare(
    grid: OccupancyGrid,
    zones: tuple[Zone, ...],
    plan: Planner,
    *,
    draft: Zone | None,
    replaces: str | None,
    in_force: Planner | None = None,
) -> Preview:
    """Plan with the stored zones and the draft and, for comparison, with the stored zones alone.

    `draft` is added to `zones`, instead of the zone with the id `replaces`. `in_force` plans with
    the settings in force, where `plan` has others. Without any of these there is no comparison.
    """
    drafted = tuple(zone for zone in zones if zone.id != replaces)
    drafted = drafted if draft is None else (*drafted, draft)
    path = plan(with_zones(grid, drafted), drafted)
    is_changed = draft is not None or replaces is not None or in_force is not None
    present = (in_force or plan)(with_zones(grid, zones), zones) if is_changed else None
    cut_by = blocking_zones(grid, drafted, plan, draft) if isinstance(path.outcome, NoPath) else ()
    return Preview(path=path, present=present, cut_by=cut_by)


def compare_lists(
    present: OccupancyGrid,
    drafted: OccupancyGrid,
    zones: tuple[Zone, ...],
    plan_to: Callable[[Position], Planner],
    goals: Sequence[Goal],
) -> ListPreview:
    """Compare the grid of the beware list in force with that of another one: the cells, the path to
    the first goal, and the goals that would be cut off."""
    before_m, after_m = (_kept_clear_m(grid) for grid in (present, drafted))
    before, after = before_m >= 0, after_m >= 0
    spec = present.spec
    cells = ListPreview(
        appear=spec.centres(np.argwhere(after & ~before)),
        go=spec.centres(np.argwhere(before & ~after)),
        nearer=int((after & (after_m < before_m)).sum()),
    )
    if not goals:
        return cells
    paths: list[tuple[PathPreview, PathPreview]] = []
    for goal in goals[:MAX_GOALS]:
        plan, at = plan_to((goal.x_m, goal.y_m)), (goal.x_m, goal.y_m)
        old, new = (
            plan(with_zones(grid_with(grid, [at]), zones), zones) for grid in (present, drafted)
        )
        paths.append((old, new))
    cut_off = tuple(
        goal.title
        for goal, (old, new) in zip(goals, paths, strict=False)
        if isinstance(old.outcome, Path) and isinstance(new.outcome, NoPath)
    )
    return dataclasses.replace(cells, present=paths[0][0], path=paths[0][1], cut_off=cut_off)


def _kept_clear_m(grid: OccupancyGrid) -> Floats:
    """Return the (rows, cols) margin of each occupied cell beyond the robot's own, in metres, and
    −1 for free cells. What has no class any more, but height, is an obstacle still."""
    margins_m = np.where(grid.geometric, 0.0, -1.0)
    for class_id, layer in grid.beware.items():
        margin_m = grid.margins_m.get(class_id, 0.0)
        margins_m = np.where(layer, np.maximum(margins_m, margin_m), margins_m)
    return margins_m


def blocking_zones(
    grid: OccupancyGrid, zones: tuple[Zone, ...], plan: Planner, draft: Zone | None
) -> tuple[str, ...]:
    """Return the names of the zones that cut the goal off.

    The draft alone if its removal opens a path, else each zone whose removal alone does, else all
    zones near the path that would be taken without zones; none if zones are not the cause.
    """

    def opens(removed: Zone) -> bool:
        left = tuple(zone for zone in zones if zone is not removed)
        return isinstance(plan(with_zones(grid, left), left).outcome, Path)

    if draft is not None and draft.closed and opens(draft):
        return (draft.name,)
    free = plan(with_zones(grid, ()), ())
    if isinstance(free.outcome, NoPath):
        return ()
    near = [zone for zone in zones if zone.closed and _is_near(zone, free.points)]
    alone = [zone for zone in near[:MAX_SINGLE_ZONES] if opens(zone)]
    return tuple(zone.name for zone in alone or near)


def _is_near(zone: Zone, points: npt.NDArray[np.float64]) -> bool:
    """Return whether the bounding box of a zone, grown by a metre and the zone's margin, contains a
    point of a path; no robot has a larger half width and margin."""
    left, bottom, right, top = zone.bounds
    within_m = 1.0 + zone.margin_m
    low, high = (left - within_m, bottom - within_m), (right + within_m, top + within_m)
    return bool(((points >= low) & (points <= high)).all(axis=1).any())


def grid_with(grid: OccupancyGrid, positions: Sequence[Position]) -> OccupancyGrid:
    """Return the grid, grown to contain some positions; raises `BadGeometry` for positions to which
    it cannot grow."""
    for number, (x_m, y_m) in enumerate(positions, start=1):
        checked(Goal(id=number, x_m=x_m, y_m=y_m), grid.spec)
    if not is_possible(reaching(grid.spec, positions)):
        raise BadGeometry("start and goal are too far apart for a map that contains both")
    return padded(grid, positions)


def pose_at(position: Position) -> Pose2:
    """Return a pose at a position; paths do not depend on the heading."""
    return Pose2(x_m=position[0], y_m=position[1], yaw_rad=0.0)
