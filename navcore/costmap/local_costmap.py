"""Local costmap: obstacles near the robot as points of its base frame, and the cells that the
operator's rules forbid."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator

import cv2
import numpy as np
import numpy.typing as npt
import shapely

from navcore.compiled import compiled
from navcore.config.safety import DEFAULT_SAFETY
from navcore.geometry.arrays import Bools, Floats, Indices, Points
from navcore.geometry.transform import Pose2
from navcore.grid.grid import BoolGrid, GridSpec, OccupancyGrid, inflate_by
from navcore.mission.zone import Zone, forbidden_cells
from navcore.mission.zone_growth import GrownZone, area_of, grow, kept_distances
from navcore.robot.profile import RobotProfile

_SQUARE = np.ones((3, 3), dtype=np.uint8)


def obstacle_masks(
    grid: OccupancyGrid, *, people: Collection[int] = ()
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Return two (rows, cols) masks: geometric cells, and forbidden cells, which are those of
    beware classes and zones inflated by their own margins, but for the class ids of `people`
    (`people_mask`)."""
    forbidden, by_margin = grid.zones.copy(), dict[float, npt.NDArray[np.bool_]]()
    for margin_m, layer in _with_margins(grid, people):
        if layer.any():
            by_margin[margin_m] = by_margin[margin_m] | layer if margin_m in by_margin else layer
    for margin_m, layer in by_margin.items():
        forbidden |= inflate_by(layer, margin_m, grid.spec.resolution_m)
    return grid.geometric, forbidden


def _with_margins(grid: OccupancyGrid, people: Collection[int]) -> Iterator[tuple[float, BoolGrid]]:
    """Yield the margin in metres and the (rows, cols) cells of each layer that may have one."""
    for class_id, layer in grid.beware.items():
        if class_id not in people:
            yield grid.margins_m.get(class_id, 0.0), layer
    yield from grid.wide_zones
    yield from grid.uncertain


def bare_cells(grid: OccupancyGrid, *, people: Collection[int] = ()) -> npt.NDArray[np.bool_]:
    """Return the (rows, cols) cells of beware classes and zones without their margins, but for the
    class ids of `people`."""
    found = grid.zones.copy()
    for class_id, layer in grid.beware.items():
        if class_id not in people:
            found |= layer
    for _, layer in grid.wide_zones:
        found |= layer
    return found


def margins_left(
    grid: OccupancyGrid, profile: RobotProfile, pose: Pose2, people: Collection[int] = ()
) -> BoolGrid:
    """Return the (rows, cols) cells of the margins around a robot at a pose that some of them
    reach: from such a thing, connected cells, it keeps the distance that it has, wherever along it,
    and from all others the whole margin."""
    left = np.zeros_like(grid.zones)
    for margin_m, layer in _with_margins(grid, people):
        if margin_m > 0.0 and layer.any():
            _, things = cv2.connectedComponents(layer.view(np.uint8), connectivity=8)
            edge = layer & ~cv2.erode(layer.view(np.uint8), _SQUARE).view(np.bool_)
            cells = np.argwhere(edge)
            centres = grid.spec.centres(cells)
            now_m = profile.distances_m(pose.from_parent(centres))
            objects = things[tuple(cells.T)].astype(np.int64)
            kept_m = kept_distances(now_m, np.full(len(cells), margin_m), objects)
            # What is masked reaches up to the body, so that it comes no nearer by a part of a cell.
            kept_m += _half_diagonal_m(grid.spec)
            reached = np.unique(objects[now_m < margin_m])
            others = layer & ~np.isin(things, reached)
            left |= layer | inflate_by(others, margin_m, grid.spec.resolution_m)
            for thing in reached:
                own = objects == thing
                left |= kept_cells(grid.spec, centres[own], kept_m[own])
    return left


def people_mask(
    grid: OccupancyGrid, people: Collection[int], passed: tuple[Pose2, float] | None = None
) -> npt.NDArray[np.bool_]:
    """Return the (rows, cols) cells of people, class ids, inflated by their own margins, but for
    those that are `passed`: whose margin reaches within metres of a position."""
    found = np.zeros_like(grid.zones)
    for class_id in people:
        layer = grid.beware.get(class_id)
        if layer is None or not layer.any():
            continue
        margin_m, inflated = grid.margins_m.get(class_id, 0.0), layer
        if passed is not None:
            (pose, within_m), cells, inflated = passed, np.argwhere(layer), layer.copy()
            x, y = (grid.spec.centres(cells) - (pose.x_m, pose.y_m)).T
            inflated[tuple(cells[np.hypot(x, y) <= within_m + margin_m].T)] = False
        found |= layer | inflate_by(inflated, margin_m, grid.spec.resolution_m)
    return found


def beware_cells(grid: OccupancyGrid) -> tuple[Points, Indices]:
    """Return the (N, 2) centres of all cells of beware classes, without margins, in metres of the
    map frame, and (N,) the number of the object that each is of: connected cells of one class."""
    objects, count = np.zeros((grid.spec.rows, grid.spec.cols), dtype=np.int32), 0
    for layer in grid.beware.values():
        if layer.any():
            total, regions = cv2.connectedComponents(layer.view(np.uint8), connectivity=8)
            objects[layer] = regions[layer] + count
            count += total
    cells = np.argwhere(objects)
    return grid.spec.centres(cells), objects[tuple(cells.T)].astype(np.int64)


def kept_cells(spec: GridSpec, cells: Points, clearance_m: Floats) -> BoolGrid:
    """Return the (rows, cols) cells that the body must not touch for it to keep (N,) clearances in
    metres from (N, 2) centres of beware cells, map frame; neighbours have about the same.

    A body that is half a diagonal of a cell away from the centres of what is returned keeps them,
    to a centimetre or two.
    """
    kept, half_m = np.zeros((spec.rows, spec.cols), dtype=np.bool_), _half_diagonal_m(spec)
    cols, rows = np.floor((cells - (spec.origin_x_m, spec.origin_y_m)) / spec.resolution_m).T
    inside = (rows >= 0) & (rows < spec.rows) & (cols >= 0) & (cols < spec.cols)
    inside &= clearance_m > half_m
    if not inside.any():
        return kept
    rows, cols = rows[inside].astype(np.int64), cols[inside].astype(np.int64)
    away = np.ones(kept.shape, dtype=np.uint8)
    away[rows, cols] = 0
    away_px, labels = cv2.distanceTransformWithLabels(
        away, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    least_m = np.zeros(int(labels.max()) + 1)
    least_m[labels[rows, cols]] = clearance_m[inside] - half_m
    return np.asarray(away_px * spec.resolution_m < least_m[labels])


def kept_zones(spec: GridSpec, zones: Iterable[GrownZone]) -> BoolGrid:
    """Return the same for zones as the safety gate grows them."""
    kept, half_m = np.zeros((spec.rows, spec.cols), dtype=np.bool_), _half_diagonal_m(spec)
    for one in zones:
        outside = one.zone.forbids_outside
        grown = area_of(grow(one.zone, one.spread)).buffer(half_m if outside else -half_m)
        left, bottom, right, top = grown.bounds if not grown.is_empty else (0.0,) * 4
        first, last = spec.cell(left, bottom), spec.cell(right, top)
        rows = np.arange(max(first[0], 0), min(last[0] + 1, spec.rows))
        cols = np.arange(max(first[1], 0), min(last[1] + 1, spec.cols))
        cells = np.stack(np.meshgrid(rows, cols, indexing="ij"), axis=-1)
        x, y = spec.centres(cells.reshape(-1, 2)).T
        within = np.zeros_like(kept)
        part = shapely.contains_xy(grown, x, y).reshape(cells.shape[:2])
        within[rows[:, None], cols[None, :]] = part
        kept |= ~within if outside else within
    return kept


def occupied_cells(
    spec: GridSpec, points: Points, least: int = DEFAULT_SAFETY.collision.min_points
) -> BoolGrid:
    """Return the (rows, cols) cells in which at least so many of (N, 2) points of the map frame
    lie."""
    cols, rows = np.floor((points - (spec.origin_x_m, spec.origin_y_m)) / spec.resolution_m).T
    inside = (rows >= 0) & (rows < spec.rows) & (cols >= 0) & (cols < spec.cols)
    cells = (rows[inside] * spec.cols + cols[inside]).astype(np.int64)
    counts = np.bincount(cells, minlength=spec.rows * spec.cols)
    return np.asarray(counts >= least).reshape(spec.rows, spec.cols)


def _half_diagonal_m(spec: GridSpec) -> float:
    return spec.resolution_m * math.sqrt(0.5)


def nearby(mask: npt.NDArray[np.bool_], grid: OccupancyGrid, pose: Pose2, reach_m: float) -> Points:
    """Return the (N, 2) centres of marked cells within a square of `reach_m` around the robot, in
    metres of the base frame."""
    spec = grid.spec
    row, col = spec.cell(pose.x_m, pose.y_m)
    reach = math.ceil(reach_m / spec.resolution_m)
    top, left = max(row - reach, 0), max(col - reach, 0)
    part = mask[top : max(row + reach + 1, 0), left : max(col + reach + 1, 0)]
    first = pose.from_parent(np.array([spec.centre(top, left)]))[0]
    step = spec.resolution_m * np.array([math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)])
    return _marked(part, first, step)


@compiled
def _marked(mask: Bools, first: Floats, step: Floats) -> Points:
    """Return the (N, 2) positions of marked cells: that of row 0, column 0 is `first`, the next
    row's is by (step[1], step[0]) from it and the next column's by (step[0], −step[1])."""
    count = 0
    for row in range(mask.shape[0]):
        for col in range(mask.shape[1]):
            count += mask[row, col]
    positions, found = np.empty((count, 2)), 0
    for row in range(mask.shape[0]):
        for col in range(mask.shape[1]):
            if mask[row, col]:
                positions[found, 0] = first[0] + row * step[1] + col * step[0]
                positions[found, 1] = first[1] + row * step[0] - col * step[1]
                found += 1
    return positions


def footprint_overlaps(forbidden: Points, profile: RobotProfile, cell_m: float) -> bool:
    """Return whether the footprint covers the middle part of any forbidden cell; `forbidden` are
    (N, 2) centres in the base frame."""
    return not bool(outside(forbidden, profile, -cell_m / 2).all())


def split_areas(
    grid: OccupancyGrid, zones: Iterable[Zone], profile: RobotProfile, pose: Pose2
) -> tuple[list[BoolGrid], BoolGrid]:
    """Return the areas that the footprint overlaps, one by one, and the union of all others, each
    (rows, cols) with its margin.

    Each zone is an area, and so are connected cells of one beware class. So an object inside a
    zone, or a zone that overlaps it, stays one of the others, and a cell may belong to both. Of an
    area that the footprint overlaps by its margin alone, what has the margin is one of the others.
    Only `zones` count; those of the grid are merged.
    """
    spec, cell_m = grid.spec, grid.spec.resolution_m
    others = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
    entered: list[BoolGrid] = []
    if not others.size:
        return entered, others
    body = _footprint_cells(spec, profile, pose)
    for class_id, layer in grid.beware.items():
        if not layer.any():
            continue
        margin_m = grid.margins_m.get(class_id, 0.0)
        _, regions = cv2.connectedComponents(layer.view(np.uint8), connectivity=8)
        numbers = np.unique(regions[inflate_by(body, margin_m, cell_m) & layer])
        entered += [inflate_by(regions == number, margin_m, cell_m) for number in numbers]
        others |= inflate_by(layer & ~np.isin(regions, numbers), margin_m, cell_m)
        beside = np.setdiff1d(numbers, regions[body & layer])
        others |= np.isin(regions, beside) & layer
    for zone in zones:
        if not zone.closed or not _overlaps_grid(zone, spec):
            continue
        bare = forbidden_cells(zone, spec)
        area = inflate_by(bare, zone.margin_m, cell_m)
        if (area & body).any():
            entered.append(area)
            if not (bare & body).any():
                others |= bare
        else:
            others |= area
    return entered, others


def _footprint_cells(spec: GridSpec, profile: RobotProfile, pose: Pose2) -> BoolGrid:
    """Return the (rows, cols) cells whose centre the footprint covers or that its border
    crosses."""
    pixels = (
        pose.to_parent(profile.footprint()) - np.array([spec.origin_x_m, spec.origin_y_m])
    ) / spec.resolution_m - 0.5
    body = np.zeros((spec.rows, spec.cols), dtype=np.uint8)
    cv2.fillConvexPoly(body, np.round(pixels * 256).astype(np.int32), 1, shift=8)
    return body.view(np.bool_)


def _overlaps_grid(zone: Zone, spec: GridSpec) -> bool:
    """Return whether a zone may forbid a cell of the grid, by its bounding box with its margin."""
    if zone.forbids_outside:
        return True
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
    """Return the (rows, cols) unknown cells beside a known one."""
    beside = cv2.dilate(known.view(np.uint8), np.ones((3, 3), dtype=np.uint8)).view(np.bool_)
    return np.asarray(beside & ~known)


def outside(points: Points, profile: RobotProfile, padding_m: float) -> npt.NDArray[np.bool_]:
    """Return (N,) whether points are outside the footprint enlarged by the padding; a negative one
    shrinks it."""
    return np.asarray(
        (np.abs(points[:, 0]) > profile.length_m / 2 + padding_m)
        | (np.abs(points[:, 1]) > profile.width_m / 2 + padding_m)
    )
