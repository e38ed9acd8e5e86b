"""Driving by hand keeps out of beware areas, and gets out of them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navcore.by_hand import keeps_out
from navcore.grid import GridSpec, OccupancyGrid
from navcore.occupancy import Occupancy
from navcore.robot import HUSKY, STANDSTILL, Twist
from navcore.transform import Pose2
from navcore.zones import rasterise

SPEC = GridSpec.centred(size_m=(8.0, 8.0), resolution_m=0.05)
AHEAD, BACK = Twist(v_mps=0.4, w_radps=0.0), Twist(v_mps=-0.2, w_radps=0.0)
TURN = Twist(v_mps=0.0, w_radps=0.6)


def world(*boxes: tuple[float, float, float, float], geometric: bool = False) -> Occupancy:
    """Zones (or walls) of (left, right, low, high)."""
    mask = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    for left, right, low, high in boxes:
        mask |= rasterise(((left, low), (right, low), (right, high), (left, high)), SPEC)
    nothing = np.zeros_like(mask)
    grid = OccupancyGrid(spec=SPEC, geometric=mask if geometric else nothing, beware={}, zones=nothing if geometric else mask)
    return Occupancy.of(grid, nothing, version=1)


ZONE_AHEAD = world((0.6, 1.6, -0.5, 0.5))
HERE = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)


@pytest.mark.parametrize(
    ("twist", "occupancy", "keeps"),
    [
        (AHEAD, ZONE_AHEAD, False),
        (BACK, ZONE_AHEAD, True),
        (TURN, ZONE_AHEAD, True),
        (AHEAD, world((1.5, 2.5, -0.5, 0.5)), True),
        (AHEAD, world(), True),
        (TURN, world((-0.2, 0.2, 0.4, 0.8)), False),
        (AHEAD, world((0.6, 1.6, -0.5, 0.5), geometric=True), True),
    ],
)
def test_a_hand_is_held_where_the_footprint_would_come_over_a_zone(twist: Twist, occupancy: Occupancy, keeps: bool) -> None:
    assert keeps_out(twist, HERE, occupancy, HUSKY) is keeps


def test_whoever_stands_in_a_zone_may_drive_out_and_not_farther_in() -> None:
    inside = world((0.2, 1.6, -0.8, 0.8))
    assert keeps_out(BACK, HERE, inside, HUSKY)
    assert not keeps_out(AHEAD, HERE, inside, HUSKY)
    assert keeps_out(STANDSTILL, HERE, inside, HUSKY)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    v_mps=st.floats(-0.5, 0.5),
    w_radps=st.floats(-1.0, 1.0),
    x_m=st.floats(-1.5, 1.5),
    y_m=st.floats(-1.5, 1.5),
    yaw_rad=st.floats(-math.pi, math.pi),
)
def test_what_is_allowed_never_comes_over_more_of_a_zone_within_the_next_third_of_a_second(
    v_mps: float, w_radps: float, x_m: float, y_m: float, yaw_rad: float
) -> None:
    twist, pose = Twist(v_mps=v_mps, w_radps=w_radps), Pose2(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)
    zone = rasterise(((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)), SPEC)
    if not keeps_out(twist, pose, world((-0.5, 0.5, -0.5, 0.5)), HUSKY):
        return
    before = _over(zone, pose)
    steps = 20
    for _ in range(steps):
        step = Pose2(x_m=v_mps * 0.33 / steps, y_m=0.0, yaw_rad=w_radps * 0.33 / steps)
        pose = pose @ step
    assert _over(zone, pose) <= before + 0.01


def _over(zone: npt.NDArray[np.bool_], pose: Pose2) -> float:
    """Square metres of the footprint over the zone, by its cells' centres."""
    centres = SPEC.centres(np.argwhere(zone)) - np.array([pose.x_m, pose.y_m])
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    base = centres @ np.array([[cos, -sin], [sin, cos]])
    inside = (np.abs(base[:, 0]) <= HUSKY.length_m / 2) & (np.abs(base[:, 1]) <= HUSKY.width_m / 2)
    return float(np.count_nonzero(inside)) * SPEC.resolution_m**2
