"""The path that the robot has driven."""

from __future__ import annotations

import math

import numpy as np
import pytest

from app.runtime.record.driven_path import DrivenPath
from navcore.geometry.transform import Pose2


def at(x_m: float) -> Pose2:
    return Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0)


def test_a_robot_that_is_believed_elsewhere_has_not_driven_there() -> None:
    path = DrivenPath()
    for x_m in (0.0, 0.01, 0.5, 1.0):
        path.add(at(x_m), at(x_m))
    assert path.points.tolist() == [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]]
    assert path.length_m == pytest.approx(1.0)
    path.add(at(12.0), at(1.0))
    assert path.points.tolist() == [[12.0, 0.0]]
    path.add(at(12.5), at(1.5))
    assert path.points.tolist() == [[12.0, 0.0], [12.5, 0.0]]
    assert path.length_m == pytest.approx(1.5)


def test_a_small_correction_goes_on_with_the_path() -> None:
    path = DrivenPath()
    path.add(at(0.0), at(0.0))
    path.add(at(0.7), at(0.4))
    assert len(path.points) == 2
    assert path.length_m == pytest.approx(0.4)


def test_a_standing_robot_whose_place_is_corrected_to_and_fro_has_driven_nowhere() -> None:
    path = DrivenPath()
    for tick in range(10):
        path.add(at(0.3 * (tick % 2)), at(0.0))
    assert path.length_m == 0.0


def test_the_path_moves_with_the_map_and_its_length_stays() -> None:
    path = DrivenPath()
    for x_m in (0.0, 1.0, 2.0, 3.0):
        path.add(at(x_m), at(x_m))
    turned = Pose2(x_m=3.0, y_m=1.0, yaw_rad=math.pi / 2)
    path.follow((at(0.5), at(3.0)), (at(0.5), turned))
    np.testing.assert_allclose(path.points, [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0], [3.0, 1.0]])
    assert path.length_m == pytest.approx(3.0)
