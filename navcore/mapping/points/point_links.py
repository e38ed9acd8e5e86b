"""The links between the points of a cell, compiled: records of `point_table.POINT` in a chain for
each cell."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, nested
from navcore.geometry.arrays import Indices
from navcore.grid.bitplane import ONE
from navcore.mapping.points.cell_set import EMPTY, cell_table, slot_of
from navcore.mission.beware_list import NOTHING

Cells = npt.NDArray[np.int32]
"""(cells,) index of the first point of each cell plus one; 0 for none."""
Records = npt.NDArray[np.void]
"""(N,) records of `POINT`."""


@compiled
def link(records: Records, count: int, first: Cells) -> None:
    """Link the points of each cell in the order of their indices; no cell has a link before."""
    for index in range(count):
        link_one(records, first, index)


@compiled
def link_points(records: Records, first: Cells, indices: Indices) -> None:
    """Link (N,) points that have no links to the others of their cells."""
    for index in indices:
        link_one(records, first, index)


@nested
def link_one(records: Records, first: Cells, index: int) -> None:
    """Add a point to the links of its cell."""
    cell = records[index].cell
    records[index].next = 0
    if cell >= 0:
        records[index].next = first[cell]
        first[cell] = index + 1


@nested
def unlink_one(records: Records, first: Cells, index: int) -> None:
    """Take a point out of the links of its cell."""
    if records[index].cell >= 0:
        _relink(records, first, records[index].cell, index + 1, records[index].next)


@compiled
def add_points(
    records: Records,
    changed: npt.NDArray[np.bool_],
    count: int,
    first: Cells,
    new: Records,
    one_per_cell: bool,
) -> tuple[int, bool]:
    raised = False
    table = cell_table(len(new))
    # Most points are geometric and certain, and a cell holds many: its levels are looked up once.
    levels, certain = np.zeros(len(table), np.uint64), np.zeros(len(table), np.bool_)
    for index in range(len(new)):
        cell, level = new[index].cell, new[index].level
        at, is_plain = 0, new[index].class_id == NOTHING and new[index].confidence == 1
        if is_plain and cell >= 0 and not one_per_cell:
            at = slot_of(table, cell)
            if table[at] == EMPTY:
                table[at] = cell
                levels[at], certain[at] = _geometric_levels(records, first, cell)
            is_plain = certain[at]
            if is_plain and levels[at] >> np.uint64(level) & ONE != 0:
                continue
            levels[at] |= ONE << np.uint64(level)
        else:
            is_plain = False
        best = -1 if is_plain else _surest(records, first, new[index], one_per_cell)
        if best >= 0:
            if new[index].confidence > records[best].confidence:
                records[best].confidence = new[index].confidence
                changed[best] = raised = True
            continue
        records[count] = new[index]
        changed[count] = True
        link_one(records, first, count)
        count += 1
    return count, raised


@nested
def _geometric_levels(records: Records, first: Cells, cell: int) -> tuple[np.uint64, bool]:
    """Return one bit for each height bin in which a cell has a geometric point, and whether all
    those points are certain."""
    levels, certain, at = np.uint64(0), True, first[cell]
    while at > 0:
        if records[at - 1].class_id == NOTHING:
            levels |= ONE << np.uint64(records[at - 1].level)
            certain = certain and records[at - 1].confidence >= 1
        at = records[at - 1].next
    return levels, certain


@nested
def _surest(records: Records, first: Cells, point: np.void, one_per_cell: bool) -> int:
    """Return the index of the most confident point of the same class in the voxel of a point, or
    with `one_per_cell` in its cell, and of equal ones the first, whatever the order of links; −1
    for none."""
    cell: int = point.cell  # type: ignore[attr-defined]
    at, best = first[cell] if cell >= 0 else 0, -1
    while at > 0:
        held = records[at - 1]
        if held.class_id == point.class_id and (one_per_cell or held.level == point.level):  # type: ignore[attr-defined]
            surer = best < 0 or held.confidence > records[best].confidence
            if surer or (held.confidence == records[best].confidence and at - 1 < best):
                best = at - 1
        at = held.next
    return best


@compiled
def remove_points(
    records: Records,
    changed: npt.NDArray[np.bool_],
    count: int,
    first: Cells,
    indices: npt.NDArray[np.int64],
) -> int:
    """Remove indices in falling order, so that no point that fills a gap is still to be removed."""
    for index in indices:
        unlink_one(records, first, index)
        count -= 1
        if index != count:
            if records[count].cell >= 0:
                _relink(records, first, records[count].cell, count + 1, index + 1)
            records[index] = records[count]
            changed[index] = True
    return count


@nested
def _relink(records: Records, first: Cells, cell: int, old: int, new: int) -> None:
    """Redirect the link to `old` in a cell's chain to `new`."""
    if first[cell] == old:
        first[cell] = new
        return
    at = first[cell]
    while records[at - 1].next != old:
        at = records[at - 1].next
    records[at - 1].next = new
