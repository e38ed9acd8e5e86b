"""Which rules must be lifted, at the least, for a path to open: the smallest set, found exactly.

Cells that are closed by the same rules and hang together are one *region*. A way through regions
needs every rule of every region that it crosses lifted, and costs as many as these are. So the
search runs over pairs (region, rules lifted so far), cheapest first, and drops a pair when its
region was reached with a part of its rules already: that one can go wherever this one can, for no
more. The first pair taken at the goal is a smallest set. (Robotics calls this minimum constraint
removal; in the worst case the pairs grow exponentially with the rules, hence the bound. What was
taken last is then still a lower bound of the answer's size.)

The regions hang together by straight steps: a diagonal step needs both straight neighbours free, so
it opens nothing new.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from navcore.grid.grid import Cell
from navcore.planning.path_explanation import Rules

MAX_LABELS = 100_000
"""Pairs that are looked at, at most: about a second."""
_WALL = -1

Ints = npt.NDArray[np.int32]


@dataclass(frozen=True, slots=True, kw_only=True)
class Removal:
    """What has to go for a path to open."""

    keys: tuple[str, ...] | None
    """Of the rules, in the order of the list; empty when a path is open as it is; None when none
    was found."""
    exact: bool
    """Whether that is proven: the set is a smallest one, or none exists. False when the search was
    given up."""
    at_least: int
    """No smaller number of rules opens a path. 0 when none exists whatever is lifted."""


def minimum_removal(
    rules: Rules, start: Cell, goal: Cell, *, max_labels: int = MAX_LABELS
) -> Removal:
    """The smallest set of rules without which there is a path from start to goal, (row, col) both;
    of several any one.

    The rules that close the start or the goal itself count too. No set helps where walls part the
    two.
    """
    regions, signatures = _regions(rules)
    if not all(
        0 <= cell[0] < rules.spec.rows and 0 <= cell[1] < rules.spec.cols for cell in (start, goal)
    ):
        return Removal(keys=None, exact=True, at_least=0)
    first, last = int(regions[start]), int(regions[goal])
    if _WALL in (first, last):
        return Removal(keys=None, exact=True, at_least=0)
    lifted, exact, bound = _search(
        _neighbours(regions, len(signatures)), signatures, first, last, max_labels
    )
    if lifted is None:
        return Removal(keys=None, exact=exact, at_least=bound)
    keys = tuple(rule.key for index, rule in enumerate(rules.liftable) if lifted >> index & 1)
    return Removal(keys=keys, exact=True, at_least=len(keys))


def _search(
    neighbours: list[list[int]], signatures: list[int], first: int, last: int, max_labels: int
) -> tuple[int | None, bool, int]:
    """Lifted rules as bits (None: not found), whether that is proven, and how many rules are needed
    at the least."""
    waiting = [(signatures[first].bit_count(), 0, first, signatures[first])]
    taken: list[list[int]] = [[] for _ in signatures]
    pushed = looked = 0
    while waiting:
        cost, _, region, lifted = heapq.heappop(waiting)
        if any(other & lifted == other for other in taken[region]):
            continue
        if region == last:
            return lifted, True, cost
        looked += 1
        if looked > max_labels:
            return None, False, cost
        taken[region].append(lifted)
        for beside in neighbours[region]:
            more = lifted | signatures[beside]
            if not any(other & more == other for other in taken[beside]):
                pushed += 1
                heapq.heappush(waiting, (more.bit_count(), pushed, beside, more))
    return None, True, 0


def _regions(rules: Rules) -> tuple[Ints, list[int]]:
    """(rows, cols) index of each cell's region, `_WALL` where something stands, and the rules of
    each region as bits."""
    kinds = np.zeros((rules.spec.rows, rules.spec.cols), dtype=np.int32)
    sets = [0]
    for bit, rule in enumerate(rules.liftable):
        inside = np.flatnonzero(rule.closed)
        window = kinds[rule.window]
        before, inverse = np.unique(window.flat[inside], return_inverse=True)
        window.flat[inside] = len(sets) + inverse
        sets += [sets[kind] | 1 << bit for kind in before]
    if rules.walls is not None:
        kinds[rules.walls.window][rules.walls.closed] = _WALL
    regions = np.full(kinds.shape, _WALL, dtype=np.int32)
    signatures: list[int] = []
    for kind in np.flatnonzero(np.bincount(kinds[kinds >= 0], minlength=1)):
        count, names = cv2.connectedComponents((kinds == kind).view(np.uint8), connectivity=4)
        held = names > 0
        regions[held] = names[held] - 1 + len(signatures)
        signatures += [sets[kind]] * (count - 1)
    return regions, signatures


def _neighbours(regions: Ints, count: int) -> list[list[int]]:
    """The regions beside each region."""
    pairs = []
    for one, other in ((regions[:, :-1], regions[:, 1:]), (regions[:-1], regions[1:])):
        border = (one != other) & (one != _WALL) & (other != _WALL)
        pairs.append(np.column_stack([one[border], other[border]]))
    beside: list[list[int]] = [[] for _ in range(count)]
    for a, b in np.unique(np.sort(np.vstack(pairs), axis=1), axis=0).tolist():
        beside[a].append(b)
        beside[b].append(a)
    return beside
