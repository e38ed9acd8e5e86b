"""Points of the global map, as a value and as a live table in which the points of a cell are
linked.

Because of these links, a change of the map costs as much as the cells that it concerns, whatever
the size of the map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.geometry.arrays import Indices
from navcore.grid.growth import Growth
from navcore.mapping.points.point_links import (
    Cells,
    Records,
    add_points,
    link,
    link_points,
    remove_points,
)
from navcore.mapping.views.voxels import BIN_M, HEIGHT_BINS, LOWEST_M

POINT = np.dtype(
    [
        ("x", "f4"),
        ("y", "f4"),
        ("z", "f4"),
        ("base_x", "f4"),
        ("base_y", "f4"),
        ("range_m", "f4"),
        ("confidence", "f4"),
        ("pose_id", "i4"),
        ("cell", "i4"),
        ("next", "i4"),
        ("r", "u1"),
        ("g", "u1"),
        ("b", "u1"),
        ("class_id", "u1"),
        ("level", "u1"),
        ("looks", "u1"),
    ],
    align=True,
)
"""Record of a point, 48 bytes: position in metres of the map frame, position in metres of the base
frame at its pose ID, from which the former is computed, depth at which it was measured, confidence,
pose ID, cell (row · cols + col; `OFF_GRID` beside the grid), index of the cell's next point plus
one (0: none), colour, class, height bin, and the evidence of a certain point (`fading.py`)."""
_WORDS = POINT.itemsize // 8
OFF_GRID = -1
"""Cell of a point that a correction moved beside the grid: it is kept and occupies nothing."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapPoints:
    """Snapshot of the points of a map."""

    points_map: npt.NDArray[np.float32]
    """(N, 3) positions in metres of the map frame."""
    rgb: npt.NDArray[np.uint8]
    """(N, 3) colours."""
    class_ids: npt.NDArray[np.uint8]
    """(N,) classes of the beware list; `NOTHING` for geometric points."""
    confidence: npt.NDArray[np.float32]
    """(N,) confidence of the segmenter, 0 to 1."""
    range_m: npt.NDArray[np.float32]
    """(N,) depth in metres at which each point was measured."""
    pose_ids: npt.NDArray[np.int32]
    """(N,) pose ID of each point."""
    looks: npt.NDArray[np.uint8]
    """(N,) near looks that speak for each certain flat point, less those against it."""


class PointTable:
    """Live points: the first `count` records.

    Frames add at most one point of each class to a voxel; a correction of poses may move several
    into one.
    """

    def __init__(self, cells: int) -> None:
        """Make an empty table for a grid with this number of cells."""
        self.count = 0
        self.records: Records = np.zeros(0, dtype=POINT)
        self.changed: npt.NDArray[np.bool_] = np.zeros(0, dtype=np.bool_)
        """(len(records),) whether a record was written since `changed` was last set to False."""
        self._spare: Records | None = None
        # Pages that were never written to cost no memory: only the used part of a large map counts.
        self.first: Cells = np.zeros(cells, dtype=np.int32)
        """(cells,) index of the first point of each cell plus one; 0 for none."""

    def add(self, new: Records, *, one_per_cell: bool = False) -> bool:
        """Add the points whose voxel has none of their class; return whether a confidence has
        risen.

        Otherwise the most confident point in the voxel stays, with the higher confidence of the
        two. With `one_per_cell` that holds for the whole cell instead of the voxel.
        """
        self._reserve(len(new))
        self.count, raised = add_points(
            self.records, self.changed, self.count, self.first, new, one_per_cell
        )
        return bool(raised)

    def load(self, records: Records, count: int) -> None:
        """Take over records, of which the first `count` are points, in their order; points that
        share a voxel all stay."""
        self.records, self.count = records, count
        self.changed = np.zeros(len(records), dtype=np.bool_)
        self.first = np.zeros(len(self.first), dtype=np.int32)
        link(self.records, self.count, self.first)

    def copied_records(self) -> Records:
        """Return a copy of the points, with space for more: in the array given to `reuse`, if that
        is large enough, because the first touch of new memory takes longer than the copying."""
        records, self._spare = self._spare, None
        if records is None or len(records) < self.count:
            records = np.empty(len(self.records), dtype=POINT)
        # As plain words: records are copied one by one.
        records.view(np.uint64)[: self.count * _WORDS] = self.live.view(np.uint64)
        return records

    def reuse(self, other: PointTable) -> None:
        """Take the memory of a table that serves no more."""
        self._spare = other.records

    def resize(self, count: int) -> None:
        """Drop the points after the first `count`, which have no links, or make space for more."""
        self._reserve(count - self.count)
        self.count = count

    def remove(self, indices: npt.NDArray[np.int64]) -> None:
        """Remove points by index; the last points fill the gaps."""
        self.count = remove_points(
            self.records,
            self.changed,
            self.count,
            self.first,
            np.sort(indices)[::-1].astype(np.int64),
        )

    def append(self, new: Records) -> None:
        """Add points, those of one voxel too."""
        begin = self.count
        self.resize(begin + len(new))
        self.records[begin : self.count] = new
        self.changed[begin : self.count] = True
        link_points(self.records, self.first, np.arange(begin, self.count))

    def grow(self, growth: Growth) -> Indices:
        """Continue on a larger grid; the order of the points stays.

        Returns the (N,) points beside the old grid, which stay beside it, and in the cells at its
        border, which may have been rounded into them.
        """
        live, old, spec = self.live, self.first, growth.old
        on_grid = live["cell"] >= 0
        before = live["cell"][on_grid].astype(np.int64)
        after = growth.flat(before)
        self.first = np.zeros(growth.new.rows * growth.new.cols, dtype=np.int32)
        self.first[after] = old[before]
        live["cell"][on_grid] = after
        rows, cols = np.divmod(before, spec.cols)
        at_border = ~on_grid
        at_border[on_grid] = (
            (rows == 0) | (cols == 0) | (rows == spec.rows - 1) | (cols == spec.cols - 1)
        )
        return np.flatnonzero(at_border)

    @property
    def live(self) -> Records:
        """(count,) view of the live points."""
        return self.records[: self.count]

    @property
    def bytes_used(self) -> int:
        """Memory of the points in bytes, without spare capacity."""
        return self.count * POINT.itemsize

    def copied(self) -> MapPoints:
        """Return a snapshot of all points."""
        live = self.live
        return MapPoints(
            points_map=np.column_stack([live["x"], live["y"], live["z"]]),
            rgb=np.column_stack([live["r"], live["g"], live["b"]]),
            class_ids=live["class_id"].copy(),
            confidence=live["confidence"].copy(),
            range_m=live["range_m"].copy(),
            pose_ids=live["pose_id"].copy(),
            looks=live["looks"].copy(),
        )

    def _reserve(self, more: int) -> None:
        if self.count + more > len(self.records):
            size = max(2 * (self.count + more), 4096)
            grown, changed = np.zeros(size, dtype=POINT), np.zeros(size, dtype=np.bool_)
            grown[: self.count], changed[: self.count] = self.live, self.changed[: self.count]
            self.records, self.changed = grown, changed


def levels_of(z_m: npt.NDArray[np.float32]) -> npt.NDArray[np.uint8]:
    """Return the (N,) height bins of (N,) heights in metres."""
    levels = np.floor((z_m.astype(np.float64) - LOWEST_M) / BIN_M)
    return np.clip(levels, 0, HEIGHT_BINS - 1).astype(np.uint8)
