"""A map from elsewhere is placed at a site by two points that are known in both."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.errors import BadGeometry
from navcore.formats.alignment import align, placed
from navcore.formats.nav2_map import Nav2Map, State, map_from_cells
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec

coordinates = st.floats(-50, 50)
poses = st.builds(
    Pose2, x_m=coordinates, y_m=coordinates, yaw_rad=st.floats(-math.pi, math.pi, exclude_min=True)
)


@given(
    T_site_map=poses,
    a=st.tuples(coordinates, coordinates),
    turn=st.floats(0, 6),
    d=st.floats(1.1, 40),
)
def test_the_alignment_of_a_moved_map_is_its_pose(
    T_site_map: Pose2, a: tuple[float, float], turn: float, d: float
) -> None:
    b = (a[0] + d * math.cos(turn), a[1] + d * math.sin(turn))
    moved = T_site_map.to_parent(np.array([a, b]))
    found = align((a, b), (tuple(moved[0]), tuple(moved[1])))
    np.testing.assert_allclose(found.to_parent(np.array([a, b])), moved, atol=1e-6)


def test_points_that_are_clicked_a_little_off_share_the_error() -> None:
    found = align(((0, 0), (10, 0)), ((0, 0), (10.2, 0)))
    assert found == Pose2(x_m=pytest.approx(0.1), y_m=0.0, yaw_rad=0.0)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("site", "words"),
    [
        (((0, 0), (12, 0)), "20 %"),
        (((0, 0), (8, 0)), "-20 %"),
        (((0, 0), (0.5, 0)), "0.50 m apart"),
        (((0, 0), (math.nan, 0)), "not finite"),
    ],
)
def test_a_wrong_scale_and_points_without_a_heading_are_refused(
    site: tuple[tuple[float, float], tuple[float, float]], words: str
) -> None:
    with pytest.raises(BadGeometry, match=words):
        align(((0, 0), (10, 0)), site)


def a_fence() -> Nav2Map:
    """A square fence, one cell wide, of 20 cells a side in known floor, with unknown outside."""
    occupied, known = np.zeros((24, 24), dtype=np.bool_), np.zeros((24, 24), dtype=np.bool_)
    known[2:22, 2:22] = True
    occupied[2:22, 2:22] = True
    occupied[3:21, 3:21] = False
    spec = GridSpec(resolution_m=0.1, rows=24, cols=24, origin_x_m=-1.2, origin_y_m=-1.2)
    return map_from_cells(occupied=occupied, known=known, spec=spec)


def test_a_map_that_is_only_shifted_keeps_every_cell() -> None:
    fence = a_fence()
    moved = placed(fence, Pose2(x_m=3.0, y_m=-2.0, yaw_rad=0.0))
    np.testing.assert_array_equal(moved.states(), fence.states())
    assert moved.spec.origin_x_m == pytest.approx(1.8)
    assert moved.spec.origin_y_m == pytest.approx(-3.2)


@given(yaw_rad=st.floats(-3.1, 3.1))
def test_a_turned_fence_stays_closed(yaw_rad: float) -> None:
    moved = placed(a_fence(), Pose2(x_m=0.3, y_m=0.7, yaw_rad=yaw_rad))
    walls = moved.cells(State.OCCUPIED)
    inside = moved.spec.cell(0.3, 0.7)
    _, labels = cv2.connectedComponents((~walls).view(np.uint8), connectivity=4)
    reached = ~walls & (labels == labels[inside])
    assert reached[inside]
    assert not (reached[0].any() or reached[-1].any() or reached[:, 0].any())
    assert (moved.states()[reached] == State.FREE).all()
