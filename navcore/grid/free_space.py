"""Free cells for the path search: packed by rows and by columns, with the jump points of straight
walks, updated incrementally.

Two stacks of planes (`navcore.grid.bitplane`): `across` has one line per row, `along` one line per
column, so that a walk east or west reads words of `across` and one south or north words of `along`.
Each stack holds, in this order,

* FREE: the cell is free;
* AHEAD: a walk towards higher cells stops here, at a blocked cell or at a jump point;
* BACK: the same for a walk towards lower cells;
* DEAD_END_AHEAD, DEAD_END_BACK: a walk from here ends at an obstacle, so it need not be taken.
  These are computed line by line, once searches have asked for a line several times
  (`find_dead_ends`). Word 0 of a line counts the requests; until then no dead end is known. Line 0
  of DEAD_END_AHEAD has a bit for each line of the other stack whose dead ends were dropped again
  (`planning.search.diagonals`);
* SQUARE (in `across` only): the cell and its neighbours east, south and south-east are free, so
  both diagonals are open.

A jump point of a straight walk is a cell beside which an obstacle has just ended: without corner
cutting this is the only place where an optimal path may turn (Harabor & Grastien, "Online Graph
Pruning for Pathfinding on Grid Maps", AAAI 2011, and "Improving Jump Point Search", ICAPS 2014,
which packs the rows into words).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, inlined, lean, nested
from navcore.grid.bitplane import (
    ALL,
    LONGEST_SIDE,
    MOST_CELLS,
    ONE,
    PAD,
    BitPlane,
    BitPlanes,
    blocks,
    complement,
    highest,
    lowest,
    mirrored,
    pack,
    transpose,
    unpack,
)
from navcore.grid.grid import BoolGrid, Cell
from navcore.grid.growth import Growth

FREE, AHEAD, BACK, DEAD_END_AHEAD, DEAD_END_BACK, SQUARE = range(6)
FREED_LOG = 4096
"""Largest number of freed cells that are recorded individually."""
REQUESTS_BEFORE_SCAN = np.uint64(16)
"""Requests for a line after which computing all its dead ends pays off."""
REBUILD_SHARE = 64
"""Everything is rebuilt, instead of word by word, if more than one word in this many differs."""
MAX_DIAGONAL_WORDS = 2**19
"""Largest number of words in a plane of `FreeSpace.diagonal_ends`; on larger grids diagonals share
slots."""


class FreeSpace:
    """Cells that the robot's centre may be in, with a log of changes for the owner of a path.

    Not to be shared between threads: a search marks its goal in the planes and removes the mark.
    """

    def __init__(self, rows: int, cols: int) -> None:
        if max(rows, cols) > LONGEST_SIDE or rows * cols > MOST_CELLS:
            raise ValueError(
                f"grid: expected sides of at most {LONGEST_SIDE} and at most {MOST_CELLS} cells, "
                f"got {rows} × {cols}; "
                "use a coarser resolution or a smaller area"
            )
        self.rows, self.cols = rows, cols
        self.across: BitPlanes = np.zeros((6, 64 * blocks(rows), blocks(cols)), dtype=np.uint64)
        self.along: BitPlanes = np.zeros((5, 64 * blocks(cols), blocks(rows)), dtype=np.uint64)
        diagonals, words = 64 * (blocks(rows) + blocks(cols)), blocks(rows)
        slots = 1 << min(
            (diagonals - 1).bit_length(), (MAX_DIAGONAL_WORDS // words).bit_length() - 1
        )
        self.diagonal_ends: BitPlanes = np.zeros((4, slots, words), dtype=np.uint64)
        """Cached ends of diagonal walks (`planning.search.diagonals`)."""
        self.sentinel: BitPlane = np.zeros(self.across.shape[1:], dtype=np.uint64)
        """Cells that the present path needs free."""
        self.freed: npt.NDArray[np.int64] = np.empty(FREED_LOG, dtype=np.int64)
        """Cells freed since the log was cleared, as (row << 32 | col)."""
        self.notes: npt.NDArray[np.int64] = np.zeros(2, dtype=np.int64)
        """Number of freed cells, recorded in `freed` or not, and number of words of the sentinel in
        which a cell was blocked."""
        self.written = (self.across, self.along, self.sentinel, self.freed, self.notes)
        """Arrays that a change of cells reads and writes, in the order of the compiled
        functions."""

    @staticmethod
    def of(blocked: BoolGrid) -> FreeSpace:
        """Return the free space of a bool (rows, cols) grid of blocked cells."""
        space = FreeSpace(*blocked.shape)
        pack(blocked, space.across[FREE])
        complement(space.across[FREE], space.rows, space.cols)
        space.rebuild()
        return space

    def adopt(self, space: FreeSpace, growth: Growth) -> None:
        """Take over the path's sentinel and the log of changes from the space of a smaller grid:
        the added cells belong to no path, and count as no change."""
        self.sentinel[:] = growth.plane(space.sentinel)
        self.freed[:] = space.freed + (growth.rows << 32 | growth.cols)
        self.notes[:] = space.notes

    def rebuild(self) -> None:
        """Recompute everything from the free cells of the rows; the log then says that any cell may
        have changed."""
        _rebuild(self.across, self.along)
        self.notes[:] = FREED_LOG + 1, 1

    def update(self, blocked: BoolGrid) -> None:
        """Update to a bool (rows, cols) grid of blocked cells; costs one pass over the cells, and
        then only the changes."""
        plane = np.zeros_like(self.sentinel)
        pack(blocked, plane)
        self.replace(plane)

    def replace(self, plane: BitPlane) -> None:
        """Update to a plane of blocked cells, which is overwritten."""
        complement(plane, self.rows, self.cols)
        if np.count_nonzero(plane != self.across[FREE]) * REBUILD_SHARE > plane.size:
            self.across[FREE] = plane
            self.rebuild()
            return
        _replace(*self.written, plane)

    def set_cells(self, cells: npt.NDArray[np.int64], blocked: bool) -> None:
        """Block or free (N, 2) cells (row, col) of the grid."""
        _set_cells(*self.written, cells, blocked)

    def contains(self, cell: Cell) -> bool:
        """Return whether this is a cell of the grid."""
        return 0 <= cell[0] < self.rows and 0 <= cell[1] < self.cols

    def is_free(self, cell: Cell) -> bool:
        """Return whether the robot's centre may be in this cell of the grid."""
        return bool(
            int(self.across[FREE, cell[0] + PAD, (cell[1] + PAD) >> 6]) >> (cell[1] & 63) & 1
        )

    def blocked(self) -> BoolGrid:
        """Return bool (rows, cols), True where the robot's centre must not be."""
        return ~unpack(self.across[FREE], self.rows, self.cols)


@inlined
def bit_of(planes: BitPlanes, plane: int, line: int, at: int) -> np.uint64:
    """Return one bit of a plane as 0 or 1."""
    bit: np.uint64 = (
        planes[np.uint64(plane), np.uint64(line), np.uint64(at >> 6)] >> np.uint64(at & 63) & ONE
    )
    return bit


@compiled
def _rebuild(across: BitPlanes, along: BitPlanes) -> None:
    transpose(across[FREE], along[FREE])
    mark_stops(across, along, PAD, across.shape[1] - PAD, 0, across.shape[2])
    mark_stops(along, across, PAD, along.shape[1] - PAD, 0, along.shape[2])
    mark_squares(across, PAD - 1, across.shape[1] - PAD, 0, across.shape[2] - 1)


@nested
def mark_stops(
    planes: BitPlanes, others: BitPlanes, first: int, last: int, left: int, right: int
) -> None:
    """Recompute AHEAD and BACK for lines first … last−1 and words left … right−1; `others` is the
    other stack."""
    free, ahead, back = planes[FREE], planes[AHEAD], planes[BACK]
    one, rest = np.uint64(1), np.uint64(63)
    low, high = max(left, 1), min(right, planes.shape[2] - 1)
    for line in range(first, last):
        above, below = np.uint64(line - 1), np.uint64(line + 1)
        here = np.uint64(line)
        for number in range(low, high):
            word = np.uint64(number)
            before, after = np.uint64(number - 1), np.uint64(number + 1)
            up, down, walls = free[above, word], free[below, word], ~free[here, word]
            opens = up & ~(up << one | free[above, before] >> rest) | down & ~(
                down << one | free[below, before] >> rest
            )
            closes = up & ~(up >> one | free[above, after] << rest) | down & ~(
                down >> one | free[below, after] << rest
            )
            ahead[here, word], back[here, word] = opens | walls, closes | walls
        drop_dead_ends(planes, others, line)
        if left == 0:
            ahead[line, 0] = back[line, 0] = ALL
        if right == planes.shape[2]:
            ahead[line, right - 1] = back[line, right - 1] = ALL


@inlined
def drop_dead_ends(planes: BitPlanes, others: BitPlanes, line: int) -> None:
    """Drop the known dead ends of a line, and mark what was derived from them as outdated."""
    if planes[DEAD_END_AHEAD, line, 0] >= REQUESTS_BEFORE_SCAN:
        others[DEAD_END_AHEAD, 0, line >> 6] |= ONE << np.uint64(line & 63)
        for word in range(planes.shape[2]):
            planes[DEAD_END_AHEAD, line, word] = planes[DEAD_END_BACK, line, word] = 0
    planes[DEAD_END_AHEAD, line, 0] = 0


@nested
def mark_squares(across: BitPlanes, first: int, last: int, left: int, right: int) -> None:
    """Recompute SQUARE for lines first … last−1 and words left … right−1."""
    free, square = across[FREE], across[SQUARE]
    one, rest = np.uint64(1), np.uint64(63)
    for line in range(first, last):
        here, below = np.uint64(line), np.uint64(line + 1)
        for number in range(left, right):
            word, after = np.uint64(number), np.uint64(number + 1)
            both, both_after = (
                free[here, word] & free[below, word],
                free[here, after] & free[below, after],
            )
            square[here, word] = both & (both >> one | both_after << rest)


@lean
def find_dead_ends(planes: BitPlanes, line: int) -> None:
    """Compute DEAD_END_AHEAD and DEAD_END_BACK for one line.

    A walk from cell c + 1 towards lower cells ends at a jump point if c is one, does not if c is
    blocked, and otherwise does as the walk from c. That is how carries run through an addition:
    generated at jump points and propagated by cells where no walk stops.
    """
    words = planes.shape[2]
    carry = np.uint64(0)
    for word in range(words):
        jumps = planes[BACK, line, word] & planes[FREE, line, word]
        hits, carry = _carries(jumps, ~planes[BACK, line, word], carry)
        planes[DEAD_END_BACK, line, word] = ~hits
    carry = np.uint64(0)
    for word in range(words - 1, -1, -1):
        jumps = planes[AHEAD, line, word] & planes[FREE, line, word]
        hits, carry = _carries(mirrored(jumps), mirrored(~planes[AHEAD, line, word]), carry)
        planes[DEAD_END_AHEAD, line, word] = ~mirrored(hits)
    planes[DEAD_END_AHEAD, line, 0] = REQUESTS_BEFORE_SCAN


@inlined
def _carries(
    generate: np.uint64, propagate: np.uint64, carry: np.uint64
) -> tuple[np.uint64, np.uint64]:
    """Return the carry into every bit of an addition, and the carry out of it."""
    into = ((generate | propagate) + generate + carry) ^ propagate
    return into, (generate | propagate & into) >> np.uint64(63)


@nested
def write_word(
    across: BitPlanes,
    along: BitPlanes,
    sentinel: BitPlane,
    freed: npt.NDArray[np.int64],
    notes: npt.NDArray[np.int64],
    line: int,
    word: int,
    value: np.uint64,
) -> np.uint64:
    """Set one word of free cells in the rows and in the columns; return the changed bits. `refresh`
    has to follow."""
    changed: np.uint64 = across[FREE, line, word] ^ value
    across[FREE, line, word] = value
    notes[1] += (changed & ~value & sentinel[line, word]) != 0
    bit, left = ONE << np.uint64(line & 63), changed
    while left != 0:
        offset = lowest(left)
        along[FREE, 64 * word + offset, line >> 6] ^= bit
        if value >> np.uint64(offset) & ONE:
            if notes[0] < len(freed):
                freed[notes[0]] = (line - PAD) << 32 | (64 * word + offset - PAD)
            notes[0] += 1
        left &= left - ONE
    return changed


@nested
def refresh(
    across: BitPlanes, along: BitPlanes, first: int, last: int, left: int, right: int
) -> None:
    """Recompute the marks around cells written in rows first … last−1 and columns left … right−1 of
    the planes."""
    over, under = max(first - 1, PAD), min(last + 1, across.shape[1] - PAD)
    mark_stops(across, along, over, under, (left - 1) >> 6, (right >> 6) + 1)
    mark_squares(across, first - 1, last, (left - 1) >> 6, ((right - 1) >> 6) + 1)
    over, under = max(left - 1, PAD), min(right + 1, along.shape[1] - PAD)
    mark_stops(along, across, over, under, (first - 1) >> 6, (last >> 6) + 1)


@compiled
def _replace(
    across: BitPlanes,
    along: BitPlanes,
    sentinel: BitPlane,
    freed: npt.NDArray[np.int64],
    notes: npt.NDArray[np.int64],
    plane: BitPlane,
) -> None:
    for line in range(PAD, across.shape[1] - PAD):
        left, right = along.shape[1], 0
        for word in range(1, plane.shape[1] - 1):
            if plane[line, word] != across[FREE, line, word]:
                changed = write_word(
                    across, along, sentinel, freed, notes, line, word, plane[line, word]
                )
                left = min(left, 64 * word + lowest(changed))
                right = max(right, 64 * word + highest(changed) + 1)
        if right > 0:
            refresh(across, along, line, line + 1, left, right)


@compiled
def _set_cells(
    across: BitPlanes,
    along: BitPlanes,
    sentinel: BitPlane,
    freed: npt.NDArray[np.int64],
    notes: npt.NDArray[np.int64],
    cells: npt.NDArray[np.int64],
    blocked: bool,
) -> None:
    for index in range(len(cells)):
        line, col = cells[index, 0] + PAD, cells[index, 1] + PAD
        word, bit = col >> 6, ONE << np.uint64(col & 63)
        value = across[FREE, line, word]
        value = value & ~bit if blocked else value | bit
        if write_word(across, along, sentinel, freed, notes, line, word, value):
            refresh(across, along, line, line + 1, col, col + 1)
