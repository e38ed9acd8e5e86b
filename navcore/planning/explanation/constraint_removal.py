"""Minimum constraint removal: the smallest set of rules without which a path exists, exactly.

Connected cells that are closed by the same rules form one *region*. A path through regions needs
every rule of every region that it crosses removed, and costs their number. So the search runs over
pairs (region, rules removed so far), cheapest first, and drops a pair whose region was reached with
a subset of its rules already: that one leads wherever this one does, at no higher cost. The first
pair taken at the goal is a smallest set. In the worst case the pairs grow exponentially with the
rules, hence the bound; the pair taken last is then still a lower bound of the size.

Regions are connected by straight steps: a diagonal step needs both straight neighbours free, so it
connects no more.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from navcore.config.planning import PLANNING_CONFIG, ConstraintRemovalConfig
from navcore.grid.grid import Cell
from navcore.planning.explanation.path_explanation import Rules

_WALL = -1
"""Region of the cells that no rule can open."""

Ints = npt.NDArray[np.int32]


@dataclass(frozen=True, slots=True, kw_only=True)
class Removal:
    """The rules to remove for a path to exist."""

    keys: tuple[str, ...] | None
    """Keys of the rules, in the order of the list; empty when there is a path already; None when no
    set was found."""
    exact: bool
    """Whether the answer is proven: the set is a smallest one, or none exists. False when the
    search was given up."""
    at_least: int
    """Lower bound of the number of rules to remove; 0 when no set opens a path."""


def minimum_removal(
    rules: Rules,
    start: Cell,
    goal: Cell,
    *,
    config: ConstraintRemovalConfig = PLANNING_CONFIG.constraint_removal,
) -> Removal:
    """Find the smallest set of rules without which there is a path from start to goal, (row, col)
    both; of several any one.

    The rules that close the start or the goal itself count too. No set exists where walls separate
    the two.
    """
    regions, signatures = _regions(rules)
    if not all(
        0 <= cell[0] < rules.spec.rows and 0 <= cell[1] < rules.spec.cols for cell in (start, goal)
    ):
        return Removal(keys=None, exact=True, at_least=0)
    first, last = int(regions[start]), int(regions[goal])
    if _WALL in (first, last):
        return Removal(keys=None, exact=True, at_least=0)
    neighbours = _neighbours(regions, len(signatures))
    removed, exact, bound = _search(neighbours, signatures, first, last, config.max_states)
    if removed is None:
        return Removal(keys=None, exact=exact, at_least=bound)
    keys = tuple(rule.key for index, rule in enumerate(rules.removable) if removed >> index & 1)
    return Removal(keys=keys, exact=True, at_least=len(keys))


def _search(
    neighbours: list[list[int]], signatures: list[int], first: int, last: int, max_states: int
) -> tuple[int | None, bool, int]:
    """Removed rules as bits (None: not found), whether that is proven, and the least number of
    rules."""
    waiting = [(signatures[first].bit_count(), 0, first, signatures[first])]
    taken: list[list[int]] = [[] for _ in signatures]
    pushed = expanded = 0
    while waiting:
        cost, _, region, removed = heapq.heappop(waiting)
        if any(other & removed == other for other in taken[region]):
            continue
        if region == last:
            return removed, True, cost
        expanded += 1
        if expanded > max_states:
            return None, False, cost
        taken[region].append(removed)
        for beside in neighbours[region]:
            more = removed | signatures[beside]
            if not any(other & more == other for other in taken[beside]):
                pushed += 1
                heapq.heappush(waiting, (more.bit_count(), pushed, beside, more))
    return None, True, 0


def _regions(rules: Rules) -> tuple[Ints, list[int]]:
    """(rows, cols) index of each cell's region, `_WALL` in geometric obstacles, and the rules of
    each region as bits."""
    kinds = np.zeros((rules.spec.rows, rules.spec.cols), dtype=np.int32)
    sets = [0]
    for bit, rule in enumerate(rules.removable):
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
