"""Margins of beware cells follow the uncertainty since they were in view."""

from __future__ import annotations

import numpy as np
import pytest

from navcore.geometry.transform import Pose2
from navcore.localisation.cell_margins import CellMargins
from navcore.localisation.estimate import LocalisationEstimate
from navcore.robot.frame import Frame
from tests.navcore.scene import picture

AHEAD = np.array([[2.0, 0.0]])


def place(sigma_m: float) -> LocalisationEstimate:
    return LocalisationEstimate(covariance=np.diag([sigma_m**2, sigma_m**2, 0.0]))


@pytest.fixture
def margins() -> CellMargins:
    return CellMargins(sigmas=2.0, resolution_m=0.05, range_m=6.0)


def turned(yaw_rad: float) -> Frame:
    return picture(pose=Pose2(x_m=0.0, y_m=0.0, yaw_rad=yaw_rad))


def test_what_is_in_view_grows_by_nothing(margins: CellMargins) -> None:
    assert margins.follow(AHEAD, turned(0.0), place(0.3)) == pytest.approx([0.0])


def test_what_was_in_view_grows_by_the_uncertainty_since(margins: CellMargins) -> None:
    margins.follow(AHEAD, turned(0.0), place(0.3))
    assert margins.follow(AHEAD, turned(3.0), place(0.5)) == pytest.approx([0.8])


def test_what_was_never_in_view_is_as_uncertain_as_the_place(margins: CellMargins) -> None:
    assert margins.follow(AHEAD, turned(3.0), place(0.3)) == pytest.approx([0.6])
