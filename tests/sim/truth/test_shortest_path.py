"""The shortest path among polygons is exactly that, in the plane."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from navcore.geometry.polyline import length_m
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.planning.path import Path
from navcore.planning.planner import plan
from sim.models.solids import Polygon, rectangle
from sim.truth.shortest_path import VisibilityGraph, shortest_path
from sim.truth.true_map import blocked_grid

SPEC = GridSpec.centred(size_m=(10.0, 10.0), resolution_m=0.05)
RADIUS_M = 0.5


def test_without_obstacles_the_path_is_straight() -> None:
    path = shortest_path([], RADIUS_M, SPEC, [(-3.0, -1.0), (4.0, 2.0)])
    assert path is not None and length_m(path) == pytest.approx(math.hypot(7.0, 3.0), abs=1e-9)


def test_round_a_wall_it_is_two_tangents_and_two_arcs() -> None:
    wall = rectangle(0.02, 4.0)
    path = shortest_path([wall], RADIUS_M, SPEC, [(-3.0, 0.0), (3.0, 0.0)])
    # By symmetry twice: from (3, 0) a tangent to the circle of 0.5 m about the corner (0.01, 2),
    # and the arc to its top.
    to_corner_m = math.hypot(2.99, 2.0)
    tangent_m = math.sqrt(to_corner_m**2 - RADIUS_M**2)
    touches_rad = math.atan2(-2.0, 2.99) + math.acos(RADIUS_M / to_corner_m)
    expected_m = 2 * (tangent_m + RADIUS_M * (math.pi / 2 - touches_rad) + 0.01)
    assert path is not None and length_m(path) == pytest.approx(expected_m, abs=0.01)


def test_it_never_leaves_the_map_and_is_none_where_there_is_no_path() -> None:
    across = rectangle(0.1, 10.0)
    assert shortest_path([across], RADIUS_M, SPEC, [(-3.0, 0.0), (3.0, 0.0)]) is None
    assert shortest_path([rectangle(1.0, 1.0)], RADIUS_M, SPEC, [(-3.0, 0.0), (0.9, 0.0)]) is None


def test_a_start_too_near_to_an_obstacle_is_left_straight_away() -> None:
    box = rectangle(1.0, 1.0)
    path = shortest_path([box], RADIUS_M, SPEC, [(-0.8, 0.0), (-3.0, 0.0)])
    assert path is not None and length_m(path) == pytest.approx(2.2, abs=1e-3)
    assert shortest_path([box], RADIUS_M, SPEC, [(0.05, 0.0), (-3.0, 0.0)]) is None


boxes = st.lists(
    st.builds(
        lambda x, y, yaw, a, b: Pose2(x_m=x, y_m=y, yaw_rad=yaw).to_parent(rectangle(a, b)),
        *(
            st.floats(-3, 3),
            st.floats(-3.5, 3.5),
            st.floats(-3, 3),
            st.floats(0.1, 3),
            st.floats(0.1, 1.5),
        ),
    ),
    max_size=7,
)


@settings(max_examples=40, deadline=None)
@given(boxes)
def test_it_is_as_short_as_among_all_pairs_of_corners_and_keeps_clear(
    polygons: list[Polygon],
) -> None:
    start, goal = (-4.4, -4.4), (4.4, 4.4)
    path = shortest_path(polygons, RADIUS_M, SPEC, [start, goal])
    blocked = blocked_grid(polygons, SPEC, RADIUS_M)
    on_grid = plan(blocked, SPEC.cell(*start), SPEC.cell(*goal))
    if isinstance(on_grid, Path):
        # # A grid has eight directions, so its paths are longer; one in the plane is at least as
        # long as the straight line.
        assert path is not None
        assert (
            math.dist(start, goal) - 1e-9
            <= length_m(path)
            <= on_grid.length * SPEC.resolution_m + 0.1
        )
    if path is not None and polygons:
        gap_m = shapely.distance(
            shapely.LineString(path), shapely.union_all([shapely.Polygon(p) for p in polygons])
        )
        assert gap_m >= RADIUS_M - 0.01  # arcs are made of chords
        around = VisibilityGraph.of(polygons, RADIUS_M)
        assert length_m(path) >= brute_force_m(around, start, goal) - 1e-6


def brute_force_m(
    around: VisibilityGraph, start: tuple[float, float], goal: tuple[float, float]
) -> float:
    """Return the length by Dijkstra over all corners, visibility tested by shapely, without the
    border of the map."""
    nodes = np.vstack([around.corners, goal, start])
    inside = shapely.buffer(around.obstacles, -2e-3, join_style="mitre")
    shapely.prepare(inside)
    pairs = np.stack(
        np.meshgrid(np.arange(len(nodes)), np.arange(len(nodes)), indexing="ij"), axis=-1
    ).reshape(-1, 2)
    free = ~shapely.intersects(inside, shapely.linestrings(nodes[pairs]))
    steps = np.where(
        free.reshape(len(nodes), -1),
        np.hypot(*(nodes[:, None] - nodes[None]).transpose(2, 0, 1)),
        np.inf,
    )
    best, open_ = steps[-1].copy(), np.ones(len(nodes), dtype=np.bool_)
    for _ in range(len(nodes)):
        here = int(np.argmin(np.where(open_, best, np.inf)))
        open_[here] = False
        best = np.minimum(best, best[here] + steps[here])
    return float(best[-2])
