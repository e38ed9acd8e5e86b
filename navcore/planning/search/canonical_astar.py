"""A* from cell to cell in canonical order, for grids on which the walks of jump-point search are
short: exactly optimal, deterministic.

A jump point costs as much as seven cells here, since it is reached over several words and a hash
table. So among dense random obstacles, where a walk ends after a few cells, it pays to open the
cells themselves. The search takes the same paths as jump-point search, of all paths of one length
only the one that walks its diagonals first (Sturtevant & Rabin, "Canonical Orderings on Grids",
IJCAI 2016): which steps continue the last one is read from a table by the eight neighbours.

* The open list is a ring of eight buckets (Dial, "Shortest-Path Forest with Topological Ordering",
  CACM 1969), since a step lengthens the estimate of a path by less than six of them. A bucket is
  taken out whole, so that its cells are independent and the processor opens several at once, until
  nothing comes back into it; a cell is opened again if a shorter path reaches it. Only the first
  bucket is last in, first out, which leads straight to a goal that no detour is needed to.
* A label is one word: the length of the shortest path to a cell that is known, and the steps that
  continue it. Each search has labels below those of the searches before, so none is cleared.
* A length is in steps of 470832 units straight and 665857 diagonally. That fraction is a convergent
  of √2, so two lengths compare as the real ones as long as their numbers of diagonal steps differ
  by less than 470832.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navcore.compiled import inlined, lean, nested
from navcore.grid.bitplane import PAD, BitPlane, cells_from, lowest
from navcore.planning.search.open_list import (
    BEST,
    BOUND,
    CELL_BUCKETS,
    CELL_ENTRIES,
    CELL_LABELS,
    CELL_ROOM,
    CELL_SEARCHES,
    FAR,
    ROOT,
    UNIT,
    Memory,
)

STRAIGHT, DIAGONAL = 470832 << 8, 665857 << 8
"""Lengths of the steps; the lower eight bits of a label are a set of steps."""
STEPS = 255
"""Bits of a label that are steps."""
WIDTH = 26
"""Binary logarithm of the width of a bucket, 0.56 of a straight step."""
SPAN = 48
"""Binary logarithm of a length that no search reaches: 2^20 cells are the most it opens."""
MOST_SEARCHES = 1 << 14
"""Number of searches after which the labels are cleared."""

DIRECTIONS = ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1))
"""Steps (rows, cols), numbered as the walks of `jump_point_search`."""
ANY = 8
"""In place of the last step: the start, from which all steps are taken."""


def _continuations() -> npt.NDArray[np.uint8]:
    """Return (9, 512) the steps, as a set of bits, that continue a step in canonical order, by the
    step and the free cells among the nine around its end."""
    bit = {step: 1 << number for number, step in enumerate(DIRECTIONS)}
    table = np.zeros((9, 512), dtype=np.uint8)
    for window in range(512):

        def is_free(row: int, col: int, window: int = window) -> int:
            return window >> 3 * (row + 1) + col + 1 & 1

        open_steps = sum(
            bit[row, col]
            for row, col in DIRECTIONS
            if is_free(row, col) and is_free(row, 0) and is_free(0, col)
        )
        table[ANY, window] = open_steps
        for number, (row, col) in enumerate(DIRECTIONS):
            steps = bit[row, col]
            if row and col:
                steps |= bit[row, 0] | bit[0, col]
            for side in (-1, 1):  # An obstacle beside the cell before has just ended.
                if row == 0 and is_free(side, 0) > is_free(side, -col):
                    steps |= bit[side, 0] | bit[side, col]
                if col == 0 and is_free(0, side) > is_free(-row, side):
                    steps |= bit[0, side] | bit[row, side]
            table[number, window] = steps & open_steps
    return table


CONTINUATIONS = _continuations()
OFFSETS = np.array([row * (1 << 16) + col for row, col in DIRECTIONS], dtype=np.int64)
"""Difference of a cell's number by each step."""
LENGTHS = np.array([STRAIGHT] * 4 + [DIAGONAL] * 4, dtype=np.int64)


@lean
def search_cells(free: BitPlane, memory: Memory, start: int, goal: int, most: int) -> bool:
    """Label cells until the goal has its final label, none behind `memory[BOUND]`; return whether
    that came to an end before `most` entries of the open list.

    `start` and `goal` are free cells, numbered as in `jump_point_search`.
    """
    most, width = min(most, memory[CELL_ROOM]), 64 * free.shape[1]
    buckets, labels = np.uint64(memory[CELL_BUCKETS]), np.uint64(memory[CELL_LABELS])
    entries = np.uint64(memory[CELL_ENTRIES])
    origin = begin_cells(memory, width, free.shape[0])
    goal_row, goal_col = goal >> 16, goal & 0xFFFF
    at = index_of(start, width)
    least = origin + octile((start >> 16) - goal_row, (start & 0xFFFF) - goal_col)
    # Some more than the bound, whose units are others.
    best = np.int64(min(memory[BOUND], UNIT << 21) / UNIT * STRAIGHT) + STRAIGHT + origin - least
    steps = np.int64(CONTINUATIONS[ANY, around(free, at, width)])
    memory[labels + at] = origin | steps
    memory[entries] = steps << 32 | start
    memory[buckets] = count = 1
    bucket, empty = 0, 0
    while empty < 8 and bucket <= best >> WIDTH:
        first = buckets + np.uint64(bucket & 7)
        empty = empty + 1 if memory[first] == 0 else 0
        while memory[first] != 0:
            entry = memory[first]
            rest = memory[entries + np.uint64(entry - 1)] >> 40 if bucket == 0 else 0
            memory[first] = rest
            while entry != rest:
                if count + 8 > most:
                    return False
                opened = memory[entries + np.uint64(entry - 1)]
                entry, steps, cell = opened >> 40, opened >> 32 & STEPS, opened & 0xFFFFFFFF
                length = memory[labels + index_of(cell, width)] & ~STEPS
                while steps:
                    step = np.uint64(lowest(np.uint64(steps)))
                    steps &= steps - 1
                    there, longer = cell + OFFSETS[step], length + LENGTHS[step]
                    at = index_of(there, width)
                    further = np.int64(CONTINUATIONS[step, around(free, at, width)])
                    estimate = (
                        longer
                        - least
                        + octile((there >> 16) - goal_row, (there & 0xFFFF) - goal_col)
                    )
                    # What follows has no branches that would be guessed wrong half of the time.
                    old = memory[labels + at]
                    same = old ^ longer
                    known = same if np.uint64(same) <= np.uint64(STEPS) else np.int64(0)
                    gains = old >= longer and estimate < best
                    memory[labels + at] = (longer | further | known) if gains else old
                    further &= ~known
                    if there == goal and gains:
                        best = estimate
                    pushed = int(gains) & int(further != 0)
                    into = buckets + np.uint64(estimate >> WIDTH & 7)
                    head = memory[into]
                    memory[entries + np.uint64(count)] = head << 40 | further << 32 | there
                    count += pushed
                    memory[into] = count if pushed else head
        bucket += 1
    return True


@inlined
def begin_cells(memory: Memory, width: int, lines: int) -> int:
    """Empty the buckets, and return the label of a path of no length, which is below all labels."""
    if memory[CELL_SEARCHES] == MOST_SEARCHES:
        memory[CELL_SEARCHES] = 0
        for at in range(width * lines):
            memory[memory[CELL_LABELS] + at] = 0
    memory[CELL_SEARCHES] += 1
    for bucket in range(8):
        memory[memory[CELL_BUCKETS] + bucket] = 0
    return int(-(memory[CELL_SEARCHES] << SPAN))


@inlined
def index_of(cell: int, width: int) -> np.uint64:
    """Return the index of a cell's label."""
    return np.uint64((cell >> 16) * width + (cell & 0xFFFF))


@inlined
def around(free: BitPlane, at: np.uint64, width: int) -> np.uint64:
    """Return the free cells among the nine around a cell, row by row, the lowest bit first."""
    corner = np.int64(at) - 1
    byte, shift, line = corner >> 3, np.uint32(corner & 7), width >> 3
    three = np.uint32(7)
    above = cells_from(free, byte - line) >> shift & three
    beside = cells_from(free, byte) >> shift & three
    below = cells_from(free, byte + line) >> shift & three
    return np.uint64(above | beside << np.uint32(3) | below << np.uint32(6))


@inlined
def octile(rows: int, cols: int) -> int:
    """Return the length of the shortest path on an empty grid, by the distance in rows and
    columns."""
    rows, cols = abs(rows), abs(cols)
    low, high = min(rows, cols), max(rows, cols)
    return (high - low) * STRAIGHT + low * DIAGONAL


@nested
def trace_cells(free: BitPlane, memory: Memory, start: int, goal: int) -> npt.NDArray[np.int64]:
    """Return (N, 2) the cells of a path whose labels end at the goal, and note its length as
    `memory[BEST]`; (0, 2) where the goal has no label, or one behind the bound.

    Seen from the goal, a step is repeated as long as it leads along a shortest path.
    """
    width, labels = 64 * free.shape[1], np.uint64(memory[CELL_LABELS])
    origin = -(memory[CELL_SEARCHES] << SPAN)
    length = (memory[labels + index_of(goal, width)] & ~STEPS) - origin
    memory[BEST] = FAR
    if length >= 1 << SPAN:
        return np.empty((0, 2), dtype=np.int64)
    cells = np.empty((length // STRAIGHT + 1, 2), dtype=np.int64)
    first, cell, step, diagonal = len(cells) - 1, goal, 0, 0
    cells[first, 0], cells[first, 1] = (goal >> 16) - PAD, (goal & 0xFFFF) - PAD
    while cell != start:
        label = memory[labels + index_of(cell, width)] & ~STEPS
        while True:
            before = cell - OFFSETS[step]
            at = index_of(before, width)
            is_open = CONTINUATIONS[ANY, around(free, at, width)] >> step & 1
            if is_open and (memory[labels + at] & ~STEPS) + LENGTHS[step] == label:
                break
            step = (step + 1) & 7
        cell, first, diagonal = before, first - 1, diagonal + (step >= 4)
        cells[first, 0], cells[first, 1] = (cell >> 16) - PAD, (cell & 0xFFFF) - PAD
    memory[BEST] = (len(cells) - 1 - first - diagonal) * UNIT + diagonal * ROOT
    return cells[first:].copy()
