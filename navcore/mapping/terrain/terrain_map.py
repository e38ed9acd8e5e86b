"""Terrain map: the mean slope, step and roughness of each cell over all looks, and the cells that
are beyond the robot's limits (Wermelinger et al. 2016).

A cell belongs to the pose from which it was first seen, in whose frame its sums are kept: a
correction of poses moves and turns them, and none are lost. As all are sums, the order of looks
does not matter. Memory follows the ground that was seen: tiles of cells, and one record a cell.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from navcore.config.mapping import TerrainConfig
from navcore.geometry.arrays import Bools, FloatImage, Floats, Indices, Points
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.grid.bitplane import ONE, PAD, BitPlane, empty_plane, unpack
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.grid.growth import Growth
from navcore.mapping.points.erasing import ErasedGround
from navcore.mapping.points.pose_ids import PoseIds
from navcore.mapping.terrain.ground_sums import (
    NO_RECORD,
    RECORD,
    TILE,
    GroundLimits,
    add_looks,
    judged,
)
from navcore.mapping.terrain.looks import VALUES, TerrainLooks, terrain_looks
from navcore.robot.frame import Frame
from navcore.robot.profile import RobotProfile

TerrainRecords = npt.NDArray[np.void]
"""(N,) rows of `RECORD`."""


class _Tile:
    """Sums of the looks in the map frame, and the record to which further looks are added."""

    def __init__(self) -> None:
        self.sums = np.zeros((TILE, TILE, VALUES), dtype=np.float32)
        self.record = np.full((TILE, TILE), NO_RECORD, dtype=np.int32)
        self.is_uneven = False  # whether any cell ever had a slope


class TerrainMap:
    """Ground as it was seen over time, and the cells of the map's grid that the robot cannot
    drive on."""

    def __init__(
        self, spec: GridSpec, rules: TerrainConfig, pose_ids: PoseIds, profile: RobotProfile
    ) -> None:
        self._spec, self._rules, self._pose_ids = spec, rules, pose_ids
        self._limits = GroundLimits(
            min_looks=rules.min_looks,
            smooth_m=rules.smooth_m,
            uneven_slope=rules.uneven_slope,
            max_slope=profile.max_slope,
            max_step_m=profile.max_step_m,
        )
        self.clear(spec)

    def clear(self, spec: GridSpec) -> None:
        """Forget everything, and continue on a grid."""
        self._spec = spec
        self._parts = max(round(self._rules.cell_m / spec.resolution_m), 1)
        self._cell_m = self._parts * spec.resolution_m
        self._tiles: dict[tuple[int, int], _Tile] = {}
        self._records, self._count = np.zeros(64, dtype=RECORD), 0
        self.untraversable: BitPlane = empty_plane(spec.rows, spec.cols)
        """Live plane of the cells with a slope or a step beyond the robot's limits."""
        self._changes: list[Indices] | None = None
        self._last: Pose2 | None = None

    def observe(self, frame: Frame, ground_m: FloatImage, object_height_m: float) -> bool:
        """Add what a frame, placed in the map, shows of the ground, if the robot has moved since
        the last look; return whether any cell became traversable or the contrary.

        `ground_m` and `object_height_m` are those of `terrain_looks`.
        """
        rules, last = self._rules, self._last
        if not rules.enabled or (
            last is not None
            and last.distance_to(frame.pose.x_m, frame.pose.y_m) < rules.look_every_m
            and abs(wrap_angle(frame.pose.yaw_rad - last.yaw_rad))
            < math.radians(rules.look_every_deg)
        ):
            return False
        self._last = frame.pose
        looks = terrain_looks(frame, ground_m, object_height_m, rules, self._cell_m)
        return self.add(looks, self._pose_ids.id_of(frame.pose))

    def add(self, looks: TerrainLooks, pose_id: int) -> bool:
        """Add looks from a pose ID; return whether any cell became traversable or the contrary."""
        self._reserve(len(looks.cells))
        pose, tile_of = self._pose_ids[pose_id], looks.cells // TILE
        changed = [np.empty(0, dtype=np.int64)]
        for key in _tiles_between(looks.cells):
            if not (tile_of == key).all(axis=1).any():
                continue
            tile = self._tiles.setdefault(key, _Tile())
            self._count, is_uneven, cells, beyond = add_looks(
                looks.cells,
                looks.values,
                pose_id,
                (pose.x_m, pose.y_m, pose.yaw_rad),
                self._cell_m,
                key,
                tile.sums,
                tile.record,
                self._records,
                self._count,
                self._limits,
            )
            tile.is_uneven = tile.is_uneven or is_uneven
            if len(cells):
                changed.append(self._mark(cells, beyond))
        marked = np.concatenate(changed)
        if self._changes is not None and len(marked):
            self._changes.append(marked)
        return len(marked) > 0

    def slopes_around(self, frame: Frame, points_base: Points) -> Floats | None:
        """Return the (N, 2) slopes at (N, 2) points in metres of the base frame of a frame that is
        placed in the map: rise per metre along x and y of this frame, relative to the plane on
        which the robot stands; NaN where the ground is not known, not smooth, or beyond the robot's
        limits. None where all of it is that plane."""
        tilt, rules = frame.plane_slope, self._rules
        cells = np.floor(frame.pose.to_parent(points_base)[:, ::-1] / self._cell_m).astype(np.int64)
        tiles = {key: self._tiles[key] for key in _tiles_between(cells) if key in self._tiles}
        if math.hypot(*tilt) <= rules.uneven_slope and not any(t.is_uneven for t in tiles.values()):
            return None
        tile_of, inside = np.divmod(cells, TILE)
        sums = np.zeros((len(cells), VALUES), dtype=np.float32)
        for key, tile in tiles.items():
            own = (tile_of == key).all(axis=1)
            sums[own] = tile.sums[tuple(inside[own].T)]
        known, beyond, _ = judged(sums, self._limits)
        known &= ~beyond
        slopes = np.full((len(cells), 2), np.nan)
        in_base = _turned(sums[known], np.full(int(known.sum()), -frame.pose.yaw_rad))
        slopes[known] = in_base[:, 1:3] / in_base[:, :1] - tilt
        uneven = np.hypot(*slopes[known].T) > rules.uneven_slope
        return slopes if uneven.any() else None

    def records(self) -> TerrainRecords:
        """Return a copy of all records, from which `restore` continues."""
        return self._records[: self._count].copy()

    def restore(self, records: TerrainRecords) -> None:
        """Replace what was seen by former records, at the present poses."""
        self._count, self._last = 0, None
        self._reserve(len(records))
        self._records[: len(records)], self._count = records, len(records)
        self.place()

    def place(self) -> None:
        """Compute all cells from the records at the present poses, after these were corrected."""
        live = self._records[: self._count]
        poses = self._poses_of_records()
        live["yaw_rad"] = poses[:, 2]
        cells = self._cells_of_records(poses)
        values = _turned(live["sums"], poses[:, 2])
        self._tiles = {}
        tile_of, inside = np.divmod(cells, TILE)
        keys, which = np.unique(tile_of, axis=0, return_inverse=True)
        order = np.argsort(which.reshape(-1), kind="stable")
        ends = np.searchsorted(which.reshape(-1)[order], np.arange(len(keys) + 1))
        for number, key in enumerate(keys.tolist()):
            own = order[ends[number] : ends[number + 1]]
            tile = self._tiles[key[0], key[1]] = _Tile()
            rows, cols = inside[own].T
            np.add.at(tile.sums, (rows, cols), values[own])
            tile.record[rows, cols] = own
            tile.is_uneven = bool(judged(tile.sums[rows, cols], self._limits)[2].any())
        self._mark_all()

    def erase(self, positions: Points) -> ErasedGround:
        """Forget the ground of the cells at (N, 2) positions in metres of the map frame, and return
        it."""
        live = self._records[: self._count]
        chosen = np.floor(positions[:, ::-1] / self._cell_m).astype(np.int64)
        own = self._cells_of_records(self._poses_of_records())
        records = np.flatnonzero(np.isin(_numbers(own), _numbers(chosen)))
        taken = ErasedGround(records=records, sums=live["sums"][records].copy())
        if len(records):
            live["sums"][records] = 0.0
            self.place()
        return taken

    def put_back(self, erased: ErasedGround) -> None:
        """Put back what `erase` has removed, beside what was seen since."""
        if len(erased.records):
            self._records["sums"][erased.records] += erased.sums
            self.place()

    def _poses_of_records(self) -> Floats:
        """Return (N, 3) x, y, yaw of the pose of each record."""
        held = self._records["pose_id"][: self._count]
        return np.asarray(self._pose_ids.array()[held].reshape(-1, 3))

    def _cells_of_records(self, poses: Floats) -> Indices:
        """Return the (N, 2) cells of the records at (N, 3) poses."""
        cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        x, y = self._records["base"][: self._count].astype(np.float64).T
        middle = np.column_stack([poses[:, 1] + sin * x + cos * y, poses[:, 0] + cos * x - sin * y])
        return np.floor(middle / self._cell_m).astype(np.int64)

    def grow(self, growth: Growth) -> None:
        """Continue on a larger grid."""
        self._spec = growth.new
        self._mark_all()

    @property
    def bools(self) -> BoolGrid:
        """(rows, cols) cells with a slope or a step beyond the robot's limits."""
        return unpack(self.untraversable, self._spec.rows, self._spec.cols)

    def take_changes(self) -> Indices | None:
        """Return the (N,) cells, row · cols + col, that `untraversable` gained or lost since the
        last call; None at the first, when all cells count as changed."""
        taken, self._changes = self._changes, []
        if taken is None:
            return None
        return np.concatenate([np.empty(0, dtype=np.int64), *taken])

    def ground(self, x_m: float, y_m: float) -> tuple[float, float, float] | None:
        """Return the mean slope, step in metres and roughness in metres at a position of the map
        frame; None where too little was seen of it."""
        row, col = math.floor(y_m / self._cell_m), math.floor(x_m / self._cell_m)
        tile = self._tiles.get((row // TILE, col // TILE))
        if tile is None or tile.sums[row % TILE, col % TILE, 0] < self._rules.min_looks:
            return None
        looks, across, along, rough, steps, step = tile.sums[row % TILE, col % TILE].tolist()
        return math.hypot(across, along) / looks, step / max(steps, 1), math.sqrt(rough / looks)

    @property
    def memory_mb(self) -> float:
        """Memory of records and tiles in megabytes."""
        tile = TILE * TILE * (4 * VALUES + 4)
        return (self._records.nbytes + tile * len(self._tiles)) / 1e6

    def _reserve(self, more: int) -> None:
        """Make room for a number of further records."""
        while self._count + more > len(self._records):
            self._records = np.concatenate([self._records, np.zeros_like(self._records)])

    def _mark_all(self) -> None:
        """Compute the plane from the tiles; all cells then count as changed."""
        self.untraversable = empty_plane(self._spec.rows, self._spec.cols)
        self._changes = None
        for key, tile in self._tiles.items():
            rows, cols = np.nonzero(tile.record != NO_RECORD)
            cells = np.column_stack([rows, cols]) + TILE * np.array(key)
            self._mark(cells, judged(tile.sums[rows, cols], self._limits)[1])

    def _mark(self, cells: Indices, beyond: Bools) -> Indices:
        """Write (N, 2) distinct cells into the plane; return the cells of the grid that changed."""
        spec, within = self._spec, np.arange(self._parts)
        # Whole cells, so that the parts are distinct also where the origin lies half a cell off.
        rows, cols = np.broadcast_arrays(
            (cells[:, 0, None] * self._parts + within)[:, :, None] + self._first(spec.origin_y_m),
            (cells[:, 1, None] * self._parts + within)[:, None] + self._first(spec.origin_x_m),
        )
        set_to = np.broadcast_to(beyond[:, None, None], rows.shape)
        inside = (rows >= 0) & (rows < spec.rows) & (cols >= 0) & (cols < spec.cols)
        rows, cols, set_to = rows[inside], cols[inside], set_to[inside]
        words, bits = (cols + PAD) >> 6, ONE << (cols & 63).astype(np.uint64)
        changes = (self.untraversable[rows + PAD, words] & bits != 0) != set_to
        rows, cols, words, bits = rows[changes], cols[changes], words[changes], bits[changes]
        np.bitwise_xor.at(self.untraversable, (rows + PAD, words), bits)
        return np.asarray(rows * spec.cols + cols)

    def _first(self, origin_m: float) -> int:
        """Return the row or column of the grid whose cell begins at 0 m, or nearest to it."""
        return math.floor(0.5 - origin_m / self._spec.resolution_m)


def _numbers(cells: Indices) -> Indices:
    """Return (N,) numbers of (N, 2) cells, one for each."""
    return np.asarray((cells[:, 0] << 32) + cells[:, 1])


def _tiles_between(cells: Indices) -> Iterator[tuple[int, int]]:
    """Yield the tiles, row and column, of the smallest rectangle around (N, 2) cells."""
    if len(cells):
        (top, left), (bottom, right) = cells.min(axis=0).tolist(), cells.max(axis=0).tolist()
        yield from itertools.product(
            range(top // TILE, bottom // TILE + 1), range(left // TILE, right // TILE + 1)
        )


def _turned(values: Floats | npt.NDArray[np.float32], yaw_rad: Floats) -> Floats:
    """Return (N, 6) values with their slopes turned by (N,) angles."""
    turned = values.astype(np.float64)
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    turned[:, 1] = cos * values[:, 1] - sin * values[:, 2]
    turned[:, 2] = sin * values[:, 1] + cos * values[:, 2]
    return turned
