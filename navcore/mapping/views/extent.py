"""The part of the map frame that the grid has to contain: the robot, what its camera measures, the
goal, and zones within reach."""

from __future__ import annotations

import math
from collections.abc import Iterable

import shapely

from navcore.compiled import compiled
from navcore.geometry.arrays import FloatImage
from navcore.geometry.camera import Pinhole, column_slope, row_slope
from navcore.geometry.transform import Matrix, Pose2
from navcore.grid.grid import Box, GridSpec
from navcore.grid.growth import hull, joined
from navcore.mapping.views.voxels import frustum_cells
from navcore.mission.zone import Zone
from navcore.mission.zone_growth import area_of
from navcore.robot.frame import Frame

Bounds = tuple[float, float, float, float]
"""(left, bottom, right, top) in metres of the map frame."""


def needed_part(
    spec: GridSpec,
    frame: Frame,
    *,
    body_m: float,
    reach_m: float,
    max_range_m: float,
    goal: tuple[float, float] | None,
    zones: Iterable[Zone],
) -> Box:
    """Return the part that contains the grid and what is needed now.

    That is the robot with `body_m` around it, the surfaces that the frame measures up to
    `max_range_m`, the goal (x, y), and what closed zones forbid within `reach_m` of the robot, all
    in metres of the map frame.
    """
    parts = [_around(spec, _square(frame.pose, body_m))]
    if goal is not None:
        parts.append(hull(spec, [spec.cell(*goal)]))
    if not _contains(spec, frustum_cells(frame, spec, max_range_m)):
        lens = frame.intrinsics.pinhole
        measured = measured_bounds(frame.depth_m, frame.T_map_camera, lens, max_range_m)
        if math.isfinite(measured[0]):
            parts.append(_around(spec, measured))
    near = _square(frame.pose, reach_m)
    if not _contains(spec, _around(spec, near)):
        parts += [
            _around(spec, forbidden)
            for zone in zones
            if (forbidden := _forbidden_within(zone, near)) is not None
        ]
    return joined(parts)


def permitted_part(part: Box, spec: GridSpec, zones: Iterable[Zone]) -> Box:
    """Return what is left of a part without the cells outside of stay-inside zones, where no path
    can lead; it contains the grid."""
    top, left, bottom, right = part
    for zone in zones:
        if zone.closed and zone.forbids_outside:
            under, before, above, behind = _around(spec, zone.bounds)
            top, left = max(top, under), max(left, before)
            bottom, right = min(bottom, above), min(right, behind)
    return min(top, 0), min(left, 0), max(bottom, spec.rows), max(right, spec.cols)


def _forbidden_within(zone: Zone, near: Bounds) -> Bounds | None:
    """Return the bounds of what a zone forbids within some bounds; None for nothing."""
    margin_m = zone.margin_m
    if not zone.closed:
        return None
    left, bottom, right, top = zone.bounds
    if zone.forbids_outside:
        square = shapely.box(*near).buffer(margin_m)
        return None if shapely.covers(area_of(zone), square) else near
    left, bottom = max(left - margin_m, near[0]), max(bottom - margin_m, near[1])
    right, top = min(right + margin_m, near[2]), min(top + margin_m, near[3])
    return (left, bottom, right, top) if left <= right and bottom <= top else None


def _square(pose: Pose2, reach_m: float) -> Bounds:
    return pose.x_m - reach_m, pose.y_m - reach_m, pose.x_m + reach_m, pose.y_m + reach_m


def _around(spec: GridSpec, bounds: Bounds) -> Box:
    left, bottom, right, top = bounds
    return hull(spec, [spec.cell(left, bottom), spec.cell(right, top)])


def _contains(spec: GridSpec, part: Box) -> bool:
    top, left, bottom, right = part
    return top >= 0 and left >= 0 and bottom <= spec.rows and right <= spec.cols


@compiled
def measured_bounds(
    depth_m: FloatImage, t: Matrix, lens: Pinhole, max_range_m: float
) -> tuple[float, float, float, float]:
    """Return the bounds in metres of the map frame of the surfaces that a depth image measures up
    to a depth; infinite for none."""
    left, bottom, right, top = math.inf, math.inf, -math.inf, -math.inf
    for i in range(depth_m.shape[0]):
        b = row_slope(i, lens)
        for j in range(depth_m.shape[1]):
            depth = float(depth_m[i, j])
            if not 0.0 < depth <= max_range_m:
                continue
            a = column_slope(j, lens)
            x = t[0, 3] + depth * (t[0, 0] * a + t[0, 1] * b + t[0, 2])
            y = t[1, 3] + depth * (t[1, 0] * a + t[1, 1] * b + t[1, 2])
            left, right = min(left, x), max(right, x)
            bottom, top = min(bottom, y), max(top, y)
    return left, bottom, right, top
