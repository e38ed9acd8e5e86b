"""What of the grid stands near the robot, as points of its base frame, and what of it the
operator's rules forbid."""

from __future__ import annotations

import math
from collections.abc import Iterable

import cv2
import numpy as np
import numpy.typing as npt

from navcore.geometry.arrays import Points
from navcore.geometry.transform import Pose2
from navcore.grid.grid import BoolGrid, GridSpec, OccupancyGrid, inflate_by
from navcore.mission.zone import Zone, rasterise
from navcore.robot.profile import RobotProfile


def obstacle_masks(grid: OccupancyGrid) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """(rows, cols) masks: geometric cells, and cells of beware classes and zones, grown by their
    own margins."""
    ruled, by_margin = grid.zones.copy(), dict[float, npt.NDArray[np.bool_]]()
    layers = [
        *((grid.margins_m.get(class_id, 0.0), layer) for class_id, layer in grid.beware.items()),
        *grid.wide_zones,
    ]
    for margin_m, layer in layers:
        if layer.any():
            by_margin[margin_m] = by_margin[margin_m] | layer if margin_m in by_margin else layer
    for margin_m, layer in by_margin.items():
        ruled |= inflate_by(layer, margin_m, grid.spec.resolution_m)
    return grid.geometric, ruled


def nearby(mask: npt.NDArray[np.bool_], grid: OccupancyGrid, pose: Pose2, reach_m: float) -> Points:
    """(N, 2) centres of marked cells within a square of `reach_m` around the robot, in the base
    frame."""
    row, col = grid.spec.cell(pose.x_m, pose.y_m)
    reach = math.ceil(reach_m / grid.spec.resolution_m)
    top, left = max(row - reach, 0), max(col - reach, 0)
    cells = np.argwhere(mask[top : max(row + reach + 1, 0), left : max(col + reach + 1, 0)])
    return np.ascontiguousarray(pose.from_parent(grid.spec.centres(cells + np.array([top, left]))))


def footprint_overlaps(ruled: Points, profile: RobotProfile, cell_m: float) -> bool:
    """Whether the footprint covers the middle part of any cell that the operator's rules forbid,
    base frame."""
    return not bool(outside(ruled, profile, -cell_m / 2).all())


def split_areas(
    grid: OccupancyGrid, zones: Iterable[Zone], profile: RobotProfile, pose: Pose2
) -> tuple[list[BoolGrid], BoolGrid]:
    """(rows, cols) each, with their margins: the areas that the footprint stands in, one by one,
    and all others in one.

    Each zone is an area, and so is whatever of one beware class is connected. So a thing inside a
    zone, or a zone that overlaps it, stays one of the others, and a cell may belong to both.
    `zones` are all that count: the grid's own are merged.
    """
    spec, cell_m = grid.spec, grid.spec.resolution_m
    others = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
    under: list[BoolGrid] = []
    if not others.size:
        return under, others
    body = _footprint_cells(spec, profile, pose)
    for class_id, layer in grid.beware.items():
        if not layer.any():
            continue
        margin_m = grid.margins_m.get(class_id, 0.0)
        _, things = cv2.connectedComponents(layer.view(np.uint8), connectivity=8)
        numbers = np.unique(things[inflate_by(body, margin_m, cell_m) & layer])
        under += [inflate_by(things == number, margin_m, cell_m) for number in numbers]
        others |= inflate_by(layer & ~np.isin(things, numbers), margin_m, cell_m)
    for zone in zones:
        if not zone.closed or not _reaches(zone, spec):
            continue
        area = inflate_by(rasterise(zone.polygon, spec), zone.margin_m, cell_m)
        if (area & body).any():
            under.append(area)
        else:
            others |= area
    return under, others


def _footprint_cells(spec: GridSpec, profile: RobotProfile, pose: Pose2) -> BoolGrid:
    """(rows, cols) the cells whose middle the footprint covers, and those that its border runs
    through."""
    pixels = (
        pose.to_parent(profile.footprint()) - np.array([spec.origin_x_m, spec.origin_y_m])
    ) / spec.resolution_m - 0.5
    body = np.zeros((spec.rows, spec.cols), dtype=np.uint8)
    cv2.fillConvexPoly(body, np.round(pixels * 256).astype(np.int32), 1, shift=8)
    return body.view(np.bool_)


def _reaches(zone: Zone, spec: GridSpec) -> bool:
    """Whether a zone's bounding box, with its margin, comes upon the grid at all."""
    low, high = (
        np.min(zone.polygon, axis=0) - zone.margin_m,
        np.max(zone.polygon, axis=0) + zone.margin_m,
    )
    right, top = (
        spec.origin_x_m + spec.cols * spec.resolution_m,
        spec.origin_y_m + spec.rows * spec.resolution_m,
    )
    return bool(
        low[0] <= right
        and low[1] <= top
        and high[0] >= spec.origin_x_m
        and high[1] >= spec.origin_y_m
    )


def frontier(known: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """(rows, cols) the unseen cells beside a known one."""
    beside = cv2.dilate(known.view(np.uint8), np.ones((3, 3), dtype=np.uint8)).view(np.bool_)
    return np.asarray(beside & ~known)


def outside(points: Points, profile: RobotProfile, padding_m: float) -> npt.NDArray[np.bool_]:
    """(N,) points outside the footprint grown by the padding, or shrunk where it is negative."""
    return np.asarray(
        (np.abs(points[:, 0]) > profile.length_m / 2 + padding_m)
        | (np.abs(points[:, 1]) > profile.width_m / 2 + padding_m)
    )
