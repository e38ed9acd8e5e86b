"""Why the path leads where it does: which rule each stretch of it keeps clear of, and where it
would lead without a rule.

A *rule* is what an operator can lift: a class of the beware list or a zone. What stands there in
earnest, the geometric layer, binds too but cannot be lifted. Each is turned into the cells in which
the robot's centre may not be because of it alone; the union of all of them is what the planner of
paths keeps out of.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

import cv2
import numpy as np
import numpy.typing as npt

from navcore.grid.grid import BoolGrid, Cell, GridSpec, OccupancyGrid, inflation_radius
from navcore.mission.beware_list import BewareList
from navcore.mission.zone import Zone, rasterise
from navcore.planning.path import NoPath, Path
from navcore.planning.planner import plan

TOUCH_CELLS = math.sqrt(2.0) + 1e-3
"""The path keeps clear of a rule where the next cell, or the next one diagonally, is closed by it.
"""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rule:
    """Something that closes cells: a class, a zone, or (with an empty key) what stands there."""

    key: str
    """`class:<id>`, `zone:<id>`, or `wall` for the geometric layer, which cannot be lifted."""
    name: str
    """What the operator calls it."""
    top: int
    """Row of the window's first cell."""
    left: int
    """Column of the window's first cell."""
    beyond: npt.NDArray[np.float32]
    """(h, w) cells from the rule's closed area, in a window that holds all of it: ≤ 0 inside."""

    @property
    def window(self) -> tuple[slice, slice]:
        """Where on the grid the window lies."""
        height, width = self.beyond.shape
        return slice(self.top, self.top + height), slice(self.left, self.left + width)

    @property
    def closed(self) -> BoolGrid:
        """(h, w) of the window: where the robot's centre may not be because of this rule."""
        return np.asarray(self.beyond <= 0)

    def at(self, cells: npt.NDArray[np.int64]) -> npt.NDArray[np.float32]:
        """(N,) how far (N, 2) cells are from the closed area; infinity outside the window."""
        row, col = cells[:, 0] - self.top, cells[:, 1] - self.left
        inside = (
            (row >= 0) & (col >= 0) & (row < self.beyond.shape[0]) & (col < self.beyond.shape[1])
        )
        found = np.full(len(cells), np.inf, dtype=np.float32)
        found[inside] = self.beyond[row[inside], col[inside]]
        return found


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rules:
    """All that closes cells of one grid."""

    spec: GridSpec
    """The grid."""
    walls: Rule | None
    """What stands there; None when nothing does."""
    liftable: tuple[Rule, ...]
    """Classes and zones that close any cell at all."""

    def blocked(self, without: Collection[str] = ()) -> BoolGrid:
        """(rows, cols) where the robot's centre may not be when the rules of some keys are lifted."""
        blocked = np.zeros((self.spec.rows, self.spec.cols), dtype=np.bool_)
        for rule in self._all():
            if rule.key not in without:
                blocked[rule.window] |= rule.closed
        return blocked

    def find(self, key: str) -> Rule | None:
        """The rule of that key that can be lifted; None when there is none, or when it closes
        nothing."""
        return next((rule for rule in self.liftable if rule.key == key), None)

    def _all(self) -> Iterator[Rule]:
        if self.walls is not None:
            yield self.walls
        yield from self.liftable

    def touching(self, cells: npt.NDArray[np.int64]) -> list[str | None]:
        """For each of (N, 2) cells the key of the rule that it lies against, the nearest if
        several; None in the open."""
        if not len(cells):
            return []
        least, keys = (
            np.full(len(cells), np.float32(TOUCH_CELLS)),
            np.full(len(cells), -1, dtype=np.int64),
        )
        rules = list(self._all())
        for index, rule in enumerate(rules):
            away = rule.at(cells)
            nearer = away < least
            least[nearer], keys[nearer] = away[nearer], index
        return [rules[index].key if index >= 0 else None for index in keys]


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """A part of a path that keeps clear of one thing, or of nothing."""

    key: str | None
    """Of the rule; None where the path runs in the open."""
    first: int
    """Index of its first cell on the path."""
    last: int
    """Index of its last cell."""


def rules_of(
    grid: OccupancyGrid,
    beware: BewareList,
    zones: Iterable[Zone],
    *,
    vehicle_width_m: float,
    safety_margin_m: float,
) -> Rules:
    """The rules behind an occupancy grid that was made under a beware list and zones; their union
    closes what it closes."""
    spec = grid.spec

    def radius(margin_m: float) -> int:
        return inflation_radius(
            vehicle_width_m=vehicle_width_m,
            safety_margin_m=safety_margin_m + margin_m,
            resolution_m=spec.resolution_m,
        )

    found = [
        _rule(
            f"class:{entry.class_id}",
            entry.label or entry.name,
            grid.beware[entry.class_id],
            radius(entry.margin_m),
        )
        for entry in beware.enabled
        if entry.class_id in grid.beware
    ]
    found += [
        _rule(f"zone:{zone.id}", zone.name, rasterise(zone.polygon, spec), radius(zone.margin_m))
        for zone in zones
        if zone.enabled
    ]
    walls = _rule("wall", "obstacle", grid.geometric, radius(0.0))
    return Rules(spec=spec, walls=walls, liftable=tuple(rule for rule in found if rule is not None))


def stretches(path: Path, rules: Rules) -> tuple[Stretch, ...]:
    """The whole path, cut where it comes to lie against something else."""
    found, index = [], 0
    for key, run in groupby(rules.touching(path.cells)):
        length = len(list(run))
        found.append(Stretch(key=key, first=index, last=index + length - 1))
        index += length
    return tuple(found)


def path_without(
    rules: Rules, keys: Sequence[str], start: Cell, goal: Cell, *, budget: int | None
) -> Path | NoPath:
    """The shortest path if the rules of these keys did not stand; `budget` bounds the search as in
    `navcore.path.plan`."""
    return plan(rules.blocked(keys), start, goal, max_expansions=budget)


def _rule(key: str, name: str, mask: BoolGrid, radius: int) -> Rule | None:
    """Of the cells of one layer, inflated by so many cells; None when it has none."""
    rows, cols = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return None
    room = radius + 2
    top, left = max(int(rows[0]) - room, 0), max(int(cols[0]) - room, 0)
    part = mask[top : int(rows[-1]) + room + 1, left : int(cols[-1]) + room + 1]
    # Squared distances of cells are whole numbers, so the small term keeps the disc of
    # `navcore.grid.inflate` exactly.
    away = cv2.distanceTransform((~part).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return Rule(
        key=key,
        name=name,
        top=top,
        left=left,
        beyond=np.asarray(away - np.float32(radius + 1e-3), dtype=np.float32),
    )
