"""The cheapest manoeuvre among close obstacles: a search over (x, y, heading) with the oriented
footprint at every pose.

Hybrid A* after Dolgov et al. (2010), without a heuristic: the area is small, and any pose along the
path may be its end. The shortfall of an end is added to its cost, so the first end that the search
settles is the best.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, inlined, nested
from navcore.config.control import StateLatticeConfig
from navcore.geometry.arrays import Floats, Indices

FORWARD, REVERSE, TURNING = 1, -1, 0
"""Kinds of steps."""
KINDS = np.array([FORWARD] * 5 + [REVERSE] * 5 + [TURNING] * 2, dtype=np.int64)
"""(12,) kind of each step."""
TURNS = np.array([0, 1, -1, 2, -2, 0, -1, 1, -2, 2, 1, -1], dtype=np.int64)
"""(12,) change of heading in each step, in headings of the lattice."""
BUCKET_M = 0.2
"""Side in metres of the buckets that obstacles are sorted into."""


class _Lattice(NamedTuple):
    """The configuration as the compiled search takes it."""

    half_side: float
    cell: float
    headings: int
    turn: float
    step: float
    max_states: int
    clearance: float
    switch_cost: float
    reverse_cost: float
    turn_cost: float
    clearance_cost: float
    min_length: float
    sweep: float


class _Obstacles(NamedTuple):
    """Discs, sorted by buckets, and the footprint that keeps clear of them; metres."""

    points: Floats
    """(M, 2) centres."""
    radii: Floats
    """(M,) radii."""
    starts: Indices
    """(side² + 1,) index of each bucket's first disc."""
    side: int
    """Number of buckets along each side of the square."""
    reach: float
    """Distance from the robot to the edge of the first bucket."""
    half_length: float
    """Half the length of the footprint."""
    half_width: float
    """Half the width of the footprint."""
    widest: float
    """Distance beyond which no disc makes a difference."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ends:
    """The poses at which a manoeuvre may end."""

    cost: Floats
    """(N, N) by cell, row along y: shortfall in metres of a manoeuvre that ends there; infinite
    where it may not."""
    heading_rad: Floats
    """(N, N) heading asked for in each cell; the turn to it counts as shortfall too."""
    tolerance_rad: float = math.pi
    """Largest difference to the heading asked for."""


def cells(config: StateLatticeConfig) -> tuple[Floats, Floats]:
    """Return (N, N) x and y of the cells' centres, base frame."""
    count = round(2 * config.half_side_m / config.cell_m)
    centres = (np.arange(count) + 0.5) * config.cell_m - config.half_side_m
    x, y = np.meshgrid(centres, centres)
    return x, y


def cheapest(
    obstacles: Floats,
    radii_m: Floats,
    ends: Ends,
    *,
    footprint_m: tuple[float, float],
    config: StateLatticeConfig,
) -> tuple[Floats, Indices]:
    """Find (K, 3) poses one step apart, base frame, from (0, 0, 0) to the best end, and the (K,)
    kinds of the steps; (0, 3) if there are none.

    At every pose but the first the footprint keeps clear of all (M, 2) obstacles, base frame, each
    a disc of one of (M,) radii. `footprint_m` is half its length and half its width.
    """
    widest = max(float(radii_m.max(initial=0.0)), 0.0) + config.clearance_m
    reach = config.half_side_m + math.hypot(*footprint_m) + widest
    side = math.ceil(2 * reach / BUCKET_M)
    bucket = np.floor((obstacles + reach) / BUCKET_M).astype(np.int64)
    within = ((bucket >= 0) & (bucket < side)).all(axis=1)
    key = bucket[within, 1] * side + bucket[within, 0]
    order = np.argsort(key, kind="stable")
    discs = _Obstacles(
        np.ascontiguousarray(obstacles[within][order]),
        np.ascontiguousarray(radii_m[within][order]),
        np.searchsorted(key[order], np.arange(side * side + 1)),
        side,
        reach,
        *footprint_m,
        widest,
    )
    lattice = _lattice(config)
    quarters = np.arange(4 * lattice.headings) * lattice.turn / 4
    directions = np.column_stack([np.cos(quarters), np.sin(quarters)])
    poses, kinds = _search(
        discs, lattice, directions, ends.cost, ends.heading_rad, ends.tolerance_rad
    )
    return poses, kinds


def _lattice(config: StateLatticeConfig) -> _Lattice:
    return _Lattice(
        half_side=config.half_side_m,
        cell=config.cell_m,
        headings=config.headings,
        turn=2 * math.pi / config.headings,
        step=config.step_m,
        max_states=config.max_states,
        clearance=config.clearance_m,
        switch_cost=config.switch_cost,
        reverse_cost=config.reverse_cost,
        turn_cost=config.turn_cost,
        clearance_cost=config.clearance_cost,
        min_length=config.min_length_m,
        sweep=config.sweep_m,
    )


@compiled
def _search(
    discs: _Obstacles,
    lattice: _Lattice,
    directions: Floats,
    end_cost: Floats,
    end_heading: Floats,
    tolerance: float,
) -> tuple[Floats, Indices]:
    """`directions` are (4 · headings, 2) cosine and sine of every quarter of a heading: the chord
    of an arc leaves at half its turn, and arcs are checked at half headings, too."""
    size = end_cost.shape[0]
    count = size * size * lattice.headings
    cost = np.full(count + 1, np.inf)
    # Of the reached states only, so that most of these large arrays is never touched.
    positions, heading_of = np.empty((count, 2)), np.empty(count, np.int32)
    came, step = np.full(count + 1, -1, np.int32), np.full(count, -1, np.int8)
    done = np.zeros(count + 1, np.bool_)
    start = ((size // 2) * size + size // 2) * lattice.headings
    cost[start], heading_of[start] = 0.0, 0
    positions[start] = 0.0
    chords = np.zeros(len(KINDS))
    for index in range(len(KINDS)):
        if KINDS[index] != TURNING:
            half = TURNS[index] * lattice.turn / 2
            chords[index] = KINDS[index] * lattice.step * (math.sin(half) / half if half else 1.0)
    heap, settled = [(0.0, start)], 0
    while len(heap) > 0:
        so_far, at = heapq.heappop(heap)
        if done[at]:
            continue
        done[at] = True
        settled += 1
        if at == count or settled > lattice.max_states:
            break
        x, y, heading = positions[at, 0], positions[at, 1], heading_of[at]
        cell = at // lattice.headings
        shortfall = end_cost[cell // size, cell % size]
        if shortfall < np.inf:
            off = heading * lattice.turn - end_heading[cell // size, cell % size]
            off = abs((off + math.pi) % (2 * math.pi) - math.pi)
            total = so_far + shortfall + lattice.turn_cost * off
            if off <= tolerance and total < cost[count]:
                cost[count], came[count] = total, at
                heapq.heappush(heap, (total, count))
        for index in range(len(KINDS)):
            kind, turn = KINDS[index], TURNS[index]
            there_x, there_y = _after(x, y, heading, index, chords, directions)
            column = math.floor((there_x + lattice.half_side) / lattice.cell)
            row = math.floor((there_y + lattice.half_side) / lattice.cell)
            if not (0 <= column < size and 0 <= row < size):
                continue
            into = (heading + turn) % lattice.headings
            node = (row * size + column) * lattice.headings + into
            if done[node]:
                continue
            length = 0.0 if kind == TURNING else lattice.step
            least = (
                length
                if kind == FORWARD
                else lattice.reverse_cost * length
                if kind == REVERSE
                else lattice.turn_cost * lattice.turn
            )
            if step[at] >= 0 and KINDS[step[at]] != kind:
                least += lattice.switch_cost
            if so_far + least >= cost[node]:
                continue
            free = _clearance(there_x, there_y, directions[4 * into], discs, lattice.clearance)
            if turn != 0 and 0.0 < free < lattice.sweep:
                free = min(
                    free, _clearance_between(x, y, heading, index, discs, lattice, directions)
                )
            if free <= 0.0:
                continue
            total = (
                so_far
                + least
                + lattice.clearance_cost
                * max(length, lattice.min_length)
                * (1 - free / lattice.clearance)
            )
            if total < cost[node]:
                cost[node], came[node], step[node] = total, at, index
                positions[node, 0], positions[node, 1] = there_x, there_y
                heading_of[node] = heading + turn
                heapq.heappush(heap, (total, node))
    return _traced(came, step, positions, heading_of, lattice.turn, came[count], start)


@inlined
def _after(
    x: float, y: float, heading: int, index: int, chords: Floats, directions: Floats
) -> tuple[float, float]:
    """Return the position after a step."""
    bearing = (4 * heading + 2 * TURNS[index]) % len(directions)
    return x + chords[index] * directions[bearing, 0], y + chords[index] * directions[bearing, 1]


@nested
def _clearance_between(
    x: float,
    y: float,
    heading: int,
    index: int,
    discs: _Obstacles,
    lattice: _Lattice,
    directions: Floats,
) -> float:
    """Least clearance within a step that turns, at every half heading: the corners come nearer to
    obstacles than before and after it."""
    kind, turn = KINDS[index], TURNS[index]
    parts, least, side = 2 * abs(turn), lattice.clearance, 1 if turn > 0 else -1
    for part in range(1, parts):
        chord = kind * lattice.step * part / parts
        cos, sin = directions[(4 * heading + side * part) % len(directions)]
        turned = directions[(4 * heading + 2 * side * part) % len(directions)]
        free = _clearance(x + chord * cos, y + chord * sin, turned, discs, lattice.clearance)
        least = min(least, free)
    return least


@nested
def _traced(
    came: npt.NDArray[np.int32],
    step: npt.NDArray[np.int8],
    positions: Floats,
    heading_of: npt.NDArray[np.int32],
    turn: float,
    last: int,
    start: int,
) -> tuple[Floats, Indices]:
    length, at = 0, last
    while at >= 0 and at != start:
        length, at = length + 1, came[at]
    found, kinds = np.empty((length, 3)), np.empty(length, np.int64)
    at = last
    for index in range(length - 1, -1, -1):
        found[index, 0], found[index, 1] = positions[at, 0], positions[at, 1]
        found[index, 2], kinds[index] = heading_of[at] * turn, KINDS[step[at]]
        at = came[at]
    return found, kinds


@nested
def _clearance(x: float, y: float, ahead: Floats, discs: _Obstacles, most: float) -> float:
    """Least distance from the footprint, which points `ahead`, to any disc, at most `most`; any
    number that is not positive where they overlap."""
    cos, sin = ahead[0], ahead[1]
    half_length, half_width, side = discs.half_length, discs.half_width, discs.side
    wide = half_length * abs(cos) + half_width * abs(sin) + discs.widest
    high = half_length * abs(sin) + half_width * abs(cos) + discs.widest
    left = max(math.floor((x - wide + discs.reach) / BUCKET_M), 0)
    right = min(math.floor((x + wide + discs.reach) / BUCKET_M), side - 1)
    low = max(math.floor((y - high + discs.reach) / BUCKET_M), 0)
    top = min(math.floor((y + high + discs.reach) / BUCKET_M), side - 1)
    least = most
    for row in range(low, top + 1):
        for index in range(discs.starts[row * side + left], discs.starts[row * side + right + 1]):
            dx, dy = discs.points[index, 0] - x, discs.points[index, 1] - y
            out_x = max(abs(cos * dx + sin * dy) - half_length, 0.0)
            out_y = max(abs(cos * dy - sin * dx) - half_width, 0.0)
            squared, radius = out_x * out_x + out_y * out_y, discs.radii[index]
            if squared < (radius + least) ** 2:
                least = float(math.sqrt(squared) - radius)
                if least <= 0.0:
                    return least
    return least
