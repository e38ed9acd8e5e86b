"""Upright clusters of a person's size in a frame, and whether they stand where floor was.

The depth image, and the laser scan where that shows nothing, are put on a coarse grid around the
camera, in the map frame. The grid remembers for some
seconds where floor was seen and since when a cell has been occupied: what has been there for long
is a wall or a chair and belongs to no cluster, and what occupies floor that was seen a moment ago
has come there by itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from navcore.config.perception.perception import DEFAULT_PERCEPTION, PersonDetectorConfig
from navcore.geometry.arrays import Bools, FloatImage, Floats, Indices, sorted_distinct
from navcore.perception.ground import flat_ground
from navcore.perception.people.detection_grid import (
    MOVABLE,
    NEW,
    SIDE,
    CellMemory,
    Counts,
    GridLimits,
    Mask,
    bin_pixels,
    bin_scan,
    component_totals,
    recall_cells,
)
from navcore.robot.frame import Frame
from navcore.robot.laser_scan import LaserScan

_DEFAULT = DEFAULT_PERCEPTION.people.detector
_BODY_M = 0.5
"""Height in metres at which a person must be in view."""
_BODY_HEIGHTS_M = np.arange(0.3, 1.6, 0.1)
"""Heights in metres at which a person must be seen past to have gone."""
_BACK_M = 0.1
"""Distance in metres behind the back of a person from which a measurement is past them."""
_ASIDE = np.array([-0.75, -0.375, 0.0, 0.375, 0.75])
"""Positions across a body at which it must be seen past, in units of its radius: a look between
two legs is none."""
_LEAST_LOOKS = 2
"""Least number of heights in view with floor behind, at its middle and at one side."""
_MIN_RANGE_M = 0.2
"""Least distance in metres from the camera that is divided by."""
_KEY = 1 << 32
"""Factor of the row in a number that stands for a cell."""
_NEIGHBOURS = np.argwhere(np.ones((3, 3))) - 1
"""(9, 2) rows and columns of a cell and its neighbours, relative to it."""
_MIN_CELLS = 3
"""Number of cells from which a component is evaluated."""

Cells = Indices
"""(K, 2) row and column of cells, counted from the origin of the map."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cluster:
    """Occupied cells of a person's size."""

    x_m: float
    """Estimated x of the middle of the body in metres of the map frame."""
    y_m: float
    """Estimated y of the middle of the body in metres of the map frame."""
    range_m: float
    """Horizontal distance from the camera in metres."""
    on_new_floor: float
    """Share of its cells that showed floor shortly before."""
    labelled: float
    """Share of its pixels that the segmenter labels as a person."""
    radius_m: float
    """Radius in metres of the disc that it covers, by its visible width; at least a person's."""
    cells: Cells
    """(K, 2) row and column of its cells, counted from the origin of the map."""
    is_cut: bool = False
    """Whether it reaches the border of the image, so that a part of it may be beyond: then its
    middle is a person's behind the edge that is in view."""


class PersonDetector:
    """Grid around the camera that remembers, cell by cell, when floor was seen and since when the
    cell has been occupied."""

    def __init__(self, config: PersonDetectorConfig = _DEFAULT) -> None:
        self._config = config
        self._memory = CellMemory(
            owner=np.full((SIDE, SIDE), -1, dtype=np.int64),
            free_s=np.full((SIDE, SIDE), -np.inf),
            occupied_s=np.full((SIDE, SIDE), np.inf),
        )
        self._now_s = np.nan  # equal to no time at which floor was seen, nor to none

    def detect(
        self, frame: Frame, is_person: Bools, ground_m: FloatImage | None = None
    ) -> list[Cluster]:
        """Return the clusters of a frame; `is_person` (H, W) are the pixels that the segmenter
        labels as a person.

        `ground_m` is that of `ground_heights`, 0 by default.
        """
        config, now_s = self._config, frame.stamp_ns / 1e9
        ground_m = flat_ground(frame.intrinsics.width) if ground_m is None else ground_m
        t, lens = frame.T_map_camera, frame.intrinsics
        origin = np.floor(t[:2, 3] / config.cell_m).astype(np.int64) - SIDE // 2  # column, row
        counts, sums = np.zeros((SIDE, SIDE, 3), dtype=np.int32), np.zeros((SIDE, SIDE, 3))
        limits = _limits(config)
        bin_pixels(
            frame.depth_m, ground_m, is_person, t, lens.pinhole, limits, origin, counts, sums
        )
        area_px = lens.fx * lens.fy / 2
        if frame.scan is not None:
            _add_scan(frame, frame.scan, limits, origin, counts, sums, area_px)
        kinds = np.zeros((SIDE, SIDE), dtype=np.uint8)
        self._now_s = now_s
        recall_cells(
            counts,
            origin,
            now_s,
            (lens.area_px(config.min_pixels), config.fixed_s, config.fresh_s),
            self._memory,
            kinds,
        )
        grid = _Grid(kinds=kinds, counts=counts, sums=sums, origin=origin, eye=t[:2, 3])
        movable = (kinds >= MOVABLE).view(np.uint8)
        found, crowded = self._clusters(movable, grid, area_px, frame)
        if not crowded.any():
            return found
        parts, _ = self._clusters((crowded & (kinds == NEW)).view(np.uint8), grid, area_px, frame)
        return found + parts

    def keep_movable(self, cells: Cells, now_s: float) -> None:
        """Keep what occupies these (K, 2) cells from counting as fixed, however long it stays."""
        slots = cells[:, 0] % SIDE, cells[:, 1] % SIDE
        since_s = self._memory.occupied_s
        since_s[slots] = np.where(np.isinf(since_s[slots]), np.inf, now_s)

    def newly_occupied(self, cells: Cells, now_s: float) -> Cells:
        """Return the (N, 2) cells among (K, 2) that are occupied, and have not been for long."""
        age_s = self._occupied_for_s(cells, now_s)
        return cells[(age_s >= 0) & (age_s < self._config.fixed_s)]

    def movable_around(self, cells: Cells, now_s: float) -> Cells:
        """Return the (N, 2) cells and their neighbours, without those that are fixed."""
        rows, cols = (cells[:, None] + _NEIGHBOURS[None]).reshape(-1, 2).T
        # Rows and columns as one number are sorted much faster than as rows of an array.
        keys = sorted_distinct(rows * _KEY + cols)
        rows = (keys + _KEY // 2) // _KEY
        wide = np.column_stack([rows, keys - rows * _KEY])
        return np.asarray(wide[self._occupied_for_s(wide, now_s) < self._config.fixed_s])

    def is_free_floor(self, positions: Floats) -> Bools:
        """Return (N,) at which of (N, 2) positions in metres of the map frame the newest frame
        shows floor surrounded by floor, with nothing above it.

        The positions are no farther from the camera than the grid reaches.
        """
        rows, cols = np.floor(positions[:, ::-1] / self._config.cell_m).astype(np.int64).T
        return np.asarray(self._memory.free_s[rows % SIDE, cols % SIDE] == self._now_s)

    def is_floor(self, x_m: float, y_m: float, radius_m: float, now_s: float) -> bool:
        """Return whether the newest frame shows floor nearly everywhere in a disc."""
        rows, cols = self.cells_within(x_m, y_m, radius_m).T
        shown = self._memory.free_s[rows % SIDE, cols % SIDE] == now_s
        return float(shown.mean()) >= self._config.floor_share

    def cells_within(self, x_m: float, y_m: float, radius_m: float) -> Cells:
        """Return the (K, 2) cells whose centre lies within a disc of the map frame."""
        cell_m = self._config.cell_m
        reach = math.ceil(radius_m / cell_m)
        row, col = math.floor(y_m / cell_m), math.floor(x_m / cell_m)
        rows, cols = (np.arange(at - reach, at + reach + 1) for at in (row, col))
        y, x = (rows + 0.5) * cell_m - y_m, (cols + 0.5) * cell_m - x_m
        within = np.argwhere(np.hypot(y[:, None], x) < radius_m)
        return np.asarray(within + np.array([row - reach, col - reach]))

    def looks_at(self, frame: Frame, x_m: float, y_m: float, half_width_m: float) -> bool:
        """Return whether a person at a position of the map frame would be in view and in range, in
        full width, of the camera, or of the scanner with nothing before them."""
        if frame.scan is not None:
            x, y = frame.pose.from_parent(np.array([x_m, y_m])).tolist()
            is_near = math.hypot(x - frame.scan.x_m, y) <= self._config.max_range_m
            if is_near and frame.scan.reaches(x, y, half_width_m):
                return True
        camera = frame.T_map_camera
        x, _, depth = camera[:3, :3].T @ (np.array([x_m, y_m, _BODY_M]) - camera[:3, 3])
        lens = frame.intrinsics
        left, right = (
            (x + offset) * lens.fx + lens.cx * depth for offset in (-half_width_m, half_width_m)
        )
        in_range = 0 < depth <= self._config.max_range_m
        return bool(in_range and left >= 0 and right < lens.width * depth)

    def sees_past(self, frame: Frame, x_m: float, y_m: float, radius_m: float) -> bool:
        """Return whether the camera measures behind a person at a position of the map frame, past
        their middle and one side, and nowhere the person: however near, they are not there.

        It has to where there is floor within range behind them; elsewhere depth may end.
        """
        camera, lens = frame.T_map_camera, frame.intrinsics
        dx_m, dy_m = x_m - camera[0, 3], y_m - camera[1, 3]
        range_m = max(math.hypot(dx_m, dy_m), _MIN_RANGE_M)
        aside = radius_m * _ASIDE
        columns = np.column_stack([x_m - aside * dy_m / range_m, y_m + aside * dx_m / range_m])
        body = np.column_stack(
            [
                np.repeat(columns, len(_BODY_HEIGHTS_M), axis=0),
                np.tile(_BODY_HEIGHTS_M, len(columns)),
            ]
        )
        shown = np.flatnonzero(frame.shows(body))
        x, y, depth = ((body[shown] - camera[:3, 3]) @ camera[:3, :3]).T
        cols = np.rint(x / depth * lens.fx + lens.cx).astype(np.int64)
        rows = np.rint(y / depth * lens.fy + lens.cy).astype(np.int64)
        measured_m = frame.depth_m[rows, cols]
        is_past = measured_m > depth + radius_m + _BACK_M
        is_low = body[shown, 2] < camera[2, 3] * (1.0 - range_m / self._config.max_range_m)
        looks = np.bincount(shown[is_low] // len(_BODY_HEIGHTS_M), minlength=len(columns))
        middle, sides = looks[len(columns) // 2], max(looks[0], looks[-1])
        if min(middle, sides) < _LEAST_LOOKS or (~is_past & (measured_m > 0.0)).any():
            return False
        return float(is_past[is_low].mean()) >= self._config.past_share

    def _occupied_for_s(self, cells: Cells, now_s: float) -> Floats:
        """Return (K,) how long cells have been occupied in seconds; −∞ when they are not."""
        return np.asarray(now_s - self._memory.occupied_s[cells[:, 0] % SIDE, cells[:, 1] % SIDE])

    def _clusters(
        self, mask: Mask, grid: _Grid, area_px: float, frame: Frame
    ) -> tuple[list[Cluster], Bools]:
        """Return the person-sized components of a mask, and the (SIDE, SIDE) cells of those that
        are too large; `area_px` is the number of evaluated pixels of 1 m × 1 m at 1 m."""
        config = self._config
        joined = mask
        if frame.scan is not None:  # which shows two legs of a person apart
            square = np.ones((3, 3), dtype=np.uint8)
            joined = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, square).astype(np.uint8)
        total, names, boxes, _ = cv2.connectedComponentsWithStats(joined, connectivity=8)
        names[mask == 0] = 0
        sizes = np.bincount(names.ravel(), minlength=total)
        found, crowded = [], np.zeros(mask.shape, dtype=np.bool_)
        totals = component_totals(
            np.asarray(names, dtype=np.int32), total, grid.kinds, grid.counts, grid.sums
        )
        for name, (left, top, width, height, _) in enumerate(boxes.tolist()):
            size = int(sizes[name])
            if name == 0 or size < _MIN_CELLS:
                continue
            window = np.s_[top : top + height, left : left + width]
            if max(width, height) * config.cell_m > config.max_width_m + config.cell_m:
                crowded[window] |= names[window] == name
                continue
            pixels, labelled, new, x_sum, y_sum, top_m = totals[name].tolist()
            x_m, y_m = x_sum / pixels, y_sum / pixels
            dx_m, dy_m = x_m - grid.eye[0], y_m - grid.eye[1]
            range_m = max(math.hypot(dx_m, dy_m), _MIN_RANGE_M)
            if top_m < config.min_height_m or pixels * range_m**2 < config.min_area_share * area_px:
                continue
            part = names[window] == name
            cells = np.argwhere(part) + np.array([top + grid.origin[1], left + grid.origin[0]])
            half_m = _half_width_m(cells, dx_m / range_m, dy_m / range_m, config)
            radius_m = min(max(half_m, config.radius_m), config.max_width_m / 2)
            depth_share = _middle_offset_m(radius_m, config) / range_m
            middle_x_m, middle_y_m = x_m + depth_share * dx_m, y_m + depth_share * dy_m
            # Half of the longer side of the bounding box, and half a cell for its rim.
            half_width_m = (max(width, height) + 1) * config.cell_m / 2
            is_cut = not self.looks_at(frame, middle_x_m, middle_y_m, half_width_m)
            if is_cut and half_m < config.radius_m:
                # Of its edges only the one towards the middle of the image is the body's.
                to_the_right_m = frame.T_map_camera[:2, 0] @ (dx_m, dy_m)
                aside = math.copysign(config.radius_m - half_m, -to_the_right_m) / range_m
                middle_x_m, middle_y_m = middle_x_m - aside * dy_m, middle_y_m + aside * dx_m
            found.append(
                Cluster(
                    x_m=float(middle_x_m),
                    y_m=float(middle_y_m),
                    range_m=range_m,
                    on_new_floor=new / size,
                    labelled=labelled / pixels,
                    radius_m=radius_m,
                    cells=cells,
                    is_cut=is_cut,
                )
            )
        return found, crowded


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Grid:
    """One frame on the grid around the camera."""

    kinds: Mask
    """(SIDE, SIDE) whether a cell is fixed, movable or newly occupied; 0 for none of them."""
    counts: Counts
    """(SIDE, SIDE, 3) pixels of bodies and of people, and 1 where a pixel shows floor."""
    sums: Floats
    """(SIDE, SIDE, 3) sums of x and y, and the greatest height, in metres."""
    origin: Indices
    """(2,) column and row of the first cell, counted from the origin of the map."""
    eye: Floats
    """(2,) position of the camera in metres of the map frame."""


def _add_scan(
    frame: Frame,
    scan: LaserScan,
    limits: GridLimits,
    origin: Indices,
    counts: Counts,
    sums: Floats,
    area_px: float,
) -> None:
    """Add a scan to the pixels; `area_px` is as for clusters. Each ray counts as the pixels
    of the strip of a body that it stands for."""
    angles = frame.pose.yaw_rad + scan.step_rad * np.arange(len(scan.ranges_m))
    scanner = frame.pose.to_parent(np.array([scan.x_m, 0.0])).tolist()
    body_m = limits.body_high_m - limits.body_low_m
    bin_scan(
        np.column_stack([np.cos(angles), np.sin(angles), scan.ranges_m.astype(np.float64)]),
        (scanner[0], scanner[1]),
        body_m * scan.step_rad * area_px,
        limits,
        origin,
        counts,
        sums,
    )


def _limits(config: PersonDetectorConfig) -> GridLimits:
    return GridLimits(
        cell_m=config.cell_m,
        max_range_m=config.max_range_m,
        floor_range_m=config.floor_range_m,
        body_low_m=config.body_low_m,
        body_high_m=config.body_high_m,
        floor_m=config.floor_m,
        fill_m=config.fill_m,
    )


def _middle_offset_m(radius_m: float, config: PersonDetectorConfig) -> float:
    """Return the distance in metres from the visible side to the middle: a cluster no wider than a
    person is as deep as one, a wider one is taken to be round."""
    largest_m = config.max_width_m / 2
    return config.face_m + (radius_m - config.radius_m) * (
        config.round_face_share * config.max_width_m / 2 - config.face_m
    ) / (largest_m - config.radius_m)


def _half_width_m(
    cells: Cells, ahead_x: float, ahead_y: float, config: PersonDetectorConfig
) -> float:
    """Return half of the width in metres of (K, 2) cells across the line of sight, whose direction
    is given."""
    across = cells[:, 0] * ahead_x - cells[:, 1] * ahead_y
    return (float(np.ptp(across)) + config.edge_cells) * config.cell_m / 2
