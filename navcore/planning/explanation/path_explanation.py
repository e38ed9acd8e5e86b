"""Explanation of a path: the rule that each stretch of it keeps clear of, and the path without a
rule.

A *rule* can be removed by an operator: a class of the beware list or a zone. The geometric layer
closes cells too but cannot be removed. Each is turned into the cells in which the robot's centre
may not be because of it alone; the planner avoids the union of them.
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
from navcore.mission.zone import Zone, forbidden_cells
from navcore.planning.path import NoPath, Path
from navcore.planning.planner import plan
from navcore.planning.weighted_planner import plan_weighted

TOUCH_CELLS = math.sqrt(2.0) + 1e-3
"""Distance in cells within which a path touches a rule: the next cell, straight or diagonal, is
closed by it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rule:
    """A cause of closed cells: a class, a zone or the geometric layer."""

    key: str
    """`class:<id>`, `zone:<id>`, or `wall` for the geometric layer, which cannot be removed."""
    name: str
    """Name that the operator gave it."""
    top: int
    """Row of the window's first cell."""
    left: int
    """Column of the window's first cell."""
    beyond: npt.NDArray[np.float32]
    """(h, w) distance in cells to the area that the rule closes, ≤ 0 inside; the window contains
    all of the area."""

    @property
    def window(self) -> tuple[slice, slice]:
        """Rows and columns of the window on the grid."""
        height, width = self.beyond.shape
        return slice(self.top, self.top + height), slice(self.left, self.left + width)

    @property
    def closed(self) -> BoolGrid:
        """(h, w) cells of the window in which the robot's centre may not be because of this
        rule."""
        return np.asarray(self.beyond <= 0)

    def at(self, cells: npt.NDArray[np.int64]) -> npt.NDArray[np.float32]:
        """Return the (N,) distances in cells of (N, 2) cells to the closed area; infinity outside
        the window."""
        row, col = cells[:, 0] - self.top, cells[:, 1] - self.left
        inside = (
            (row >= 0) & (col >= 0) & (row < self.beyond.shape[0]) & (col < self.beyond.shape[1])
        )
        found = np.full(len(cells), np.inf, dtype=np.float32)
        found[inside] = self.beyond[row[inside], col[inside]]
        return found


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rules:
    """All rules that close cells of one grid."""

    spec: GridSpec
    """Size and resolution of the grid."""
    walls: Rule | None
    """The geometric layer; None when it is empty."""
    removable: tuple[Rule, ...]
    """Classes and zones that close any cell at all."""
    unseen: BoolGrid | None = None
    """(rows, cols) cells that were not seen yet, where they cost more; None where they do not."""
    unknown_price: float = 1.0
    """Price of unseen floor; see `navcore.planning.weighted_planner`."""

    def blocked(self, without: Collection[str] = ()) -> BoolGrid:
        """Return (rows, cols) the cells in which the robot's centre may not be without the rules of
        some keys."""
        blocked = np.zeros((self.spec.rows, self.spec.cols), dtype=np.bool_)
        for rule in self._all():
            if rule.key not in without:
                blocked[rule.window] |= rule.closed
        return blocked

    def find(self, key: str) -> Rule | None:
        """Return the removable rule of that key; None when there is none, or when it closes
        nothing."""
        return next((rule for rule in self.removable if rule.key == key), None)

    def _all(self) -> Iterator[Rule]:
        if self.walls is not None:
            yield self.walls
        yield from self.removable

    def touching(self, cells: npt.NDArray[np.int64]) -> list[str | None]:
        """Return for each of (N, 2) cells the key of the rule that it touches, the nearest of
        several; None for a cell that touches no rule."""
        if not len(cells):
            return []
        least, keys = (
            np.full(len(cells), np.float32(TOUCH_CELLS)),
            np.full(len(cells), -1, dtype=np.int64),
        )
        rules = list(self._all())
        for index, rule in enumerate(rules):
            away = rule.at(cells)
            closer = away < least
            least[closer], keys[closer] = away[closer], index
        return [rules[index].key if index >= 0 else None for index in keys]


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """A part of a path that touches one rule, or none."""

    key: str | None
    """Key of the rule; None where the path touches no rule."""
    first: int
    """Index of the first cell on the path."""
    last: int
    """Index of the last cell on the path."""


def rules_of(
    grid: OccupancyGrid,
    beware: BewareList,
    zones: Iterable[Zone],
    *,
    vehicle_width_m: float,
    safety_margin_m: float,
) -> Rules:
    """Return the rules of an occupancy grid that was made with a beware list and zones; together
    they close the same cells."""
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
            entry.title,
            (grid.beware[entry.class_id], radius(entry.margin_m)),
            *(
                (grid.beware[entry.class_id] & mask, radius(margin_m))
                for margin_m, mask in grid.uncertain
            ),
        )
        for entry in beware.enabled
        if entry.class_id in grid.beware
    ]
    found += [
        _rule(f"zone:{zone.id}", zone.name, (forbidden_cells(zone, spec), radius(zone.margin_m)))
        for zone in zones
        if zone.closed
    ]
    walls = _rule("wall", "obstacle", (grid.geometric, radius(0.0)))
    return Rules(
        spec=spec, walls=walls, removable=tuple(rule for rule in found if rule is not None)
    )


def stretches(path: Path, rules: Rules) -> tuple[Stretch, ...]:
    """Divide a path where it begins to touch another rule."""
    found, index = [], 0
    for key, run in groupby(rules.touching(path.cells)):
        length = len(list(run))
        found.append(Stretch(key=key, first=index, last=index + length - 1))
        index += length
    return tuple(found)


def path_without(
    rules: Rules, keys: Sequence[str], start: Cell, goal: Cell, *, budget: int | None
) -> Path | NoPath:
    """Find the path without the rules of these keys; `budget` bounds the search as in
    `navcore.planning.planner.plan`."""
    blocked = rules.blocked(keys)
    if rules.unseen is None:
        return plan(blocked, start, goal, max_expansions=budget)
    price = rules.unknown_price
    return plan_weighted(~blocked, rules.unseen, price, start, goal, max_expansions=budget)


def _rule(key: str, name: str, *layers: tuple[BoolGrid, int]) -> Rule | None:
    """The rule of layers of cells, each inflated by a number of cells; None when the first, which
    contains the others, has none."""
    whole = layers[0][0]
    rows, cols = np.flatnonzero(whole.any(axis=1)), np.flatnonzero(whole.any(axis=0))
    if not len(rows):
        return None
    border = max(radius for _, radius in layers) + 2
    top, left = max(int(rows[0]) - border, 0), max(int(cols[0]) - border, 0)
    window = slice(top, int(rows[-1]) + border + 1), slice(left, int(cols[-1]) + border + 1)
    beyond = [_beyond(mask[window], radius) for mask, radius in layers if mask.any()]
    return Rule(key=key, name=name, top=top, left=left, beyond=np.minimum.reduce(beyond))


def _beyond(mask: BoolGrid, radius: int) -> npt.NDArray[np.float32]:
    """(h, w) distance in cells to a mask that is inflated by `radius` cells."""
    # Squared distances of cells are whole numbers, so the small term keeps the disc of
    # `navcore.grid.grid.inflate` exactly.
    away = cv2.distanceTransform((~mask).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(away - np.float32(radius + 1e-3), dtype=np.float32)
