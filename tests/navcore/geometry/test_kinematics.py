"""Arcs of constant curvature, against composed poses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.geometry.kinematics import arc_position, chord_lengths
from navcore.geometry.transform import Pose2
from tests.navcore.laws import law

SPEEDS = st.floats(-2.0, 2.0)
TIMES = st.floats(0.0, 3.0)


@law(60)
@given(v=SPEEDS, w=SPEEDS, first_s=TIMES, then_s=TIMES)
def test_two_arcs_in_a_row_are_the_arc_of_both_times(
    v: float, w: float, first_s: float, then_s: float
) -> None:
    def after(time_s: float) -> Pose2:
        x_m, y_m = arc_position(v, w, time_s)
        return Pose2(x_m=x_m, y_m=y_m, yaw_rad=w * time_s)

    both, whole = after(first_s) @ after(then_s), after(first_s + then_s)
    assert (both.x_m, both.y_m) == pytest.approx((whole.x_m, whole.y_m), abs=1e-5)


@law(60)
@given(v=SPEEDS, w=st.floats(0.01, 2.0), time_s=TIMES)
def test_the_chord_of_an_arc_is_the_distance_of_its_ends(v: float, w: float, time_s: float) -> None:
    (chord_m,) = chord_lengths(np.array([v * time_s]), np.array([w * time_s]))
    x_m, y_m = arc_position(v, w, time_s)
    bearing_rad = w * time_s / 2
    assert x_m == pytest.approx(chord_m * math.cos(bearing_rad), abs=1e-9)
    assert y_m == pytest.approx(chord_m * math.sin(bearing_rad), abs=1e-9)
