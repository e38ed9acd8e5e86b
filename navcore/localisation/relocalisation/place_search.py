"""Search of a submap in a whole map by branch and bound over position and heading."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navcore.compiled import compiled, nested
from navcore.config.localisation.relocalisation import PlaceFitConfig, RelocalisationConfig
from navcore.geometry.arrays import Bools, Floats, Indices
from navcore.geometry.transform import Pose2, difference, wrap_angle
from navcore.localisation.relocalisation.place_fit import PlaceFit, fit_place
from navcore.localisation.relocalisation.place_map import PlaceMap
from navcore.localisation.relocalisation.search_tables import (
    CLEAR,
    DIRECTIONS,
    FULL,
    KEPT_BLOCK,
    TILE,
    TILE_BITS,
    UNKNOWN,
    SearchTables,
)
from navcore.localisation.relocalisation.submap import Submap

SLICE_CALLS = 100_000
"""Number of bounds after which `advance` returns."""
MOST_FOUND = 4_096
"""Places that one slice can return."""
HOPELESS = -1e9
"""Bound of a block that holds no candidate."""
EVERYWHERE = np.array([0, 2**31, 0, 2**31], dtype=np.int64)
"""Lowest and highest row and column of a search without a window."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchWindow:
    """Where to search."""

    T_map_base: Pose2
    """Expected pose."""
    reach_m: float
    """Half the edge in metres of the square around it."""
    reach_rad: float
    """Largest turn in radians from it."""

    def holds(self, T_map_base: Pose2) -> bool:
        """Return whether a pose is within."""
        x, y, turn = np.abs(difference(T_map_base, self.T_map_base))
        return bool(max(x, y) <= self.reach_m and turn <= self.reach_rad)


class PlaceSearch:
    """One search, advanced slice by slice, so that a thread can end it between two slices."""

    def __init__(
        self,
        submap: Submap,
        place_map: PlaceMap,
        config: RelocalisationConfig,
        window: SearchWindow | None = None,
    ) -> None:
        """Prepare the rotated points of the submap; nothing is searched yet. Without a window the
        whole map is searched, with all headings."""
        self._submap = submap
        self._window = window
        self._map = place_map
        self._config = config
        self._is_hopeless = len(submap) < config.search.least_points or not len(place_map.surfaces)
        step = math.radians(config.search.yaw_step_deg)
        if window is None:
            self._yaws = np.arange(0.0, 2.0 * math.pi, step)
        else:
            steps = math.ceil(window.reach_rad / step)
            self._yaws = window.T_map_base.yaw_rad + step * np.arange(-steps, steps + 1)
        self._worth = _worth(config.fit)
        self._found: list[Floats] = []
        self._best = config.search.least_evidence
        self._next = 0
        self._order: Indices | None = None
        self._unrefined: list[Pose2] | None = None
        self._fits: list[PlaceFit] = []
        if not self._is_hopeless:
            self._rotate()

    def _rotate(self) -> None:
        """Find the cells of the points, relative to their middle's, for each heading."""
        rules = self._config.search
        # A fixed shuffle: the first points of a bound are spread over the submap and reject early.
        chosen = np.random.default_rng(0).permutation(len(self._submap))[: rules.max_points]
        points, normals = self._submap.points[chosen], self._submap.normals[chosen]
        self._centre = points.mean(axis=0)
        arms = points - self._centre
        cos, sin = np.cos(self._yaws)[:, None], np.sin(self._yaws)[:, None]
        cells = np.stack(
            [sin * arms[:, 0] + cos * arms[:, 1], cos * arms[:, 0] - sin * arms[:, 1]], axis=2
        )
        self._cells = np.floor(cells / rules.cell_m + 0.5).astype(np.int64)
        angle = np.arctan2(normals[:, 1], normals[:, 0])[None, :] + self._yaws[:, None]
        channel = np.round(angle / (2.0 * math.pi / DIRECTIONS)).astype(np.int64) % DIRECTIONS
        self._window_cells = self._boxes()
        self._channels = np.where((normals != 0.0).any(axis=1), channel, DIRECTIONS)

    def advance(self) -> bool:
        """Search one slice, or refine one of the places that were found, which takes some ten
        milliseconds; return whether the search has ended."""
        if self._is_hopeless:
            return True
        rules = self._config.search
        if self._order is None:
            self._coarse = _coarse_bounds(
                self._map.tables,
                self._map.clear.shape,
                self._worth,
                self._cells,
                self._channels,
                rules.least_score,
                rules.least_evidence,
            )
            flat = self._coarse.ravel()
            promising = np.flatnonzero((flat > HOPELESS) & self._is_within())
            self._order = promising[np.argsort(-flat[promising], kind="stable")]
            return False
        if self._next < len(self._order):
            self._search_blocks(self._order)
            return False
        if self._unrefined is None:
            self._unrefined = self._places()
        if self._unrefined:
            near = self._unrefined.pop()
            self._fits.append(fit_place(self._submap, near, self._map, self._config.fit))
        return not self._unrefined

    def _search_blocks(self, order: Indices) -> None:
        """Search some of the largest blocks."""
        rules, found = self._config.search, np.empty((MOST_FOUND, 4))
        self._next, count, self._best = _descend(
            self._map.tables,
            self._worth,
            self._cells,
            self._channels,
            self._window_cells,
            self._coarse,
            order,
            self._next,
            self._best,
            rules.least_score,
            rules.least_evidence,
            rules.kept_margin,
            found,
        )
        self._found.append(found[:count])

    def _boxes(self) -> Indices:
        """Return the (yaws, 4) lowest and highest row, then column, of the middle of the points
        with the robot in the window or up to a cell beside it, by which a refinement moves it."""
        boxes = np.tile(EVERYWHERE, (len(self._yaws), 1))
        if self._window is None:
            return boxes
        lattice, expected, reach_m = (
            self._map.lattice,
            self._window.T_map_base,
            self._window.reach_m,
        )
        x, y = self._centre
        cos, sin = np.cos(self._yaws), np.sin(self._yaws)
        middles = (
            (expected.y_m + sin * x + cos * y - lattice.y_m) / lattice.cell_m - 0.5,
            (expected.x_m + cos * x - sin * y - lattice.x_m) / lattice.cell_m - 0.5,
        )
        for axis, middle in enumerate(middles):
            boxes[:, 2 * axis] = np.floor(middle - reach_m / lattice.cell_m)
            boxes[:, 2 * axis + 1] = np.ceil(middle + reach_m / lattice.cell_m)
        return boxes

    def _is_within(self) -> Bools:
        """Return which of the largest blocks reach into the window."""
        _, rows, cols = self._coarse.shape
        low_row, high_row, low_col, high_col = self._window_cells.T[:, :, None]
        side = 2**self._config.search.levels
        row, col = side * np.arange(rows), side * np.arange(cols)
        is_row = (row + side > low_row) & (row <= high_row)
        is_col = (col + side > low_col) & (col <= high_col)
        return np.asarray(is_row[:, :, None] & is_col[:, None, :]).ravel()

    def candidates(self) -> list[PlaceFit]:
        """Return the refined places within the window that a search has found which has ended, best
        first."""
        fits = [
            fit
            for fit in reversed(self._fits)
            if self._window is None or self._window.holds(fit.T_map_base)
        ]
        fits.sort(key=lambda fit: -fit.evidence)
        distinct: list[PlaceFit] = []
        for fit in fits:
            if not any(self._is_same(fit.T_map_base, kept.T_map_base) for kept in distinct):
                distinct.append(fit)
        return distinct

    def _places(self) -> list[Pose2]:
        """Return distinct places among the best, T_map_base, best first."""
        rules = self._config.search
        if not self._found:
            return []
        found = np.vstack(self._found)
        found = found[found[:, 0] >= max(rules.least_evidence, self._best - rules.kept_margin)]
        found = found[np.lexsort((found[:, 3], found[:, 2], found[:, 1], -found[:, 0]))]
        lattice, middle = (
            self._map.lattice,
            Pose2(x_m=float(self._centre[0]), y_m=float(self._centre[1]), yaw_rad=0.0),
        )
        kept: list[Pose2] = []
        for _, yaw, row, col in found.tolist():
            at = Pose2(
                x_m=lattice.x_m + (col + 0.5) * lattice.cell_m,
                y_m=lattice.y_m + (row + 0.5) * lattice.cell_m,
                yaw_rad=wrap_angle(float(self._yaws[int(yaw)])),
            )
            if not any(self._is_same(at, other) for other in kept):
                kept.append(at)
            if len(kept) == rules.max_candidates:
                break
        return [at @ middle.inverse() for at in kept]

    def _is_same(self, one: Pose2, two: Pose2) -> bool:
        rules = self._config.search
        turn = abs(wrap_angle(one.yaw_rad - two.yaw_rad))
        return one.distance_to(two.x_m, two.y_m) < rules.separation_m and turn < math.radians(
            rules.separation_deg
        )


def search_places(
    submap: Submap,
    place_map: PlaceMap,
    config: RelocalisationConfig,
    window: SearchWindow | None = None,
) -> list[PlaceFit]:
    """Return the places of a map where a submap may have been seen from, best first."""
    search = PlaceSearch(submap, place_map, config, window)
    while not search.advance():
        pass
    return search.candidates()


def _worth(config: PlaceFitConfig) -> Indices:
    """Return what each value of the tables speaks for a place, of `FULL`: never less than a smaller
    value, so that the largest value of a block bounds it."""
    unknown = config.unknown_worth * FULL
    worth = np.maximum(np.arange(FULL + 1), unknown)
    worth[CLEAR], worth[UNKNOWN] = -config.contradicted_cost * FULL, unknown
    return worth.astype(np.int64)


@nested
def _bound(
    tables: SearchTables,
    table: int,
    worth: Indices,
    cells: Indices,
    channels: Indices,
    row: int,
    col: int,
    least_score: float,
    least_evidence: float,
) -> float:
    """Return the mean evidence of the points of one heading at a cell, or `HOPELESS` as soon as it
    cannot reach `least_evidence`, or their mean likelihood not `least_score`."""
    rows, cols = tables.numbers.shape[2] * TILE, tables.numbers.shape[3] * TILE
    shift = max(table - 1, 0)
    count = len(cells)
    evidence = 0
    unlikely = int(count * FULL * (1.0 - least_score)) + 1
    lacking = int(count * FULL * (1.0 - least_evidence)) + 1
    for i in range(count):
        r, c = row + cells[i, 0], col + cells[i, 1]
        value = UNKNOWN
        if 0 <= r < rows and 0 <= c < cols:
            r, c = r >> shift, c >> shift
            tile = tables.numbers[table, channels[i], r >> TILE_BITS, c >> TILE_BITS]
            value = int(tables.tiles[tile, r & (TILE - 1), c & (TILE - 1)])
        unlikely -= FULL - value
        lacking -= FULL - worth[value]
        if unlikely < 0 or lacking < 0:
            return HOPELESS
        evidence += worth[value]
    return evidence / (count * FULL)


@compiled
def _coarse_bounds(
    tables: SearchTables,
    shape: tuple[int, int],
    worth: Indices,
    cells: Indices,
    channels: Indices,
    least_score: float,
    least_evidence: float,
) -> Floats:
    """Return the (yaws, rows, cols) bounds of the largest blocks of cells of a shape."""
    top, (rows, cols) = len(tables.numbers) - 1, shape
    side = 1 << (top + KEPT_BLOCK - 1)
    bounds = np.zeros((len(cells), (rows + side - 1) // side, (cols + side - 1) // side))
    for yaw in range(bounds.shape[0]):
        for row in range(bounds.shape[1]):
            for col in range(bounds.shape[2]):
                bounds[yaw, row, col] = _bound(
                    tables,
                    top,
                    worth,
                    cells[yaw],
                    channels[yaw],
                    row * side,
                    col * side,
                    least_score,
                    least_evidence,
                )
    return bounds


@compiled
def _descend(
    tables: SearchTables,
    worth: Indices,
    cells: Indices,
    channels: Indices,
    boxes: Indices,
    coarse: Floats,
    order: Indices,
    start: int,
    best: float,
    least_score: float,
    least_evidence: float,
    kept_margin: float,
    found: Floats,
) -> tuple[int, int, float]:
    """Search the largest blocks from `order[start]` on, depth first.

    Writes evidence, heading, row and column of the best position of each small block that may still
    count into `found`, of those within the rows and columns of `boxes` for the heading; returns
    where to go on, how many were found and the best evidence so far.
    """
    top = len(tables.numbers) - 2 + KEPT_BLOCK
    across_rows, across_cols = coarse.shape[1], coarse.shape[2]
    stack = np.empty((4 * top + 8, 3), dtype=np.int64)
    count, calls, index = 0, 0, start
    room = len(found) - 4 ** max(top - KEPT_BLOCK, 0)
    while index < len(order) and count <= room and calls < SLICE_CALLS:
        block = order[index]
        index += 1
        yaw = block // (across_rows * across_cols)
        row, col = block // across_cols % across_rows, block % across_cols
        low_row, high_row, low_col, high_col = (
            boxes[yaw, 0],
            boxes[yaw, 1],
            boxes[yaw, 2],
            boxes[yaw, 3],
        )
        if coarse[yaw, row, col] < max(least_evidence, best - kept_margin):
            index = len(order)  # they are sorted: none of the rest counts
            break
        depth = 1
        stack[0, 0], stack[0, 1], stack[0, 2] = top, row << top, col << top
        while depth > 0:
            depth -= 1
            level, row, col = stack[depth, 0], stack[depth, 1], stack[depth, 2]
            least = max(least_evidence, best - kept_margin)
            if level <= KEPT_BLOCK:
                highest, at_row, at_col = HOPELESS, 0, 0
                for r in range(max(row, low_row), min(row + (1 << level), high_row + 1)):
                    for c in range(max(col, low_col), min(col + (1 << level), high_col + 1)):
                        value = _bound(
                            tables,
                            0,
                            worth,
                            cells[yaw],
                            channels[yaw],
                            r,
                            c,
                            least_score,
                            max(least, highest),
                        )
                        calls += 1
                        if value > highest:
                            highest, at_row, at_col = value, r, c
                if highest > HOPELESS:
                    found[count, 0], found[count, 1] = highest, yaw
                    found[count, 2], found[count, 3] = at_row, at_col
                    count += 1
                    best = max(best, highest)
                continue
            half = 1 << (level - 1)
            for k in range(4):
                r, c = row + (k >> 1) * half, col + (k & 1) * half
                if r + half <= low_row or r > high_row or c + half <= low_col or c > high_col:
                    continue
                calls += 1
                value = _bound(
                    tables,
                    level - KEPT_BLOCK,
                    worth,
                    cells[yaw],
                    channels[yaw],
                    r,
                    c,
                    least_score,
                    least,
                )
                if value > HOPELESS:
                    stack[depth, 0], stack[depth, 1], stack[depth, 2] = level - 1, r, c
                    depth += 1
    return index, count, best
