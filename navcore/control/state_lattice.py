"""The cheapest manoeuvre in a tight place: a search over (x, y, heading) with the oriented
footprint at every pose.

Hybrid A* after Dolgov et al. (2010), without a heuristic: the place is small, and any pose along
the path will do as its end. What an end still lacks is added to its cost, so the first end that the
search settles is the best there is.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

REACH_M = 2.2
"""Half the side of the square, about the robot, that is searched."""
CELL_M = 0.1
HEADINGS = 36
TURN_RAD = 2 * math.pi / HEADINGS
"""Poses in one cell whose headings differ by less are one to the search; turns in place are so
wide."""
STEP_M = 0.15
"""Longer than a cell's diagonal, so that every step leads to another cell."""
FORWARD, REVERSE, TURNING = 1, -1, 0
"""What a step is."""
KINDS = np.array([FORWARD] * 5 + [REVERSE] * 5 + [TURNING] * 2, dtype=np.int64)
TURNS_RAD = np.array([0.0, 1.0, -1.0, 2.0, -2.0, 0.0, 1.0, -1.0, 2.0, -2.0, 1.0, -1.0]) * TURN_RAD
"""By step: how far the heading turns in it."""
BUDGET = 60_000
"""So many poses are settled at most."""
NEAR_M = 0.15
"""Less room than this costs extra."""
SWITCH_COST, REVERSE_COST, TURN_COST, TIGHT_COST = 0.15, 2.5, 0.6, 1.5
"""Of changing from one kind of step to another; of a metre in reverse; of a radian in place; of a
metre without any room."""
SWEEP_M = 0.12
"""With more room than this at the end of a step there is some on its way, too: a turning corner
bulges out by far less."""
BUCKET_M = 0.2

Place = tuple[Floats, Floats, Ints, int, float, float, float, float]
"""Points sorted by buckets, their radii, where each bucket begins, buckets a side, metres from the
robot to the first's edge, half the length and half the width of the footprint, and the farthest
that any disc matters, in metres."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ends:
    """Which poses the manoeuvre may end at."""

    cost: Floats
    """(N, N) by cell, row along y: what is still lacking where the manoeuvre ends there; infinite
    where it may not."""
    heading_rad: Floats
    """(N, N) the heading asked for there: what it still has to turn is lacking, too …"""
    askew_rad: float = math.pi
    """… and it may be so much."""


def cells() -> tuple[Floats, Floats]:
    """(N, N) x and y of the cells' centres, base frame."""
    centres = (np.arange(round(2 * REACH_M / CELL_M)) + 0.5) * CELL_M - REACH_M
    x, y = np.meshgrid(centres, centres)
    return x, y


def cheapest(
    obstacles: Floats, radii_m: Floats, ends: Ends, *, half_length_m: float, half_width_m: float
) -> tuple[Floats, Ints]:
    """(K, 3) poses one step apart, base frame, to the best end from (0, 0, 0), and (K,) the kinds
    of the steps; (0, 3) if none.

    At every pose but the first the footprint keeps clear of all (M, 2) obstacles, base frame, each
    a disc of one of (M,) radii.
    """
    widest = max(float(radii_m.max(initial=0.0)), 0.0) + NEAR_M
    reach = REACH_M + math.hypot(half_length_m, half_width_m) + widest
    side = math.ceil(2 * reach / BUCKET_M)
    bucket = np.floor((obstacles + reach) / BUCKET_M).astype(np.int64)
    within = ((bucket >= 0) & (bucket < side)).all(axis=1)
    key = bucket[within, 1] * side + bucket[within, 0]
    order = np.argsort(key, kind="stable")
    starts = np.searchsorted(key[order], np.arange(side * side + 1))
    points = np.ascontiguousarray(obstacles[within][order])
    radii = np.ascontiguousarray(radii_m[within][order])
    found = _search(
        (points, radii, starts, side, reach, half_length_m, half_width_m, widest),
        ends.cost,
        ends.heading_rad,
        ends.askew_rad,
    )
    return found[0], found[1]


@compiled
def _search(
    place: Place, end_cost: Floats, end_heading: Floats, askew: float
) -> tuple[Floats, Ints]:
    size = end_cost.shape[0]
    count = size * size * HEADINGS
    cost = np.full(count + 1, np.inf)
    poses = np.zeros((count, 3))
    came, step = np.full(count + 1, -1, np.int64), np.full(count, -1, np.int64)
    done = np.zeros(count + 1, np.bool_)
    start = ((size // 2) * size + size // 2) * HEADINGS
    cost[start] = 0.0
    heap, settled = [(0.0, start)], 0
    while len(heap) > 0:
        so_far, at = heapq.heappop(heap)
        if done[at]:
            continue
        done[at] = True
        settled += 1
        if at == count or settled > BUDGET:
            break
        x, y, heading = poses[at, 0], poses[at, 1], poses[at, 2]
        cell = at // HEADINGS
        lacking = end_cost[cell // size, cell % size]
        if lacking < np.inf:
            off = abs(
                (heading - end_heading[cell // size, cell % size] + math.pi) % (2 * math.pi)
                - math.pi
            )
            if off <= askew and so_far + lacking + TURN_COST * off < cost[count]:
                cost[count], came[count] = so_far + lacking + TURN_COST * off, at
                heapq.heappush(heap, (cost[count], count))
        for way in range(len(KINDS)):
            kind, turn = KINDS[way], TURNS_RAD[way]
            there_x, there_y, length = x, y, 0.0
            if kind != TURNING:
                # The chord of the arc, which leaves at half its turn.
                length = STEP_M
                chord = kind * (STEP_M if turn == 0.0 else STEP_M * math.sin(turn / 2) / (turn / 2))
                bearing = heading + kind * turn / 2
                there_x, there_y = x + chord * math.cos(bearing), y + chord * math.sin(bearing)
            there_heading = heading + turn * (kind if kind != TURNING else 1)
            column, row = (
                math.floor((there_x + REACH_M) / CELL_M),
                math.floor((there_y + REACH_M) / CELL_M),
            )
            if not (0 <= column < size and 0 <= row < size):
                continue
            into = round(there_heading / TURN_RAD) % HEADINGS
            node = (row * size + column) * HEADINGS + into
            if done[node]:
                continue
            least = (
                length
                if kind == FORWARD
                else REVERSE_COST * length
                if kind == REVERSE
                else TURN_COST * TURN_RAD
            )
            least += SWITCH_COST if step[at] >= 0 and KINDS[step[at]] != kind else 0.0
            if so_far + least >= cost[node]:
                continue
            free = _room(there_x, there_y, there_heading, place)
            if turn != 0.0 and 0.0 < free < SWEEP_M:
                free = min(free, _room_between(x, y, heading, kind, turn, place))
            if free <= 0.0:
                continue
            total = so_far + least + TIGHT_COST * max(length, 0.05) * (1 - free / NEAR_M)
            if total < cost[node]:
                cost[node], came[node], step[node] = total, at, way
                poses[node, 0], poses[node, 1], poses[node, 2] = there_x, there_y, there_heading
                heapq.heappush(heap, (total, node))
    return _traced(came, step, poses, came[count], start)


@compiled
def _room_between(
    x: float, y: float, heading: float, kind: int, turn: float, place: Place
) -> float:
    """Least room on the way of a step that turns: the corners come nearer to things than before and
    after it."""
    parts, least = 2 * round(abs(turn) / TURN_RAD), NEAR_M
    for part in range(1, parts):
        turned = turn * part / parts * (kind if kind != TURNING else 1)
        chord, bearing = kind * STEP_M * part / parts, heading + turned / 2
        least = min(
            least,
            _room(
                x + chord * math.cos(bearing),
                y + chord * math.sin(bearing),
                heading + turned,
                place,
            ),
        )
    return least


@compiled
def _traced(came: Ints, step: Ints, poses: Floats, last: int, start: int) -> tuple[Floats, Ints]:
    length, at = 0, last
    while at >= 0 and at != start:
        length, at = length + 1, came[at]
    found, kinds = np.empty((length, 3)), np.empty(length, np.int64)
    at = last
    for index in range(length - 1, -1, -1):
        found[index], kinds[index] = poses[at], KINDS[step[at]]
        at = came[at]
    return found, kinds


@compiled
def _room(x: float, y: float, heading: float, place: Place) -> float:
    """Least distance from the footprint to any disc, at most `NEAR_M`."""
    points, radii, starts, side, reach, half_length, half_width, widest = place
    cos, sin = math.cos(heading), math.sin(heading)
    wide = half_length * abs(cos) + half_width * abs(sin) + widest
    high = half_length * abs(sin) + half_width * abs(cos) + widest
    left = max(math.floor((x - wide + reach) / BUCKET_M), 0)
    right = min(math.floor((x + wide + reach) / BUCKET_M), side - 1)
    low = max(math.floor((y - high + reach) / BUCKET_M), 0)
    top = min(math.floor((y + high + reach) / BUCKET_M), side - 1)
    least = NEAR_M
    for row in range(low, top + 1):
        for index in range(starts[row * side + left], starts[row * side + right + 1]):
            dx, dy = points[index, 0] - x, points[index, 1] - y
            out_x = max(abs(cos * dx + sin * dy) - half_length, 0.0)
            out_y = max(abs(cos * dy - sin * dx) - half_width, 0.0)
            least = min(least, math.sqrt(out_x * out_x + out_y * out_y) - radii[index])
    return least
