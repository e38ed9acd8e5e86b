"""What the local planner commands beside beware cells and zones relative to which the position is
uncertain, the safety gate lets pass: else the robot stands where both wait for each other."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from navcore.config.control import CollisionConfig, LocalPlannerConfig
from navcore.config.safety import DEFAULT_SAFETY
from navcore.control.local_planner import LocalPlannerInput, compute_velocity
from navcore.control.motion import IDLE, ControllerState, Motion
from navcore.costmap.local_costmap import kept_cells, kept_zones, nearby, obstacle_masks
from navcore.geometry.arrays import Points
from navcore.geometry.transform import STANDSTILL, Pose2
from navcore.grid.grid import BoolGrid, GridSpec, OccupancyGrid
from navcore.localisation.cell_margins import NO_CELLS, GrownCells
from navcore.localisation.zone_margins import ZoneMargins
from navcore.mission.zone import Zone
from navcore.robot.profile import HUSKY
from navcore.safety.keep_out_monitor import KeepOuts, permitted_share
from tests.navcore.laws import law
from tests.navcore.localisation.test_zone_margins import both

SPEC = GridSpec.centred(size_m=(8.0, 8.0), resolution_m=0.05)
EMPTY = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
BEHIND = Pose2(x_m=0.0, y_m=0.0, yaw_rad=math.radians(-82.0))
"""The robot faces away from a marking to its left and turns towards the path beside it."""
AWAY: Points = np.column_stack([np.linspace(0, 3, 31), np.zeros(31)])


def marking(edge_m: float) -> Points:
    """(N, 2) cells of a marking that begins at y = `edge_m` and is 2 m by 1 m."""
    rows, cols = np.mgrid[0 : int(1 / 0.05), 0 : int(2 / 0.05)]
    return np.column_stack([cols.ravel() * 0.05 - 0.975, rows.ravel() * 0.05 + edge_m + 0.025])


def decided(
    cells: GrownCells, pose: Pose2, path: Points, forbidden: BoolGrid | None = None
) -> Motion:
    """The motion along a path of the map frame beside cells, which are kept by `forbidden`, by
    default as the safety gate does."""
    seen = EMPTY.copy()
    seen[tuple(((cells.cells[:, ::-1] + 4.0) // SPEC.resolution_m).astype(int).T)] = True
    grid = OccupancyGrid(spec=SPEC, geometric=EMPTY, beware={3: seen}, zones=EMPTY)
    kept = cells.kept_by(HUSKY, pose, CollisionConfig().kept_besides_m)
    mask = kept_cells(SPEC, kept.cells, kept.growth_m) if forbidden is None else forbidden
    mask = mask | obstacle_masks(grid)[1]
    return compute_velocity(
        LocalPlannerInput(
            geometric=np.empty((0, 2)),
            forbidden=nearby(mask, grid, pose, 3.5),
            unseen=np.empty((0, 2)),
            cell_m=SPEC.resolution_m,
            path=path,
            pose=pose,
            twist=STANDSTILL,
            previous=IDLE,
            profile=HUSKY,
            local=LocalPlannerConfig(),
        )
    )


def share_of(motion: Motion, cells: GrownCells, pose: Pose2) -> float:
    """The share of a motion that the gate permits."""
    keep_outs = KeepOuts(
        pose=pose,
        cells=cells.cells,
        cell_growth_m=cells.growth_m,
        cell_objects=cells.objects if len(cells.objects) else None,
    )
    return permitted_share(keep_outs, motion.twist, HUSKY, frame_age_s=0.1)[0]


def swept_share(cells: GrownCells, motion: Motion, pose: Pose2) -> float:
    """The least share that the gate permits on the way of a turn in place."""
    headings = np.arange(0.0, math.radians(80.0), 0.05)
    poses = [dataclasses.replace(pose, yaw_rad=pose.yaw_rad + turned) for turned in headings]
    return min(share_of(motion, cells, one) for one in poses)


def grown(edge_m: float, growth_m: float) -> GrownCells:
    return GrownCells(marking(edge_m), np.full(len(marking(edge_m)), growth_m))


def test_a_turn_that_the_gate_would_stop_half_way_is_not_begun() -> None:
    """With the rear towards a marking, a corner would come nearer to it than the position
    permits."""
    cells = grown(0.70, 0.2)
    ignorant = decided(cells, BEHIND, AWAY, forbidden=kept_cells(SPEC, *_of(grown(0.70, 0.1))))
    assert ignorant.outcome is ControllerState.TURN  # control: by less than the gate asks for
    assert swept_share(cells, ignorant, BEHIND) == 0.0
    motion = decided(cells, BEHIND, AWAY)
    assert motion.outcome is not ControllerState.TURN and motion.twist != STANDSTILL
    assert share_of(motion, cells, BEHIND) > 0.0


def test_where_there_is_room_it_turns() -> None:
    cells = grown(0.95, 0.2)
    motion = decided(cells, BEHIND, AWAY)
    assert motion.outcome is ControllerState.TURN
    assert swept_share(cells, motion, BEHIND) > 0.0


@law(60)
@given(
    st.floats(0.4, 1.2), st.floats(0.03, 0.3), st.floats(-math.pi, math.pi), st.floats(-1.0, 1.0)
)
def test_what_it_commands_beside_uncertain_cells_the_gate_lets_pass(
    edge_m: float, growth_m: float, yaw_rad: float, y_m: float
) -> None:
    cells, pose = grown(edge_m, growth_m), Pose2(x_m=0.0, y_m=0.0, yaw_rad=yaw_rad)
    path = np.column_stack([np.linspace(0, 3, 31), np.linspace(0, y_m * min(edge_m, 1.0), 31)])
    assume(HUSKY.distances_m(pose.from_parent(cells.cells)).min() > growth_m + 0.05)
    motion = decided(cells, pose, path)
    assert motion.twist == STANDSTILL or share_of(motion, cells, pose) > 0.0


@pytest.mark.parametrize("as_one", [True, False], ids=["as one", "control"])
def test_within_the_growth_of_a_line_it_drives_along_as_the_gate_lets_it(as_one: bool) -> None:
    x = np.arange(-1.975, 2.0, 0.05)
    cells = np.column_stack([x, np.full(len(x), 0.475)])  # 14 cm beside the body
    objects = np.zeros(len(x), dtype=np.int64) if as_one else np.arange(len(x))
    line = GrownCells(cells, np.full(len(x), 0.25), objects)
    here = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    motion = decided(line, here, AWAY)
    if as_one:
        assert motion.outcome is ControllerState.FOLLOW and motion.twist.v_mps > 0.1
        assert share_of(motion, line, here) > 0.0
    else:
        assert motion.twist == STANDSTILL


def _of(cells: GrownCells) -> tuple[Points, np.ndarray]:
    return cells.cells, cells.growth_m


def test_cells_without_growth_keep_nothing_more() -> None:
    assert not kept_cells(SPEC, marking(0.7), np.zeros(len(marking(0.7)))).any()
    assert not kept_cells(SPEC, *_of(NO_CELLS)).any()


@pytest.mark.parametrize("at_m", [0.75, 1.0, 2.0])
def test_a_zone_is_kept_as_the_gate_does_or_as_far_as_the_robot_is(at_m: float) -> None:
    zone = Zone(id="z", name="z", polygon=((-1.0, at_m), (1.0, at_m), (1.0, 2.5), (-1.0, 2.5)))
    margins, place = ZoneMargins(HUSKY, safety_margin_m=0.15, frozen=True), both(0.15, 0.15)
    margins.follow((zone,), place)
    (near,) = margins.near((zone,), place, 3.0, 0.02)
    mask = kept_zones(SPEC, (near,))
    edge_m = float(SPEC.centres(np.argwhere(mask))[:, 1].min())
    grown_m = DEFAULT_SAFETY.keep_out.sigmas * 0.15
    kept_m = min(grown_m, at_m - HUSKY.width_m / 2)
    assert at_m - kept_m < edge_m < at_m - kept_m + 0.11
