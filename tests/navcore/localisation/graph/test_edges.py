"""Covariances in the axes of a pose and of its parent."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.geometry.transform import Pose2
from navcore.localisation.graph.edges import in_own_axes, in_parent_axes
from tests.navcore.laws import law


@law(20)
@given(yaw_rad=st.floats(-math.pi, math.pi))
def test_a_covariance_in_the_axes_of_the_parent_and_back_is_the_same(yaw_rad: float) -> None:
    pose, spread = Pose2(x_m=2.0, y_m=-1.0, yaw_rad=yaw_rad), np.diag([4.0, 1.0, 0.1])
    spread[0, 2] = spread[2, 0] = 0.2
    assert in_own_axes(pose, in_parent_axes(pose, spread)) == pytest.approx(spread)


def test_what_is_uncertain_ahead_of_a_robot_turned_left_is_so_along_its_parents_y() -> None:
    left = Pose2(x_m=0.0, y_m=0.0, yaw_rad=math.pi / 2)
    expected = np.diag([1.0, 4.0, 0.1])
    assert in_parent_axes(left, np.diag([4.0, 1.0, 0.1])) == pytest.approx(expected)
