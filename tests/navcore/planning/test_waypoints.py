"""Waypoints are the path's corners and its end."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.grid.grid import GridSpec
from navcore.planning.path import Path
from navcore.planning.planner import plan
from navcore.planning.waypoints import DEFAULT_VERTEX_ANGLE_RAD, choose_waypoints
from tests.navcore.laws import law

SPEC = GridSpec.centred(size_m=(4.0, 4.0), resolution_m=0.1)


def chosen(cells: list[tuple[int, int]], *, angle_deg: float = 170.0) -> list[list[int]]:
    path = Path(cells=np.array(cells), length=0.0)
    points = choose_waypoints(path, SPEC, max_vertex_angle_rad=math.radians(angle_deg))
    return [list(SPEC.cell(x, y)) for x, y in points]


def test_a_corner_and_the_end_are_kept_and_straight_cells_are_dropped() -> None:
    cells = [(5, 5), (5, 6), (5, 7), (6, 8), (7, 9), (8, 9), (9, 9)]
    assert chosen(cells) == [[5, 7], [7, 9], [9, 9]]


@pytest.mark.parametrize("cells", [[(3, 4)], [(3, 4), (4, 5)], [(3, 4), (3, 5), (3, 6), (3, 7)]])
def test_a_straight_path_has_its_end_as_the_only_waypoint(cells: list[tuple[int, int]]) -> None:
    assert chosen(cells) == [list(cells[-1])]


def test_a_corner_blunter_than_the_threshold_is_dropped() -> None:
    blunt = [(5, 5), (5, 6), (6, 7), (7, 8)]
    assert chosen(blunt, angle_deg=130.0) == [[7, 8]]
    assert chosen(blunt, angle_deg=140.0) == [[5, 6], [7, 8]]
    assert chosen([(5, 5), (5, 6), (6, 6)], angle_deg=130.0) == [[5, 6], [6, 6]]


@law(100)
@given(st.integers(0, 2**32 - 1))
def test_the_segments_between_consecutive_waypoints_are_the_path(seed: int) -> None:
    rng = np.random.default_rng(seed)
    blocked = rng.random((40, 40)) < 0.25
    start, goal = (
        (int(rng.integers(40)), int(rng.integers(40))),
        (int(rng.integers(40)), int(rng.integers(40))),
    )
    blocked[start] = blocked[goal] = False
    path = plan(blocked, start, goal)
    if not isinstance(path, Path):
        return
    corners = choose_waypoints(path, SPEC, max_vertex_angle_rad=DEFAULT_VERTEX_ANGLE_RAD)
    walked = [start]
    for x, y in corners:
        to = SPEC.cell(x, y)
        steps = max(abs(to[0] - walked[-1][0]), abs(to[1] - walked[-1][1]))
        for k in range(steps):
            at = walked[-1]
            left = steps - k
            walked.append((at[0] + (to[0] - at[0]) // left, at[1] + (to[1] - at[1]) // left))
    assert walked == [tuple(cell) for cell in path.cells.tolist()]
