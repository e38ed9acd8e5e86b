"""Driving by hand keeps out of beware areas, and gets out of them."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navcore.behaviours.assisted_teleop import stays_out
from navcore.costmap.costmap import Costmap
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.grid.grid import GridSpec, OccupancyGrid
from navcore.mission.zone import Zone, ZoneKind
from navcore.mission.zone_cells import rasterise
from navcore.robot.profile import HUSKY

SPEC = GridSpec.centred(size_m=(8.0, 8.0), resolution_m=0.05)
AHEAD, BACK = Twist(v_mps=0.4, w_radps=0.0), Twist(v_mps=-0.2, w_radps=0.0)
TURN = Twist(v_mps=0.0, w_radps=0.6)


Box = tuple[float, float, float, float]
"""Left, right, low, high."""


def zone(name: str, box: Box, *, margin_m: float = 0.0) -> Zone:
    left, right, low, high = box
    return Zone(
        id=name,
        name=name,
        polygon=((left, low), (right, low), (right, high), (left, high)),
        margin_m=margin_m,
    )


def seen(
    *, mines: tuple[Box, ...] = (), walls: tuple[Box, ...] = (), margin_m: float = 0.0
) -> Costmap:
    """A map that holds these."""
    layers = []
    for boxes in (mines, walls):
        layer = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
        for box in boxes:
            layer |= rasterise(zone("", box).polygon, SPEC)
        layers.append(layer)
    nothing = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    grid = OccupancyGrid(
        spec=SPEC,
        geometric=layers[1],
        beware={7: layers[0]},
        zones=nothing,
        margins_m={7: margin_m},
    )
    return Costmap.of(grid, nothing, version=1)


def keeps(
    twist: Twist, *zones: Zone, pose: Pose2 | None = None, known: Costmap | None = None
) -> bool:
    return stays_out(twist, pose or HERE, HUSKY, zones=zones, spec=SPEC, seen=known)


HERE = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
AHEAD_OF_IT: Box = (0.66, 1.6, -0.5, 0.5)


@pytest.mark.parametrize(
    ("twist", "box", "allowed"),
    [
        (AHEAD, AHEAD_OF_IT, False),
        (BACK, AHEAD_OF_IT, True),
        (TURN, AHEAD_OF_IT, True),
        (AHEAD, (1.5, 2.5, -0.5, 0.5), True),
        (TURN, (-0.2, 0.2, 0.4, 0.8), False),
    ],
)
def test_a_hand_is_held_where_the_footprint_would_come_over_a_zone_or_a_thing(
    twist: Twist, box: Box, allowed: bool
) -> None:
    assert keeps(twist, zone("z", box)) is allowed  # before anything was seen, too
    assert keeps(twist, zone("z", box), known=seen()) is allowed
    assert keeps(twist, known=seen(mines=(box,))) is allowed
    assert keeps(twist, known=seen(walls=(box,))) and keeps(twist)


def test_margins_bind_a_hand_as_they_bind_the_robot() -> None:
    afar: Box = (1.5, 2.5, -0.5, 0.5)
    assert keeps(AHEAD, zone("z", afar)) and not keeps(AHEAD, zone("z", afar, margin_m=0.9))
    assert keeps(AHEAD, known=seen(mines=(afar,))) and not keeps(
        AHEAD, known=seen(mines=(afar,), margin_m=0.9)
    )


def test_a_zone_that_is_off_and_a_speed_limit_do_not_hold_a_hand() -> None:
    ahead = zone("z", AHEAD_OF_IT)
    assert keeps(AHEAD, dataclasses.replace(ahead, enabled=False))
    assert keeps(AHEAD, dataclasses.replace(ahead, kind=ZoneKind.SPEED_LIMIT, max_speed_mps=0.3))


def test_whoever_stands_in_a_zone_may_drive_out_and_not_farther_in() -> None:
    inside = zone("z", (0.2, 1.6, -0.8, 0.8))
    assert keeps(BACK, inside)
    assert not keeps(AHEAD, inside)
    assert keeps(STANDSTILL, inside)


def test_out_of_a_zone_a_hand_drives_over_no_thing_in_it_and_into_no_zone_beside_it() -> None:
    under = zone("under", (-2.0, 2.0, -2.0, 2.0))
    assert keeps(AHEAD, under)
    assert not keeps(AHEAD, under, known=seen(mines=((0.6, 0.9, -0.2, 0.2),)))
    assert keeps(BACK, under, known=seen(mines=((0.6, 0.9, -0.2, 0.2),)))
    leaving = zone("under", (-2.0, 0.4, -2.0, 2.0))
    assert keeps(AHEAD, leaving) and not keeps(AHEAD, leaving, zone("next", AHEAD_OF_IT))


def test_off_the_map_a_hand_is_free() -> None:
    off = Pose2(x_m=40.0, y_m=0.0, yaw_rad=0.0)
    assert keeps(
        AHEAD, zone("z", AHEAD_OF_IT), pose=off, known=seen(mines=(AHEAD_OF_IT,))
    ) and keeps(AHEAD, pose=off)


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
    square = zone("z", (-0.5, 0.5, -0.5, 0.5))
    cells = rasterise(square.polygon, SPEC)
    if not keeps(twist, square, pose=pose):
        return
    before = _over(cells, pose)
    steps = 20
    for _ in range(steps):
        step = Pose2(x_m=v_mps * 0.33 / steps, y_m=0.0, yaw_rad=w_radps * 0.33 / steps)
        pose = pose @ step
    assert _over(cells, pose) <= before + 0.01


def _over(cells: npt.NDArray[np.bool_], pose: Pose2) -> float:
    """Square metres of the footprint over the zone, by its cells' centres."""
    centres = SPEC.centres(np.argwhere(cells)) - np.array([pose.x_m, pose.y_m])
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    base = centres @ np.array([[cos, -sin], [sin, cos]])
    inside = (np.abs(base[:, 0]) <= HUSKY.length_m / 2) & (np.abs(base[:, 1]) <= HUSKY.width_m / 2)
    return float(np.count_nonzero(inside)) * SPEC.resolution_m**2
