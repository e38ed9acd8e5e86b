"""Where only the margin blocks the path, the robot drives nearer to measure; it enters no closed
cell."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.mapping import MappingConfig
from navcore.config.navigator import NavigatorConfig
from navcore.control.motion import ControllerState
from navcore.costmap.costmap import Costmap
from navcore.geometry.transform import Pose2
from navcore.grid.free_space import FreeSpace
from navcore.grid.grid import BoolGrid, GridSpec, OccupancyGrid, inflate_layers
from navcore.mapping.explored.visibility import VisibilityMap
from navcore.mapping.points.pose_ids import PoseIds
from navcore.mission.beware_list import BewareClass, BewareList
from navcore.mission.order import NavigationRequest
from navcore.mission.zone import Zone, ZoneKind
from navcore.navigator import Navigator
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.labels import Labels, LabelSource
from navcore.planning.gap_viewpoint import viewpoint_before_gap
from navcore.planning.global_planner import GlobalPlanner
from navcore.planning.path import NoPath, Path, Reason
from navcore.planning.planner import plan
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from tests.navcore.laws import law
from tests.navcore.perception.test_depth_filter import PINK
from tests.navcore.scene import RED_LIST, Box, picture

SPEC = GridSpec.centred(size_m=(12.0, 8.0), resolution_m=0.05)
MARGIN_M = NavigatorConfig().safety_margin_m
PERSON, BOX = 11, 6
WALL_X_M, GAP_M = 2.0, 0.9
"""Wider than the Husky, narrower than the Husky with its margin on either side."""
BETWEEN = Pose2(x_m=-2.0, y_m=0.0, yaw_rad=0.0)
"""As far from either of two gaps."""


def wall(gap_m: float) -> BoolGrid:
    """From side to side of the map, with a gap in its middle."""
    cells = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    col = SPEC.cell(WALL_X_M, 0.0)[1]
    cells[:, col : col + 4] = True
    half = round(gap_m / 2 / SPEC.resolution_m)
    cells[SPEC.rows // 2 - half : SPEC.rows // 2 + half] = False
    return cells


def occupancy(
    geometric: BoolGrid | None = None,
    zones: BoolGrid | None = None,
    beware: Mapping[int, BoolGrid] | None = None,
) -> Costmap:
    nothing = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    grid = OccupancyGrid(
        spec=SPEC,
        geometric=nothing if geometric is None else geometric,
        beware={} if beware is None else beware,
        margins_m={PERSON: 0.2},
        zones=nothing if zones is None else zones,
        wide_zones=(),
    )
    return Costmap.of(
        grid,
        inflate_layers(grid, vehicle_width_m=HUSKY.width_m, safety_margin_m=MARGIN_M),
        version=1,
    )


def approach(known: Costmap, x_m: float, y_m: float = 0.0) -> Path | None:
    start, goal = SPEC.cell(x_m, y_m), SPEC.cell(4.0, 0.0)
    found = viewpoint_before_gap(
        known,
        start,
        goal,
        people=[PERSON],
        vehicle_width_m=HUSKY.width_m,
        relief_cells=12.0,
        body_m=0.15,
    )
    if found is None:
        return None
    path = plan(known.blocked, *found)
    assert isinstance(path, Path)
    return path


@pytest.mark.parametrize("y_m", [0.0, 2.5, -3.0])
def test_the_robot_goes_up_to_the_gap_and_enters_nothing_that_is_closed(y_m: float) -> None:
    known = occupancy(wall(GAP_M))
    path = approach(known, -2.0, y_m)
    assert path is not None
    assert not known.blocked[path.cells[:, 0], path.cells[:, 1]].any()
    x, y = SPEC.centre(*(int(at) for at in path.cells[-1]))
    assert WALL_X_M - 0.7 < x < WALL_X_M and abs(y) < 0.2


@pytest.mark.parametrize("gap_m", [0.0, HUSKY.width_m - 0.1])
def test_a_wall_without_a_gap_for_the_body_is_not_gone_to(gap_m: float) -> None:
    assert approach(occupancy(wall(gap_m)), -2.0) is None


def test_of_two_gaps_the_one_that_less_is_missing_of() -> None:
    cells = wall(0.8)
    wider, half = SPEC.cell(WALL_X_M, -2.5), round(0.95 / 2 / SPEC.resolution_m)
    cells[wider[0] - half : wider[0] + half, wider[1] : wider[1] + 4] = False
    path = approach(occupancy(cells), -2.0)
    assert path is not None
    assert SPEC.centre(*(int(at) for at in path.cells[-1]))[1] == pytest.approx(-2.5, abs=0.3)


def test_of_two_equal_gaps_the_one_nearer_to_the_goal() -> None:
    cells = wall(GAP_M)
    (row, col), half = SPEC.cell(WALL_X_M, -2.5), round(GAP_M / 2 / SPEC.resolution_m)
    cells[row - half : row + half, col : col + 4] = False
    for y_m in (0.0, -2.5):  # from before either
        path = approach(occupancy(cells), 0.0, y_m)
        assert path is not None
        assert abs(SPEC.centre(*(int(at) for at in path.cells[-1]))[1]) < 0.3


def two_gaps(upper_m: float, lower_m: float) -> Costmap:
    """A wall with gaps of these widths at y = 2 m and y = −2 m; 0 for none."""
    cells = wall(0.0)
    col = SPEC.cell(WALL_X_M, 0.0)[1]
    for y_m, gap_m in ((2.0, upper_m), (-2.0, lower_m)):
        row, half = SPEC.cell(WALL_X_M, y_m)[0], round(gap_m / 2 / SPEC.resolution_m)
        cells[row - half : row + half, col : col + 4] = False
    return occupancy(cells)


class Drive:
    """A planner whose measurements of two gaps change from plan to plan."""

    def __init__(self) -> None:
        self.space = FreeSpace.of(np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_))
        explored = VisibilityMap(SPEC, MappingConfig().raycast, PoseIds(0.5, 20.0))
        self.planner = GlobalPlanner(self.space, explored, HUSKY, NavigatorConfig())

    def end(self, upper_m: float, lower_m: float, pose: Pose2 = BETWEEN) -> tuple[float, float]:
        """The viewpoint (x, y) of the route in metres."""
        known = two_gaps(upper_m, lower_m)
        self.space.update(known.blocked)
        route = self.planner.plan(known, pose, (4.0, 0.0), RED_LIST)
        assert route.outcome == NoPath(reason=Reason.UNREACHABLE)
        x_m, y_m = route.points[-1]
        return float(x_m), float(y_m)


WAVERING = [(0.9, 0.85), (0.85, 0.9), (0.9, 0.9)] * 3
"""Widths of two gaps as they are measured from afar."""


def test_of_two_gaps_that_lack_about_equally_much_the_present_one_is_kept() -> None:
    drive = Drive()
    assert all(drive.end(*widths)[1] > 1.0 for widths in WAVERING)
    # Control: without a memory the gap is now this one and now that one.
    assert {Drive().end(*widths)[1] > 1.0 for widths in WAVERING} == {True, False}


def test_a_gap_that_has_closed_for_good_is_left_for_the_other() -> None:
    drive = Drive()
    assert drive.end(0.9, 0.85)[1] > 1.0
    assert drive.end(0.5, 0.85)[1] < -1.0
    assert drive.end(0.9, 0.85)[1] < -1.0, "now the other one is the present one"


def test_at_the_gap_the_choice_is_made_again_by_what_was_measured_there() -> None:
    drive = Drive()
    x_m, y_m = drive.end(0.9, 0.85)
    assert y_m > 1.0
    near = Pose2(x_m=x_m - 0.2, y_m=y_m, yaw_rad=0.0)
    assert drive.end(0.85, 0.9, near)[1] < -1.0
    # Control: from farther away the robot still drives to the first one.
    again = Drive()
    again.end(0.9, 0.85)
    assert again.end(0.85, 0.9, Pose2(x_m=x_m - 0.6, y_m=y_m, yaw_rad=0.0))[1] > 1.0


def test_a_margin_of_the_operator_is_no_mere_safety_margin() -> None:
    posts = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    row, col = SPEC.cell(WALL_X_M, 0.0)
    posts[row - 9 : row + 9 : 17, col : col + 4] = True  # 0.8 m apart
    walls = wall(GAP_M)
    for margin_m, goes in ((0.0, True), (0.3, False)):
        grid = OccupancyGrid(
            spec=SPEC,
            geometric=walls,
            beware={BOX: posts},
            zones=np.zeros_like(posts),
            margins_m={BOX: margin_m},
        )
        blocked = inflate_layers(grid, vehicle_width_m=HUSKY.width_m, safety_margin_m=MARGIN_M)
        assert (approach(Costmap.of(grid, blocked, version=1), -2.0) is not None) == goes


@law(60)
@given(st.integers(0, 2**32 - 1))
def test_no_path_has_fewer_closed_cells_than_the_one_before_whose_gap_the_viewpoint_is(
    seed: int,
) -> None:
    rng = np.random.default_rng(seed)
    spec = GridSpec.centred(size_m=(3.0, 2.0), resolution_m=0.05)
    geometric = rng.random((spec.rows, spec.cols)) < rng.choice([0.002, 0.01, 0.03])
    grid = OccupancyGrid(spec=spec, geometric=geometric, beware={}, zones=np.zeros_like(geometric))
    known = Costmap.of(
        grid, inflate_layers(grid, vehicle_width_m=0.2, safety_margin_m=0.15), version=1
    )
    solid = inflate_layers(grid, vehicle_width_m=0.2, safety_margin_m=0.0)
    if known.blocked.all():
        return
    free = np.argwhere(~known.blocked)
    start, goal = ((int(row), int(col)) for row, col in free[rng.integers(len(free), size=2)])
    found = viewpoint_before_gap(
        known, start, goal, vehicle_width_m=0.2, relief_cells=0.0, body_m=0.15
    )
    costs = closed_cells(known.blocked, solid, goal)
    _, regions = cv2.connectedComponents((~known.blocked).view(np.uint8), connectivity=4)
    least = costs[regions == regions[start]].min()
    if found is None:
        assert least == np.inf or start == goal or costs[start] == least
        return
    first, last = found
    assert first == start
    assert regions[last] == regions[start]
    assert costs[last] == least


def closed_cells(
    blocked: BoolGrid, solid: BoolGrid, goal: tuple[int, ...]
) -> npt.NDArray[np.float64]:
    """(rows, cols) least number of closed cells on a path to the goal; infinite without one."""
    costs, queue = np.full(blocked.shape, np.inf), deque([goal])
    costs[goal] = 0
    while queue:
        row, col = queue.popleft()
        for to in ((row + 1, col), (row - 1, col), (row, col + 1), (row, col - 1)):
            inside = 0 <= to[0] < blocked.shape[0] and 0 <= to[1] < blocked.shape[1]
            if inside and not solid[to] and costs[row, col] + blocked[to] < costs[to]:
                costs[to] = costs[row, col] + blocked[to]
                (queue.append if blocked[to] else queue.appendleft)(to)
    return costs


def test_a_zone_is_no_gap_however_thin() -> None:
    zone = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    zone[:, SPEC.cell(WALL_X_M, 0.0)[1]] = True
    assert approach(occupancy(zones=zone), -2.0) is None


@pytest.mark.parametrize(("class_id", "goes"), [(PERSON, True), (BOX, False)])
def test_a_person_in_a_door_may_have_walked_on_but_no_object_has(class_id: int, goes: bool) -> None:
    cells, person = wall(1.2), np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    row, col = SPEC.cell(WALL_X_M, 0.0)
    person[row - 4 : row + 4, col - 4 : col + 4] = True
    rim = person.copy()
    rim[row - 6 : row + 6, col - 6 : col + 6] = True  # an image labels a part of the person
    known = occupancy(cells | rim, beware={class_id: person})
    path = approach(known, -2.0)
    assert (path is not None) == goes
    if path is not None:
        assert not known.blocked[path.cells[:, 0], path.cells[:, 1]].any()
        x, y = SPEC.centre(*(int(at) for at in path.cells[-1]))
        assert WALL_X_M - 1.1 < x < WALL_X_M and abs(y) < 0.5


def test_at_the_gap_there_is_no_further_viewpoint() -> None:
    known = occupancy(wall(GAP_M))
    path = approach(known, -2.0)
    assert path is not None
    assert approach(known, *SPEC.centre(*(int(at) for at in path.cells[-1]))) is None


def test_a_robot_within_the_gap_leaves_it_on_the_side_of_the_goal() -> None:
    path = approach(occupancy(wall(GAP_M)), WALL_X_M - 0.1)
    assert path is not None
    assert SPEC.centre(*(int(at) for at in path.cells[0]))[0] > WALL_X_M
    assert tuple(path.cells[-1]) == SPEC.cell(4.0, 0.0)


HALL = Zone(
    id="hall",
    name="hall",
    kind=ZoneKind.STAY_INSIDE,
    polygon=tuple(
        (x_m, y_m)
        for x_m, y_m in (
            (SPEC.origin_x_m, SPEC.origin_y_m),
            (-SPEC.origin_x_m, SPEC.origin_y_m),
            (-SPEC.origin_x_m, -SPEC.origin_y_m),
            (SPEC.origin_x_m, -SPEC.origin_y_m),
        )
    ),
)
"""The robot stays within the grid that the walls cross: beyond it the map would grow round them."""


def test_the_navigator_drives_there_and_says_that_there_is_no_path() -> None:
    navigator = Navigator(
        spec=SPEC, profile=HUSKY, segmenter=ColourSegmenter(), config=NavigatorConfig()
    )
    navigator.map.load_prior(wall(GAP_M))
    away = Pose2(
        x_m=-2.0, y_m=0.0, yaw_rad=np.pi
    )  # faces away, so that it sees nothing of the wall
    order = NavigationRequest(goal=(4.0, 0.0), beware=RED_LIST, zones=(HALL,))
    decision = navigator.tick(picture(pose=away), order)
    assert decision.route is not None and decision.route.outcome == NoPath(
        reason=Reason.UNREACHABLE
    )
    assert np.hypot(*(decision.route.points[-1] - [WALL_X_M, 0.0])) < 0.7
    assert decision.motion.outcome is ControllerState.TURN
    there = Pose2(
        x_m=float(decision.route.points[-1, 0]),
        y_m=float(decision.route.points[-1, 1]),
        yaw_rad=np.pi,
    )
    decision = navigator.tick(picture(pose=there, stamp_ns=100_000_000), order)
    assert decision.route is not None and len(decision.route.points) == 0
    assert decision.motion.outcome is ControllerState.IDLE


class SeesPeople:
    """A network that takes everything pink for a person."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        pink = (frame.rgb == PINK).all(axis=2)
        return Labels(
            class_ids=np.where(pink, np.uint8(PERSON), np.uint8(0)),
            confidence=np.full(pink.shape, 0.95, np.float32),
        )

    def source_of(self, entry: BewareClass) -> LabelSource:
        return LabelSource.NETWORK


@pytest.mark.parametrize("measured", [True, False])
def test_the_navigator_checks_whether_the_person_in_the_only_door_has_gone_and_drives_on(
    measured: bool,
) -> None:
    """`measured`: whether there is depth behind the person."""
    beware = BewareList(classes=(BewareClass(name="person", class_id=PERSON, margin_m=0.2),))
    navigator = Navigator(
        spec=SPEC, profile=HUSKY, segmenter=SeesPeople(), config=NavigatorConfig()
    )
    navigator.map.load_prior(wall(1.2))
    order = NavigationRequest(goal=(4.0, 0.0), beware=beware, zones=(HALL,))
    walls = [Box(x=(2.0, 2.2), y=y, z=(0.0, 2.0)) for y in ((-4.0, -0.6), (0.6, 4.0))]
    if measured:
        walls.append(Box(x=(5.0, 5.1), y=(-4.0, 4.0), z=(0.0, 2.5)))
    person = Box(x=(1.95, 2.25), y=(-0.25, 0.25), z=(0.0, 1.75), colour=PINK)
    before = Pose2(x_m=-0.5, y_m=0.0, yaw_rad=0.0)
    for tick in range(5):
        decision = navigator.tick(
            picture(*walls, person, pose=before, stamp_ns=tick * 100_000_000), order
        )
    aside = Pose2(x_m=-2.0, y_m=0.0, yaw_rad=np.pi)
    decision = navigator.tick(picture(*walls, pose=aside, stamp_ns=600_000_000), order)
    assert decision.route is not None and decision.route.outcome == NoPath(
        reason=Reason.UNREACHABLE
    )
    assert 0.5 < decision.route.points[-1, 0] < 1.6 and abs(decision.route.points[-1, 1]) < 0.6
    near = Pose2(x_m=-1.0, y_m=0.0, yaw_rad=0.0)
    for tick in range(7, 12):
        decision = navigator.tick(picture(*walls, pose=near, stamp_ns=tick * 100_000_000), order)
    assert decision.route is not None and isinstance(decision.route.outcome, Path)
