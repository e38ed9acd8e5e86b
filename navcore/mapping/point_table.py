"""Points of the global map, as a value and as a live table in which the points of a cell are
linked.

Because of these links, a change of the map costs as much as the cells that it concerns, whatever
the size of the map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.grid.bitplane import ONE, PAD, BitPlanes
from navcore.mapping.voxels import BIN_M, HEIGHT_BINS, LOWEST_M

Cells = npt.NDArray[np.int32]
Records = npt.NDArray[np.void]
POINT = np.dtype(
    [
        ("x", "f4"),
        ("y", "f4"),
        ("z", "f4"),
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
    ],
    align=True,
)
"""Record of a point, 40 bytes: position in metres of the map frame, depth at which it was measured,
confidence, pose ID, cell (row · cols + col), index of the cell's next point plus one (0: none),
colour, class and height bin."""


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


class PointTable:
    """Live points: the first `count` records, at most one of each class in a voxel."""

    def __init__(self, cells: int) -> None:
        """Make an empty table for a grid with this number of cells."""
        self.count = 0
        self.records: Records = np.zeros(0, dtype=POINT)
        # Pages that were never written to cost no memory: only the used part of a large map counts.
        self.first: Cells = np.zeros(cells, dtype=np.int32)
        """(cells,) index of the first point of each cell plus one; 0 for none."""

    def add(self, new: Records, *, one_per_cell: bool = False) -> bool:
        """Add the points whose voxel has none of their class; return whether a confidence has
        risen.

        Otherwise the point in the voxel stays, with the higher confidence of the two. With
        `one_per_cell` that holds for the whole cell instead of the voxel.
        """
        self._reserve(len(new))
        self.count, raised = _add(self.records, self.count, self.first, new, one_per_cell)
        return bool(raised)

    def remove(self, indices: npt.NDArray[np.int64]) -> None:
        """Remove points by index; the last points fill the gaps."""
        self.count = _remove(
            self.records, self.count, self.first, np.sort(indices)[::-1].astype(np.int64)
        )

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
        )

    def _reserve(self, more: int) -> None:
        if self.count + more > len(self.records):
            grown = np.zeros(max(2 * (self.count + more), 4096), dtype=POINT)
            grown[: self.count] = self.live
            self.records = grown


def levels_of(z_m: npt.NDArray[np.float32]) -> npt.NDArray[np.uint8]:
    """Return the (N,) height bins of (N,) heights in metres."""
    levels = np.floor((z_m.astype(np.float64) - LOWEST_M) / BIN_M)
    return np.clip(levels, 0, HEIGHT_BINS - 1).astype(np.uint8)


@compiled
def _add(
    records: Records, count: int, first: Cells, new: Records, one_per_cell: bool
) -> tuple[int, bool]:
    raised = False
    for index in range(len(new)):
        cell, class_id, level = new[index].cell, new[index].class_id, new[index].level
        at = first[cell]
        while at > 0:
            held = records[at - 1]
            if held.class_id == class_id and (one_per_cell or held.level == level):
                break
            at = held.next
        if at > 0:
            if new[index].confidence > records[at - 1].confidence:
                records[at - 1].confidence = new[index].confidence
                raised = True
            continue
        records[count] = new[index]
        records[count].next = first[cell]
        count += 1
        first[cell] = count
    return count, raised


@compiled
def _remove(records: Records, count: int, first: Cells, indices: npt.NDArray[np.int64]) -> int:
    """Remove indices in falling order, so that no point that fills a gap is still to be removed."""
    for index in indices:
        _relink(records, first, records[index].cell, index + 1, records[index].next)
        count -= 1
        if index != count:
            _relink(records, first, records[count].cell, count + 1, index + 1)
            records[index] = records[count]
    return count


@compiled
def _relink(records: Records, first: Cells, cell: int, old: int, new: int) -> None:
    """Redirect the link to `old` in a cell's chain to `new`."""
    if first[cell] == old:
        first[cell] = new
        return
    at = first[cell]
    while records[at - 1].next != old:
        at = records[at - 1].next
    records[at - 1].next = new


@compiled
def refresh_planes(
    records: Records,
    first: Cells,
    cells: npt.NDArray[np.int64],
    cols: int,
    prior: npt.NDArray[np.bool_],
    least: npt.NDArray[np.float32],
    class_ids: npt.NDArray[np.uint8],
    planes: BitPlanes,
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.int64]]:
    """Recompute the bits of (N,) cells in the plane of each class; return class and cell of every
    changed bit.

    A cell is occupied in a class if it has a point of the class with at least the confidence
    `least` (64,), and in class 0 also if the `prior` map occupies it.
    """
    changed_class = np.empty(len(cells) * len(class_ids), dtype=np.uint8)
    changed_cell = np.empty(len(cells) * len(class_ids), dtype=np.int64)
    count = 0
    for cell in cells:
        held = np.uint64(prior[cell])
        at = first[cell]
        while at > 0:
            point = records[at - 1]
            if point.confidence >= least[point.class_id]:
                held |= ONE << np.uint64(point.class_id)
            at = point.next
        line, col = cell // cols + PAD, cell % cols + PAD
        for plane in range(len(class_ids)):
            bit = ONE << np.uint64(col & 63)
            is_set = planes[plane, line, col >> 6] & bit != 0
            if is_set != (held >> np.uint64(class_ids[plane]) & ONE != 0):
                planes[plane, line, col >> 6] ^= bit
                changed_class[count], changed_cell[count] = class_ids[plane], cell
                count += 1
    return changed_class[:count], changed_cell[:count]


@compiled
def points_in(
    first: Cells, records: Records, cells: npt.NDArray[np.int64], kinds: npt.NDArray[np.bool_]
) -> npt.NDArray[np.int64]:
    """Return the indices of the points in (N,) distinct cells whose class is in `kinds`, (256,) by
    class id."""
    total = 0
    for cell in cells:
        at = first[cell]
        while at > 0:
            total += 1
            at = records[at - 1].next
    found, count = np.empty(total, dtype=np.int64), 0
    for cell in cells:
        at = first[cell]
        while at > 0:
            if kinds[records[at - 1].class_id]:
                found[count] = at - 1
                count += 1
            at = records[at - 1].next
    return found[:count]


@compiled
def redundant_points(
    records: Records, count: int, first: Cells, newest_pose_id: int
) -> npt.NDArray[np.int64]:
    """Return the indices of the points up to a pose ID that share cell and class with another
    point, all but the one with the highest confidence."""
    found = np.empty(count, dtype=np.int64)
    found_count = 0
    for index in range(count):
        point = records[index]
        if point.pose_id > newest_pose_id:
            continue
        at = first[point.cell]
        while at > 0:
            other = records[at - 1]
            if other.class_id == point.class_id and at - 1 != index:
                surer = other.confidence > point.confidence
                if surer or (other.confidence == point.confidence and at - 1 > index):
                    found[found_count] = index
                    found_count += 1
                    break
            at = other.next
    return found[:found_count]
