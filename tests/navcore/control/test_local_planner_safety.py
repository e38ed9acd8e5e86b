"""No motion of the local planner, whatever is around, drives onto a cell or beyond a limit."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from navcore.control.motion import ControllerState, Motion
from navcore.control.motions.path_follower import candidates
from navcore.costmap.local_costmap import nearby
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.grid.grid import BoolGrid, OccupancyGrid
from navcore.robot.profile import HUSKY
from tests.navcore.control.planning import LOCAL, SPEC, decide, footprints, simulated, world
from tests.navcore.laws import law


def squares(mask: BoolGrid) -> npt.NDArray[np.object_]:
    """The marked cells as squares of the map frame."""
    x, y = SPEC.centres(np.argwhere(mask)).T
    return np.asarray(shapely.box(x - 0.05, y - 0.05, x + 0.05, y + 0.05))


def newly_touched(twist: Twist, pose: Pose2, mask: BoolGrid) -> int:
    """Cells outside the footprint now, that the motion drives onto; a cell so near that a corner of
    it may touch the body counts if the body comes nearer to its middle."""
    cells, centres = squares(mask), SPEC.centres(np.argwhere(mask))
    poses = simulated(twist, pose)
    bodies = footprints(poses)
    shapely.prepare(bodies)
    hits = shapely.intersects(bodies[:, None], cells[None, :])
    away_m = np.array([HUSKY.distances_m(one.from_parent(centres)) for one in poses])
    nearer = away_m.min(axis=0) < away_m[0] - 1e-4
    is_far = away_m[0] > SPEC.resolution_m * math.sqrt(0.5)
    return int((hits[1:].any(axis=0) & ~hits[0] & (is_far | nearer)).sum())


def decision_in(seed: int) -> tuple[Motion, Pose2, BoolGrid]:
    pose, geometric, forbidden, path, previous = world(seed)
    grid = OccupancyGrid(spec=SPEC, geometric=geometric, beware={}, zones=forbidden)
    motion = decide(
        geometric=nearby(geometric, grid, pose, 2.6),
        forbidden=nearby(forbidden, grid, pose, 2.6),
        path=path,
        previous=previous,
    )
    return motion, pose, geometric | forbidden


@pytest.mark.parametrize("batch", range(6))
def test_no_motion_drives_the_footprint_onto_a_cell_it_did_not_touch(batch: int) -> None:
    touched = {}
    for seed in range(200 * batch, 200 * (batch + 1)):
        motion, pose, mask = decision_in(seed)
        count = newly_touched(motion.twist, pose, mask)
        if count:
            touched[seed] = (count, motion.outcome.name, motion.twist)
    assert not touched


def test_what_is_driven_is_one_of_the_candidates_and_free_where_it_begins() -> None:
    driven = 0
    for seed in range(120):
        motion, pose, _ = decision_in(seed)
        if motion.outcome is not ControllerState.FOLLOW:
            assert motion.arc is None
            continue
        _, geometric, forbidden, _, _ = world(seed)
        grid = OccupancyGrid(spec=SPEC, geometric=geometric, beware={}, zones=forbidden)
        near = [nearby(mask, grid, pose, 2.6) for mask in (geometric, forbidden)]
        points, free = candidates(
            geometric=near[0],
            forbidden=near[1],
            profile=HUSKY,
            local=LOCAL,
            cell_m=0.1,
        )
        assert motion.arc is not None and free[motion.arc] > 0
        # The last point of an arc tells the side it bends to; the first lies too near.
        assert np.sign(motion.twist.w_radps) == np.sign(points[motion.arc, -1, 1].round(9))
        driven += 1
    assert driven > 20


def test_the_search_for_touched_cells_would_see_a_reckless_motion() -> None:
    """Control: full speed ahead in the same worlds touches cells, and the planner moves in most of
    the open ones."""
    reckless, moving, kinds = 0, 0, set()
    for seed in range(150):
        motion, pose, mask = decision_in(seed)
        reckless += newly_touched(Twist(v_mps=1.0, w_radps=0.0), pose, mask) > 0
        moving += motion.twist != STANDSTILL
        kinds.add(motion.outcome)
    assert reckless > 30
    assert moving > 50
    assert kinds >= {
        ControllerState.FOLLOW,
        ControllerState.TURN,
        ControllerState.BACK,
        ControllerState.BLOCKED,
    }


@law(200)
@given(st.integers(0, 2**32 - 1))
def test_every_twist_is_finite_and_within_the_platforms_limits(seed: int) -> None:
    twist = decision_in(seed)[0].twist
    assert -HUSKY.max_speed_mps <= twist.v_mps <= HUSKY.max_speed_mps
    assert abs(twist.w_radps) <= HUSKY.max_yaw_rate_radps
