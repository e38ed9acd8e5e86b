"""Margins of beware cells follow the uncertainty since they were in view."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.localisation.localisation import OdometryConfig
from navcore.config.safety import KeepOutMonitorConfig
from navcore.geometry.transform import Pose2
from navcore.localisation.cell_margins import CellMargins, _index_of
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState
from navcore.localisation.tracking.odometry_model import travel_variance
from navcore.robot.frame import Frame
from tests.navcore.scene import Box, picture

AHEAD = np.array([[2.0, 0.0]])
NOTHING_NEAR = np.empty((0, 2))


def place(sigma_m: float) -> LocalisationEstimate:
    return LocalisationEstimate(covariance=np.diag([sigma_m**2, sigma_m**2, 0.0]))


@pytest.fixture
def margins() -> CellMargins:
    return CellMargins(
        keep_out=KeepOutMonitorConfig(sigmas=2.0, neighbour_m=0.25), odometry=OdometryConfig()
    )


def turned(yaw_rad: float) -> Frame:
    """A frame of a robot that has turned on the spot by an angle, at 30 rad/s."""
    return picture(pose=Pose2(x_m=0.0, y_m=0.0, yaw_rad=yaw_rad), stamp_ns=int(yaw_rad / 30 * 1e9))


def test_what_is_in_view_grows_by_nothing(margins: CellMargins) -> None:
    assert margins.follow(AHEAD, turned(0.0), place(0.3)).growth_m == pytest.approx([0.0])


def test_what_was_in_view_grows_by_the_uncertainty_since(margins: CellMargins) -> None:
    margins.follow(AHEAD, turned(0.0), place(0.300))
    grown = 2 * np.sqrt(0.301**2 - 0.300**2)
    assert margins.follow(AHEAD, turned(3.0), place(0.301)).growth_m == pytest.approx([grown])


def test_it_grows_by_no_more_than_robot_and_cell_are_uncertain_in_the_map(
    margins: CellMargins,
) -> None:
    def at(in_map_m: float, by_motion_m: float) -> LocalisationEstimate:
        return dataclasses.replace(
            place(in_map_m), covariance_by_motion=by_motion_m**2 * np.diag([1.0, 1.0, 0.0])
        )

    margins.follow(AHEAD, turned(0.0), at(0.02, 0.1))
    (by_map,) = margins.follow(AHEAD, turned(3.0), at(0.03, 0.4)).growth_m
    assert by_map == pytest.approx(2 * math.hypot(0.02, 0.03))


def test_it_grows_by_no_more_than_odometry_has_become_uncertain(margins: CellMargins) -> None:
    margins.follow(AHEAD, turned(0.0), place(0.3))
    (turning,) = margins.follow(AHEAD, turned(3.0), place(0.5)).growth_m
    bound = 4 * travel_variance(np.array([[0.0, 3.0, 0.1]]), np.array([2.0]))
    assert turning == pytest.approx(np.sqrt(bound[0])) and 0.05 < turning < 0.3
    unseen = np.vstack([AHEAD, [[2.0, 1.0]]])  # control
    assert margins.follow(unseen, turned(3.0), place(0.5)).growth_m[1] == pytest.approx(1.0)


def corrected(before_m: float, after_m: float, *, with_map: bool) -> LocalisationEstimate:
    """An estimate that an absolute position, or a closed loop, has made more certain."""
    shrunk = (before_m**2 - after_m**2) * np.eye(2)
    offset, moved = (shrunk, 0.0 * shrunk) if with_map else (2.0 * shrunk, shrunk)
    return dataclasses.replace(place(after_m), offset=offset, moved=moved)


def test_what_was_in_view_before_a_push_is_as_uncertain_as_the_push(margins: CellMargins) -> None:
    pushed = dataclasses.replace(place(0.3), moved=0.25**2 * np.eye(2))
    margins.follow(AHEAD, turned(0.0), place(0.05))
    assert margins.follow(AHEAD, turned(3.0), place(0.3)).growth_m[0] < 0.2  # control
    assert margins.follow(AHEAD, turned(3.0), pushed).growth_m == pytest.approx([0.52], abs=0.03)
    margins.follow(AHEAD, turned(0.0), pushed)  # seen again, it is where it is seen
    assert margins.follow(AHEAD, turned(3.0), pushed).growth_m[0] < 0.3


def test_an_absolute_position_moves_the_robot_away_from_what_it_saw_before(
    margins: CellMargins,
) -> None:
    margins.follow(AHEAD, turned(0.0), place(0.3))
    there = corrected(0.3, 0.02, with_map=False)
    (growth_m,) = margins.follow(AHEAD, turned(3.0), there).growth_m
    assert growth_m == pytest.approx(2 * math.sqrt(0.3**2 - 0.02**2), rel=1e-3)


def test_what_a_lost_robot_sees_is_as_uncertain_as_what_was_never_in_view(
    margins: CellMargins,
) -> None:
    lost = dataclasses.replace(place(0.3), state=LocalisationState.LOST)
    margins.follow(AHEAD, turned(0.0), lost)
    (growth_m,) = margins.follow(AHEAD, turned(3.0), place(0.03)).growth_m
    assert growth_m == pytest.approx(2 * 0.03)


def test_a_closed_loop_moves_what_it_saw_with_the_robot(margins: CellMargins) -> None:
    margins.follow(AHEAD, turned(0.0), place(0.3))
    there = corrected(0.3, 0.02, with_map=True)
    (growth_m,) = margins.follow(AHEAD, turned(3.0), there).growth_m
    assert growth_m == pytest.approx(0.0, abs=1e-6)


def test_what_was_never_in_view_is_as_uncertain_as_the_place(margins: CellMargins) -> None:
    assert margins.follow(AHEAD, turned(3.0), place(0.3)).growth_m == pytest.approx([0.6])


def test_a_cell_that_a_correction_moves_has_the_history_of_its_neighbour(
    margins: CellMargins,
) -> None:
    margins.follow(AHEAD, turned(0.0), place(0.3))
    (before,) = margins.follow(AHEAD, turned(3.0), place(0.5)).growth_m
    moved_and_far = np.array([[2.1, 0.1], [2.1, 0.5]])
    beside, alone = margins.follow(moved_and_far, turned(3.0), place(0.5)).growth_m
    assert beside == pytest.approx(before, rel=0.1)
    assert alone == pytest.approx(1.0)


def test_a_hidden_cell_is_as_certain_as_the_one_beside_it_that_was_in_view(
    margins: CellMargins,
) -> None:
    wall = Box(x=(1.2, 1.3), y=(-1.0, 1.0), z=(0.0, 1.5))
    cells = np.array([[1.4, 0.0], [1.6, 0.0], [2.4, 0.0]])
    for _ in range(2):
        shown, beside, alone = margins.follow(cells, picture(wall), place(0.5)).growth_m
        assert shown == beside == pytest.approx(0.0)
        assert alone == pytest.approx(1.0)  # control: nothing near it was in view


def test_a_cell_that_the_robot_comes_back_to_was_seen_before(margins: CellMargins) -> None:
    margins.follow(AHEAD, turned(0.0), place(0.300))
    away = picture(pose=Pose2(x_m=-8.0, y_m=0.0, yaw_rad=3.0), stamp_ns=int(2e9))
    assert len(margins.follow(NOTHING_NEAR, away, place(0.301)).cells) == 0
    back = picture(pose=Pose2(x_m=0.0, y_m=0.0, yaw_rad=3.0), stamp_ns=int(4e9))
    (known,) = margins.follow(AHEAD, back, place(0.301)).growth_m
    assert known == pytest.approx(2 * np.sqrt(0.301**2 - 0.300**2))
    margins.follow(NOTHING_NEAR, back, place(0.301))  # control: it is gone from the map
    assert margins.follow(AHEAD, back, place(0.301)).growth_m == pytest.approx([0.602])


def test_the_gate_gets_the_cells_near_the_robot_and_their_view_from_afar(
    margins: CellMargins,
) -> None:
    far = np.array([[3.5, 0.0]])
    assert len(margins.follow(far, turned(0.0), place(0.3)).cells) == 0
    near = picture(pose=Pose2(x_m=1.5, y_m=0.0, yaw_rad=3.0), stamp_ns=int(2e9))
    (growth_m,) = margins.follow(far, near, place(0.3)).growth_m
    assert growth_m == pytest.approx(0.0)


def test_a_cell_behind_something_is_not_in_view(margins: CellMargins) -> None:
    wall = Box(x=(1.2, 1.4), y=(-1.0, 1.0), z=(0.0, 1.5))
    assert margins.follow(AHEAD, picture(wall), place(0.3)).growth_m == pytest.approx([0.6])
    foot = Box(x=(1.8, 2.2), y=(-0.2, 0.2), z=(0.0, 1.5))  # control: it stands on the cell
    assert margins.follow(AHEAD, picture(foot), place(0.3)).growth_m == pytest.approx([0.0])


def test_a_robot_that_was_moved_by_other_means_has_seen_nothing(margins: CellMargins) -> None:
    margins.follow(AHEAD, turned(0.0), place(0.3))
    assert margins.follow(AHEAD, turned(3.0), place(0.3)).growth_m == pytest.approx([0.0])
    margins.forget()
    assert margins.follow(AHEAD, turned(3.0), place(0.3)).growth_m == pytest.approx([0.6])


@given(
    st.lists(st.tuples(st.integers(-4, 4), st.integers(-4, 4)), unique=True),
    st.lists(st.tuples(st.integers(-4, 4), st.integers(-4, 4)), unique=True),
)
def test_each_cell_is_found_among_others_if_it_is_one_of_them(
    cells: list[tuple[int, int]], among: list[tuple[int, int]]
) -> None:
    xy, others = (0.05 * np.array(some, dtype=np.float64).reshape(-1, 2) for some in (cells, among))
    found = [among.index(cell) if cell in among else len(among) for cell in cells]
    assert _index_of(xy, others).tolist() == found
