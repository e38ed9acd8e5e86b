"""Questions to the points of some cells: what they occupy, which are of a class, which are
redundant."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.geometry.arrays import Indices
from navcore.grid.bitplane import ONE, PAD, BitPlanes
from navcore.grid.grid import Box
from navcore.mapping.points.cell_set import distinct
from navcore.mapping.points.point_links import Cells, Records


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
    """Recompute the bits of (N,) cells, some of them several times, in the plane of each class;
    return class and cell of every changed bit.

    A cell is occupied in a class if it has a point of the class with at least the confidence
    `least` (64,), and in class 0 also if the `prior` map occupies it.
    """
    cells = distinct(cells)
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
def points_in_box(records: Records, count: int, first: Cells, cols: int, box: Box) -> Indices:
    """Return the indices of the points in a box of cells, the first ones of all cells before their
    second ones: link by link, each would wait for the memory of the one before."""
    held, begin, end = np.empty(count, dtype=np.int64), 0, 0
    for row in range(box[0], box[2]):
        for col in range(box[1], box[3]):
            if first[row * cols + col] > 0:
                held[end] = first[row * cols + col] - 1
                end += 1
    while begin < end:
        begin, level = end, range(begin, end)
        for at in level:
            if records[held[at]].next > 0:
                held[end] = records[held[at]].next - 1
                end += 1
    return held[:end]


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
        if point.pose_id > newest_pose_id or point.cell < 0:
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
