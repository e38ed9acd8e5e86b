"""A way that only the safety margin or somebody closes is looked at from nearer before the robot believes that it is closed.

From afar depth scatters, and a gap that is wide enough looks too narrow; from nearby it is measured anew. And who stood in the
way when the robot turned from him may have walked on. So where there is no path, the robot goes to the mouth of the gap that
least is missing of: of all ways that its body would fit through without the safety margin and without anybody there, the one
with the fewest cells that margin or people close. It enters none of them. Where it stands among such cells already, they may be
left to any side.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from navcore.cloud_map import BODY_M
from navcore.grid import BoolGrid, Cell, OccupancyGrid, inflate, inflate_layers
from navcore.occupancy import Occupancy
from navcore.path import Path, plan
from navcore.search.bits import compiled

Ints = npt.NDArray[np.int32]
FREE, CLOSED, SOLID = np.uint8(0), np.uint8(1), np.uint8(2)
"""May be entered; only the margin forbids it, or somebody who stood there; the body does not fit in."""


def towards(
    occupancy: Occupancy,
    start: Cell,
    goal: Cell,
    *,
    people: Collection[int] = (),
    vehicle_width_m: float,
    relief_cells: float,
    max_expansions: int,
) -> Path | None:
    """The shortest path to where the robot has to look closer; None where there is nothing to be gained by going.

    `start` is the robot's cell and may be closed: free cells within `relief_cells` of it count as beside it. Layers and zones
    keep their own margins, but for the layers of `people`, class ids, which somebody who walks on leaves.
    """
    tight = inflate_layers(_deserted(occupancy.grid, people), vehicle_width_m=vehicle_width_m, safety_margin_m=0.0)
    kinds = np.where(tight, SOLID, np.where(occupancy.blocked, CLOSED, FREE))
    seeds = _beside(start, occupancy.blocked, relief_cells)
    if not len(seeds):
        return None
    first, last = _fewest_closed(kinds, seeds, goal[0] * kinds.shape[1] + goal[1])
    if last < 0 or first == last:
        return None
    begin, end = (divmod(int(cell), kinds.shape[1]) for cell in (first, last))
    path = plan(occupancy.blocked, begin, end, max_expansions=max_expansions)
    return path if isinstance(path, Path) else None


def _deserted(grid: OccupancyGrid, people: Collection[int]) -> OccupancyGrid:
    """The same without people, as far as they are known to be some."""
    bodies = [layer for class_id, layer in grid.beware.items() if class_id in people and layer.any()]
    if not bodies:
        return grid
    others = {class_id: layer for class_id, layer in grid.beware.items() if class_id not in people}
    whole = inflate(np.logical_or.reduce(bodies), math.ceil(BODY_M / grid.spec.resolution_m))
    return dataclasses.replace(grid, geometric=grid.geometric & ~whole, beware=others)


def _beside(start: Cell, blocked: BoolGrid, relief_cells: float) -> Ints:
    """(N,) flat indices of the free cells about the robot, the nearest first."""
    reach = int(relief_cells)
    top, left = max(start[0] - reach, 0), max(start[1] - reach, 0)
    cells = np.argwhere(~blocked[top : start[0] + reach + 1, left : start[1] + reach + 1]) + np.array([top, left])
    away = np.hypot(*(cells - start).T)
    order = np.argsort(away, kind="stable")
    near = cells[order[: int((away <= relief_cells).sum())]]
    return np.asarray(near[:, 0] * blocked.shape[1] + near[:, 1], dtype=np.int32)


@compiled
def _fewest_closed(kinds: npt.NDArray[np.uint8], seeds: Ints, goal: int) -> tuple[int, int]:
    """(first, last) of what can be gone of the way to the goal with the fewest closed cells; (−1, −1) where there is none.

    A wave over straight steps, which free cells cost nothing and closed ones 1. `first` is a seed, `last` the cell connected
    with it over free ones at which the way enters the first closed one, or the goal.
    """
    rows, cols = kinds.shape
    flat = kinds.ravel()
    seen = np.zeros(flat.size, dtype=np.bool_)
    via = np.empty(flat.size, dtype=np.int32)  # of a cell before the first closed one its seed, of others where it was entered
    now, later = np.empty(flat.size, dtype=np.int32), np.empty(flat.size, dtype=np.int32)
    closed = 0
    waiting = 0
    for begun in range(len(seeds) + 1):
        count = 0
        if begun < len(seeds):  # every seed's area by itself, so that each knows the seed nearest to the robot
            if seen[seeds[begun]]:
                continue
            now[0], count = seeds[begun], 1
            seen[seeds[begun]], via[seeds[begun]] = True, seeds[begun]
        while True:
            at = 0
            while at < count:
                cell = now[at]
                at += 1
                if cell == goal:
                    return (via[cell], cell) if closed == 0 else (via[via[cell]], via[cell])
                row, col = cell // cols, cell % cols
                for side in range(4):
                    r, c = row + (side == 0) - (side == 1), col + (side == 2) - (side == 3)
                    if not (0 <= r < rows and 0 <= c < cols):
                        continue
                    to = r * cols + c
                    if seen[to] or flat[to] == SOLID:
                        continue
                    entered = cell if closed == 0 and flat[to] == CLOSED else via[cell]
                    seen[to], via[to] = True, entered
                    if flat[to] == FREE:
                        now[count] = to
                        count += 1
                    else:
                        later[waiting] = to
                        waiting += 1
            if begun < len(seeds) or waiting == 0:
                break
            now, later = later, now
            count, waiting = waiting, 0
            closed += 1
    return -1, -1
