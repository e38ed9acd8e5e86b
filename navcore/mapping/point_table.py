"""The points of the global map, as a value and as a live table in which the points of a cell are
chained together.

With the chain of a cell at hand, whatever happens to the map costs as much as the cells it happens
to, however large the map.
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
"""A point of the map, 40 bytes: where, how far from the camera, how sure, seen from which pose; its
cell (row · cols + col), the next point of the cell plus one (0: none), colour, class and height
bin."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapPoints:
    """The points of the map at one moment."""

    points_map: npt.NDArray[np.float32]
    """(N, 3) metres of the map frame."""
    rgb: npt.NDArray[np.uint8]
    """(N, 3) colour."""
    class_ids: npt.NDArray[np.uint8]
    """(N,) class of the beware list; `NOTHING` for geometric points."""
    confidence: npt.NDArray[np.float32]
    """(N,) of the segmenter."""
    range_m: npt.NDArray[np.float32]
    """(N,) depth at which each was measured."""
    pose_ids: npt.NDArray[np.int32]
    """(N,) pose that each belongs to."""


class PointTable:
    """The live points. Only the first `count` records count; a voxel holds at most one point of a
    class."""

    def __init__(self, cells: int) -> None:
        """For a grid of so many cells."""
        self.count = 0
        self.records: Records = np.zeros(0, dtype=POINT)
        # Pages that nothing was ever written to cost no memory: a large map is paid for where there
        # is something on it.
        self.first: Cells = np.zeros(cells, dtype=np.int32)
        """(cells,) the first point of each cell plus one, 0 where there is none."""

    def add(self, new: Records, *, one_per_cell: bool = False) -> bool:
        """Put in points whose voxel holds none of their class; else the surer of the two counts.
        Whether any became surer.

        With `one_per_cell` a cell that holds a point of the class takes no other.
        """
        self._make_room(len(new))
        self.count, raised = _add(self.records, self.count, self.first, new, one_per_cell)
        return bool(raised)

    def remove(self, indices: npt.NDArray[np.int64]) -> None:
        """Take points out; the last ones take their places."""
        self.count = _remove(
            self.records, self.count, self.first, np.sort(indices)[::-1].astype(np.int64)
        )

    @property
    def live(self) -> Records:
        """(count,) view of the points."""
        return self.records[: self.count]

    @property
    def bytes_used(self) -> int:
        """Memory of the points, without room to grow."""
        return self.count * POINT.itemsize

    def copied(self) -> MapPoints:
        """All points, as a value."""
        live = self.live
        return MapPoints(
            points_map=np.column_stack([live["x"], live["y"], live["z"]]),
            rgb=np.column_stack([live["r"], live["g"], live["b"]]),
            class_ids=live["class_id"].copy(),
            confidence=live["confidence"].copy(),
            range_m=live["range_m"].copy(),
            pose_ids=live["pose_id"].copy(),
        )

    def _make_room(self, more: int) -> None:
        if self.count + more > len(self.records):
            grown = np.zeros(max(2 * (self.count + more), 4096), dtype=POINT)
            grown[: self.count] = self.live
            self.records = grown


def levels_of(z_m: npt.NDArray[np.float32]) -> npt.NDArray[np.uint8]:
    """(N,) height bin of each height."""
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
    """Indices in falling order: what moves into a gap is never one that has still to go."""
    for index in indices:
        _relink(records, first, records[index].cell, index + 1, records[index].next)
        count -= 1
        if index != count:
            _relink(records, first, records[count].cell, count + 1, index + 1)
            records[index] = records[count]
    return count


@compiled
def _relink(records: Records, first: Cells, cell: int, old: int, new: int) -> None:
    """Have the link of a cell's chain that leads to `old` lead to `new`."""
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
    """Make the bits of (N,) cells anew in the plane of each class; returns class and cell of every
    bit that changed.

    A cell is occupied in a class when it holds a point of it that is at least as sure as `least`
    (64,) says, and in class 0 also where the `prior` map has something.
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
    """Indices of the points in (N,) cells, each named once, whose class is among `kinds`, (256,) by
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
def coarse_doubles(
    records: Records, count: int, first: Cells, newest_pose_id: int
) -> npt.NDArray[np.int64]:
    """Indices of points up to a pose ID that share cell and class with another: all but one of each
    cell, the surest."""
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
