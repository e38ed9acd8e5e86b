"""The cells near the robot, in its own frame."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from navcore.costmap.local_costmap import nearby, obstacle_masks, occupied_cells, people_mask
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec, OccupancyGrid
from tests.navcore.control.planning import SPEC, world
from tests.navcore.laws import law


@law(60)
@given(st.integers(0, 2**32 - 1))
def test_nearby_cells_are_those_around_the_robot_seen_from_it(seed: int) -> None:
    pose, mask, _, _, _ = world(seed)
    grid = OccupancyGrid(spec=SPEC, geometric=mask, beware={}, zones=mask)
    points = nearby(mask, grid, pose, 1.0)
    back = [(pose @ Pose2(x_m=x, y_m=y, yaw_rad=0)) for x, y in points]
    cells = {SPEC.cell(p.x_m, p.y_m) for p in back}
    assert len(cells) == len(points)
    assert all(mask[cell] for cell in cells)
    expected = {
        (int(r), int(c))
        for r, c in np.argwhere(mask)
        if math.dist(SPEC.centre(r, c), (pose.x_m, pose.y_m)) <= 1.0
    }
    assert expected <= cells


@law(60)
@given(st.integers(0, 2**32 - 1))
def test_a_cell_is_occupied_from_so_many_points_in_it(seed: int) -> None:
    points = np.random.default_rng(seed).uniform(-3.0, 3.0, (400, 2))
    spec = GridSpec(resolution_m=0.2, origin_x_m=-2.0, origin_y_m=-1.0, rows=8, cols=15)
    counts = np.zeros((spec.rows, spec.cols), dtype=np.int64)
    for x, y in points:
        row, col = spec.cell(x, y)
        if 0 <= row < spec.rows and 0 <= col < spec.cols:
            counts[row, col] += 1
    for least in (1, 2, 4):
        assert (occupied_cells(spec, points, least) == (counts >= least)).all()
    assert not occupied_cells(spec, np.empty((0, 2))).any()


def test_nearby_finds_nothing_off_the_grid() -> None:
    full = np.ones((SPEC.rows, SPEC.cols), dtype=np.bool_)
    grid = OccupancyGrid(spec=SPEC, geometric=full, beware={}, zones=full)
    for x, y in ((50.0, 0.0), (-50.0, 0.0), (0.0, -50.0)):
        assert len(nearby(full, grid, Pose2(x_m=x, y_m=y, yaw_rad=0.0), 2.0)) == 0


def test_forbidden_cells_are_zones_and_beware_classes_grown_by_their_margins() -> None:
    one, empty = (
        np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_),
        np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_),
    )
    one[30, 30] = True
    grid = OccupancyGrid(
        spec=SPEC, geometric=empty, beware={1: one}, margins_m={1: 0.2}, zones=empty
    )
    geometric, forbidden = obstacle_masks(grid)
    assert not geometric.any()
    assert np.flatnonzero(forbidden[30]).tolist() == list(range(28, 33))
    wide = OccupancyGrid(spec=SPEC, geometric=one, beware={}, zones=empty, wide_zones=((0.1, one),))
    assert obstacle_masks(wide)[1].sum() == 5
    person = OccupancyGrid(
        spec=SPEC, geometric=empty, beware={3: one}, zones=empty, margins_m={3: 0.1}
    )
    assert obstacle_masks(person)[1].sum() == people_mask(person, [3]).sum() > one.sum()
    assert obstacle_masks(person, people=[3])[1].sum() == people_mask(person, [4]).sum() == 0
    np.testing.assert_array_equal(obstacle_masks(wide)[0], one)
    assert not empty.any()


def test_of_people_those_alone_who_are_passed_have_no_margin() -> None:
    layer = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    layer[30, 30] = layer[30, 50] = True
    grid = OccupancyGrid(
        spec=SPEC,
        geometric=np.zeros_like(layer),
        beware={3: layer},
        zones=np.zeros_like(layer),
        margins_m={3: 0.2},
    )
    far = layer.copy()
    far[30, 30] = False
    x_m, y_m = SPEC.centre(30, 30)
    beside = Pose2(x_m=x_m - 0.5, y_m=y_m, yaw_rad=0.0)
    whole = people_mask(dataclasses.replace(grid, beware={3: far}), [3])
    assert (people_mask(grid, [3], (beside, 0.35)) == (whole | layer)).all()
    assert (people_mask(grid, [3], (beside, 0.25)) == people_mask(grid, [3])).all()
