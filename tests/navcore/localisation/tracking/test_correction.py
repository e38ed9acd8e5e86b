"""Corrections flow in slowly while the robot drives; large ones wait until it stands."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from navcore.config.localisation.localisation import TrackingConfig
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.localisation.tracking.correction import CorrectionFlow
from tests.navcore.laws import law

RULES = TrackingConfig()
places = st.builds(
    Pose2, x_m=st.floats(-0.3, 0.3), y_m=st.floats(-0.3, 0.3), yaw_rad=st.floats(-0.2, 0.2)
)


@law(100)
@given(st.lists(places, max_size=15))
def test_while_driving_no_frame_moves_the_pose_further_than_allowed(wanted: list[Pose2]) -> None:
    flow = CorrectionFlow(RULES)
    base = Pose2(x_m=3.0, y_m=-2.0, yaw_rad=1.0)
    for shift in wanted:
        before = flow.T_map_odom @ base
        flow.follow(shift @ base, base, standing=False)
        after = flow.T_map_odom @ base
        assert before.distance_to(after.x_m, after.y_m) <= RULES.flow_m + 1e-9
        assert abs(after.yaw_rad - before.yaw_rad) <= math.radians(RULES.flow_deg) + 1e-9


def test_a_small_correction_is_complete_after_a_few_frames() -> None:
    flow = CorrectionFlow(RULES)
    wanted = Pose2(x_m=0.07, y_m=0.0, yaw_rad=0.0)
    for _ in range(4):
        assert flow.T_map_odom != wanted
        flow.follow(wanted, IDENTITY, standing=False)

    assert abs(flow.T_map_odom.x_m - 0.07) < 1e-9
    assert flow.pending is None


def test_a_large_correction_waits_until_the_robot_stands() -> None:
    flow = CorrectionFlow(RULES)
    wanted = Pose2(x_m=0.5, y_m=0.0, yaw_rad=0.0)
    for _ in range(10):
        flow.follow(wanted, IDENTITY, standing=False)
    assert flow.T_map_odom == IDENTITY
    assert flow.pending == wanted

    flow.follow(wanted, IDENTITY, standing=True)

    assert flow.T_map_odom == wanted
    assert flow.pending is None
