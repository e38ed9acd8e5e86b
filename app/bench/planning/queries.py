"""Benchmark of the planner beside other planners in the same run, each on one core.

Published maps are read from a folder with `movingai/*/*.map` (and their `.scen`), `ros/*.npz` and
`synthetic/*.npz`; without it two forests are made. Each duration, of this planner and of its peers
(`app.bench.planning.peers`), is the fastest of as many runs as it takes for two to agree.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path as FilePath
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from rich.console import Console as Terminal
from rich.table import Table

from app.bench.planning.peers import peers
from app.bench.planning.plain_astar import length_by_astar
from app.bench.quiet import QuietGuard
from navcore.errors import BadConfiguration
from navcore.formats.moving_ai import load_map, load_scenario
from navcore.grid.free_space import FreeSpace
from navcore.grid.grid import BoolGrid, Cell, inflate
from navcore.grid.inflation import InflatedGrid
from navcore.planning.path import NoPath, Path
from navcore.planning.planner import plan, plan_in
from navcore.planning.replanner import Replanner
from navcore.planning.search.open_list import SearchWorkspace

PEER_QUERIES = 8
"""Number of queries per map that the peers answer."""
VIEW_CELLS = 50
"""Half the side of the square that the driving robot sees, cells."""
STRIDE_CELLS = 2
"""Cells that the robot drives from frame to frame."""
CHECK_EVERY = 50
"""Frames from one check of the path length to the next."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """A grid and queries with known path lengths."""

    name: str
    """Name of the map in the table."""
    blocked: BoolGrid
    """(rows, cols) cells where the robot's centre may not be."""
    queries: tuple[tuple[Cell, Cell, float], ...]
    """Start, goal and known optimal length in cells of each query."""
    decimals: int
    """Number of correct decimals of the known lengths."""
    occupied: BoolGrid | None = None
    """(rows, cols) occupied cells before inflation; None if unknown."""
    radius: int = 0
    """Radius of the inflation disc, cells."""

    def tolerance(self, length: float) -> float:
        """Return the error of a known length, cells: by its decimals, and by the six significant
        digits that `%g` writes."""
        return max(
            math.pow(10.0, -self.decimals),
            math.pow(10.0, math.floor(math.log10(max(length, 1.0))) - 5),
        )


def run_planning_bench(terminal: Terminal, maps: FilePath | None = None) -> None:
    """Measure queries, replanning on changing maps, and planning from a raw grid; print tables.

    `maps` is the folder of published maps; raises `BadConfiguration` for a folder without maps.
    """
    problems = [forest(1500, 0.08), forest(3000, 0.08)] if maps is None else list(published(maps))
    if not problems:
        raise BadConfiguration(
            f"--maps {maps}: no movingai/*/*.map, ros/*.npz or synthetic/forest*.npz is there"
        )
    terminal.print(compare(problems))
    inflated = [problem for problem in problems if problem.occupied is not None]
    terminal.print(replanning(inflated, maps))
    terminal.print(from_raw([*inflated, forest(3000, 0.08)]))


def published(folder: FilePath) -> Iterator[Problem]:
    """Yield every map in the folder with known path lengths; raises `BadConfiguration` for one that
    is wrong."""
    for file in sorted(folder.glob("movingai/*/*.map")):
        queries = load_scenario(FilePath(f"{file}.scen"))
        yield Problem(
            name=file.stem,
            blocked=load_map(file),
            queries=tuple((query.start, query.goal, query.length) for query in queries),
            decimals=max((_decimals(query.length) for query in queries), default=0),
        )
    for file in sorted([*folder.glob("ros/*.npz"), *folder.glob("synthetic/forest*.npz")]):
        with np.load(file) as stored:
            yield _stored(file.stem, stored)


def _decimals(length: float) -> int:
    return len(repr(length).removesuffix(".0").partition(".")[2])


def _stored(name: str, stored: Any) -> Problem:
    rows, cols = (int(side) for side in stored["shape"])
    free, occupied = (
        np.unpackbits(stored[key], axis=1)[:rows, :cols].astype(np.bool_) if key in stored else None
        for key in ("free", "occ")
    )
    assert free is not None
    return Problem(
        name=name,
        blocked=~free,
        queries=tuple(
            ((int(q[1]), int(q[0])), (int(q[3]), int(q[2])), float(q[4])) for q in stored["queries"]
        ),
        decimals=3,
        occupied=occupied,
        radius=int(float(stored["inflation_m"]) / float(stored["res"]) + 1e-9),
    )


def forest(side: int, trees_per_m2: float) -> Problem:
    """Return 150 m × 150 m of seeded trees with one query, whose length the plain A* gives."""
    generator = np.random.default_rng(20261120)
    canvas = np.zeros((side, side), dtype=np.uint8)
    per_m = side / 150
    for x, y, radius in generator.random((int(trees_per_m2 * 150**2), 3)) * [side, side, 0.2]:
        cv2.circle(canvas, (int(x), int(y)), int((0.1 + radius) * per_m), 1, -1)
    occupied: BoolGrid = canvas.astype(np.bool_)
    margin = int(2 * per_m)
    occupied[:margin, :margin] = occupied[-margin:, -margin:] = False
    start, goal = (margin // 4, margin // 4), (side - 1 - margin // 4, side - 1 - margin // 4)
    radius_cells = int(0.45 * per_m)
    blocked = inflate(occupied, radius_cells)
    return Problem(
        name=f"own forest, {side}²",
        blocked=blocked,
        queries=((start, goal, length_by_astar(blocked, start, goal)),),
        decimals=6,
        occupied=occupied,
        radius=radius_cells,
    )


def compare(problems: list[Problem]) -> Table:
    """Measure all queries of all maps, and a sample of them with every peer."""
    planners = peers()
    table = Table(
        "map",
        "queries",
        "wrong",
        "mean µs",
        "p99 µs",
        "plan() µs",
        *(f"{name} ÷" for name in planners),
    )
    guard = QuietGuard()
    ratios: dict[str, list[float]] = {name: [] for name in planners}
    for problem in problems:
        space = FreeSpace.of(problem.blocked)
        arena = SearchWorkspace(space)
        own, wrong = _all_queries(problem, space, arena, guard)
        sample = np.linspace(0, len(own) - 1, min(PEER_QUERIES, len(own))).astype(int)
        whole = [
            _best(partial(plan, problem.blocked, *problem.queries[i][:2]), guard) for i in sample
        ]
        row = [
            problem.name,
            str(len(own)),
            str(wrong),
            f"{own.mean():.1f}",
            f"{np.percentile(own, 99):.1f}",
        ]
        row.append(f"{np.mean(whole):.0f}")
        for name, planner in planners.items():
            query = planner(problem.blocked)
            took = [_best(partial(query, *problem.queries[i][:2]), guard) for i in sample]
            ratios[name].append(float(np.mean(took) / np.mean(own[sample])))
            row.append(f"{ratios[name][-1]:.0f}")
        table.add_row(*row)
    means = (f"{np.exp(np.mean(np.log(values))):.0f}" for values in ratios.values())
    table.add_row("geometric mean", "", "", "", "", "", *means, style="bold")
    table.title = (
        "Queries: packed map and memory kept, plan() from the bool grid, "
        f"and how many times longer peers take; {guard.verdict}"
    )
    return table


def _all_queries(
    problem: Problem, space: FreeSpace, arena: SearchWorkspace, guard: QuietGuard
) -> tuple[npt.NDArray[np.float64], int]:
    took, wrong = np.empty(len(problem.queries)), 0
    for index, (start, goal, length) in enumerate(problem.queries):
        outcome = plan_in(space, arena, start, goal)
        wrong += isinstance(outcome, NoPath) or abs(outcome.length - length) > problem.tolerance(
            length
        )
        took[index] = _best(partial(plan_in, space, arena, start, goal), guard)
    return took, wrong


def _best(action: Callable[[], object], guard: QuietGuard) -> float:
    """Return the microseconds of the fastest of several runs: the cost on an idle machine."""
    return guard.fastest(lambda: _us(action))


def _us(action: Callable[[], object]) -> float:
    """Return the microseconds of one run."""
    before = time.perf_counter()
    action()
    return 1e6 * (time.perf_counter() - before)


def replanning(problems: list[Problem], maps: FilePath | None) -> Table:
    """Measure a drive through each map that is seen while driving, unknown cells counting as free.

    Then the same with an outdated prior map, so that cells are freed as well, by a robot that
    leaves its path; and the recorded sequences in the folder of maps.
    """
    table = Table("drive", "frames", "searches", "wrong", "mean µs", "p50", "p95", "p99", "max")
    table.title = (
        "Replanning on a changed map: inflation where cells changed, certificate or search; "
        "every frame"
    )
    _explore(forest(300, 0.02))
    for problem in problems:
        _add_drive(table, problem.name, *_explore(problem))
    for problem in problems:
        _add_drive(
            table, f"{problem.name}, outdated map, leaves path", *_explore(problem, outdated=True)
        )
    for file in sorted(maps.glob("synthetic/seq*.npz")) if maps is not None else ():
        with np.load(file) as stored:
            _replay(stored)  # loads compiled code that only this drive needs
            _add_drive(table, f"{file.stem}, recorded", *_replay(stored))
    return table


def _add_drive(table: Table, name: str, took: list[float], searches: int, wrong: int) -> None:
    figures = (np.mean(took), *np.percentile(took, [50, 95, 99]), max(took))
    table.add_row(
        name, str(len(took)), str(searches), str(wrong), *(f"{figure:.1f}" for figure in figures)
    )


def _explore(problem: Problem, *, outdated: bool = False) -> tuple[list[float], int, int]:
    """Return microseconds per frame, number of searches, and wrong lengths among every 50th frame.

    `outdated`: the prior map has boxes all over that are cleared when the robot comes near, and
    every fourth frame the robot stands beside its path.
    """
    assert problem.occupied is not None
    start, goal, _ = max(problem.queries, key=lambda query: query[2])
    rows, cols = problem.blocked.shape
    grid, rng = InflatedGrid(rows, cols), np.random.default_rng(rows)
    hidden = problem.occupied.copy()
    stale = (
        _boxes(rng, hidden.shape, (start, goal), clear=2 * problem.radius)
        if outdated
        else np.zeros_like(hidden)
    )
    grid.update({problem.radius: stale})
    replanner, took, wrong = Replanner(grid.space), list[float](), 0
    replanner.plan(start, goal)
    while start != goal:
        top, left = max(start[0] - VIEW_CELLS, 0), max(start[1] - VIEW_CELLS, 0)
        view = slice(top, start[0] + VIEW_CELLS), slice(left, start[1] + VIEW_CELLS)
        freed, seen = (np.argwhere(mask[view]) + np.array([top, left]) for mask in (stale, hidden))
        hidden[view] = stale[view] = False
        before = time.perf_counter()
        if len(freed):
            grid.set_cells(problem.radius, freed, False)
        grid.set_cells(problem.radius, seen, True)
        outcome = replanner.plan(start, goal)
        took.append(1e6 * (time.perf_counter() - before))
        assert isinstance(outcome, Path)
        wrong += len(took) % CHECK_EVERY == 0 and _differs(
            outcome, plan(grid.space.blocked(), start, goal)
        )
        start = _cell(outcome.cells[min(STRIDE_CELLS, len(outcome.cells) - 1)])
        if outdated and len(took) % 4 == 0:
            start = _beside(grid.space, start, rng)
    return took, replanner.searches, wrong


def _boxes(
    rng: np.random.Generator, shape: tuple[int, ...], away_from: tuple[Cell, ...], *, clear: int
) -> BoolGrid:
    """Return (rows, cols) with a box of a few cells per 64 × 64 cells, none within `clear` cells of
    `away_from`."""
    boxes = np.zeros(shape, dtype=np.bool_)
    for row, col in rng.integers(0, shape, size=(shape[0] * shape[1] // 64**2, 2)):
        boxes[row : row + 6, col : col + 6] = True
    for row, col in away_from:
        boxes[max(row - clear, 0) : row + clear, max(col - clear, 0) : col + clear] = False
    return boxes


def _beside(space: FreeSpace, cell: Cell, rng: np.random.Generator) -> Cell:
    """Return a random free neighbour of a cell, or the cell itself."""
    row, col = (int(step) for step in rng.integers(-1, 2, size=2))
    near = cell[0] + row, cell[1] + col
    return near if space.contains(near) and space.is_free(near) else cell


def _differs(outcome: Path, expected: Path | NoPath) -> bool:
    return isinstance(expected, NoPath) or abs(outcome.length - expected.length) > 1e-6


def _cell(cell: npt.NDArray[np.int64]) -> Cell:
    return int(cell[0]), int(cell[1])


def _replay(stored: Any) -> tuple[list[float], int, int]:
    """Replay recorded blocked cells, whose disc of 4.5 cells is no whole radius; starts are
    (col, row)."""
    rows, cols = (int(side) for side in stored["shape"])
    goal = _cell(stored["goal"])
    space = FreeSpace.of(np.zeros((rows, cols), dtype=np.bool_))
    replanner, took, wrong = Replanner(space), list[float](), 0
    replanner.plan((0, 0), goal)
    blocked, pointers, starts, costs = (
        stored[key] for key in ("blocked", "blocked_ptr", "starts", "cost")
    )
    for frame, cost in enumerate(costs):
        cells = np.column_stack(
            np.divmod(blocked[pointers[frame] : pointers[frame + 1]].astype(np.int64), cols)
        )
        start = _cell(starts[frame][::-1])
        before = time.perf_counter()
        space.set_cells(cells, True)
        outcome = replanner.plan(start, goal)
        took.append(1e6 * (time.perf_counter() - before))
        wrong += isinstance(outcome, NoPath) or abs(outcome.length - cost) > 1e-6 * cost
    return took, replanner.searches, wrong


def from_raw(problems: list[Problem]) -> Table:
    """Measure packing, inflation, marks and search from scratch in reused memory, beside OpenCV's
    dilation and A*."""
    table = Table("map", "grid ms", "search ms", "both ms", "dilate + A* ms")
    table.title = "From an occupied grid that changed everywhere to the path across it"
    for problem in problems:
        assert problem.occupied is not None
        start, goal, _ = max(problem.queries, key=lambda query: query[2])
        rows, cols = problem.blocked.shape
        grid, empty = InflatedGrid(rows, cols), np.zeros_like(problem.occupied)
        arena, steps = SearchWorkspace(grid.space), list[tuple[float, float]]()
        for _ in range(6):
            grid.update({problem.radius: empty})
            made = _us(partial(grid.update, {problem.radius: problem.occupied}))
            steps.append((made, _us(partial(plan_in, grid.space, arena, start, goal))))
        plain = min(_us(partial(_inflate_and_search, problem, start, goal)) for _ in range(6))
        made, searched = min(steps, key=sum)
        table.add_row(
            problem.name,
            *(f"{figure / 1e3:.3f}" for figure in (made, searched, made + searched, plain)),
        )
    return table


def _inflate_and_search(problem: Problem, start: Cell, goal: Cell) -> float:
    assert problem.occupied is not None
    return length_by_astar(inflate(problem.occupied, problem.radius), start, goal)
