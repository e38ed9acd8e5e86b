"""The way out of an area: shortest by brute force, never through what is closed."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from navcore.grid import BoolGrid
from navcore.motion import Outcome
from navcore.path import NoPath, Path, Reason, plan
from navcore.transform import Pose2
from navcore.way_out import way_out
from navcore.zones import Zone
from tests.navcore.laws import law
from tests.navcore.scene import picture
from tests.navcore.test_pilot import navigator, order


def brute_force(closed: BoolGrid, inside: BoolGrid, start: tuple[int, int]) -> float:
    lengths = [
        outcome.length
        for row, col in np.argwhere(~closed & ~inside)
        if isinstance(outcome := plan(closed, start, (int(row), int(col))), Path)
    ]
    return min(lengths, default=math.inf)


@law(40)
@given(st.integers(0, 2**32 - 1))
def test_the_way_out_is_the_shortest_path_to_any_cell_outside(seed: int) -> None:
    rng = np.random.default_rng(seed)
    closed, inside = rng.random((9, 11)) < 0.25, rng.random((9, 11)) < 0.85
    closed[4, 5] = False
    outcome = way_out(closed=closed, inside=inside, start=(4, 5))
    expected = brute_force(closed, inside, (4, 5))
    if isinstance(outcome, NoPath):
        assert outcome.reason is Reason.UNREACHABLE
        assert expected == math.inf
        return
    assert outcome.length == np.float64(expected) or math.isclose(outcome.length, expected)
    assert outcome.cells[0].tolist() == [4, 5]
    assert not inside[tuple(outcome.cells[-1])]
    assert not closed[outcome.cells[:, 0], outcome.cells[:, 1]].any()
    steps = np.abs(np.diff(outcome.cells, axis=0))
    assert (steps.max(axis=1) == 1).all() if len(steps) else True


def test_a_start_that_is_closed_or_outside_is_said() -> None:
    closed, inside = np.ones((3, 3), dtype=np.bool_), np.ones((3, 3), dtype=np.bool_)
    assert way_out(closed=closed, inside=inside, start=(1, 1)) == NoPath(reason=Reason.START_BLOCKED)
    assert way_out(closed=closed, inside=inside, start=(9, 1)) == NoPath(reason=Reason.OUTSIDE)


def test_a_robot_in_a_new_zone_stands_until_told_to_leave_and_then_drives_out_but_into_no_other() -> None:
    zone = Zone(id="z", name="z", polygon=((-3.0, -3.0), (0.9, -3.0), (0.9, 3.0), (-3.0, 3.0)))
    other = Zone(id="o", name="o", polygon=((2.8, -3.0), (3.4, -3.0), (3.4, 3.0), (2.8, 3.0)))
    loop, frame = navigator(), picture(pose=Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0))
    standing = loop.tick(frame, order((3.9, 0.0), zones=(zone, other)))
    assert standing.motion.outcome is Outcome.IN_ZONE
    assert standing.motion.twist.v_mps == 0.0
    leaving = loop.tick(frame, order(None, zones=(zone, other), leave=True))
    assert leaving.route is not None
    assert isinstance(leaving.route.outcome, Path)
    end = leaving.route.points[-1]
    assert 0.9 + 0.6 < end[0] < 2.8 - 0.6
    assert leaving.motion.outcome is Outcome.FOLLOW
    assert leaving.motion.twist.v_mps > 0.0
