"""From the path to a velocity: motion primitives, scored against what stands near, with the robot's oriented footprint.

The primitives are arcs of constant curvature that start at the robot, forward and backward, and turning in place. A primitive
is driven only as far as the padded footprint stays clear of every occupied cell along it; zones and beware points count like
walls.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cache

import numba
import numpy as np
import numpy.typing as npt

from navcore.grid import OccupancyGrid, inflate, inflation_radius
from navcore.robot import STANDSTILL, RobotProfile, Twist
from navcore.settings import between
from navcore.transform import Pose2, wrap_angle

Points = npt.NDArray[np.float64]


class Outcome(StrEnum):
    """What the local planner decided."""

    FOLLOW = "following the path"
    TURN = "turning in place"
    BACK = "backing off"
    ARRIVED = "arrived"
    IDLE = "no path to follow"
    BOXED_IN = "boxed in: no motion keeps clear of what stands near"
    IN_ZONE = "standing in a beware area"


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalRules:
    """How the local planner moves."""

    padding_m: float = between(0.0, 0.5, default=0.05)
    """Room kept around the footprint wherever the robot has it."""
    lookahead_m: float = between(0.2, 3.0, default=0.8)
    """How far ahead on the path the robot aims."""
    arrival_m: float = between(0.02, 0.3, default=0.12)
    """A goal this near is reached."""
    braking_mps2: float = between(0.1, 5.0, default=0.8)
    """Deceleration that speeds are planned with; the platform brakes harder."""
    turn_from_deg: float = between(10.0, 170.0, default=50.0)
    """Turn in place when the path leads off by more than this …"""
    turn_until_deg: float = between(1.0, 60.0, default=12.0)
    """… and go on turning until it is less than this."""
    turn_rate_radps: float = between(0.1, 2.0, default=0.9)
    """Largest yaw rate when turning in place."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """What to do until the next frame."""

    twist: Twist
    """Velocity to command."""
    outcome: Outcome
    """Why."""


IDLE = Motion(twist=STANDSTILL, outcome=Outcome.IDLE)


def hard_cells(grid: OccupancyGrid) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """(rows, cols) masks: geometric cells, and cells of beware classes and zones, grown by their own margins."""
    ruled = grid.zones.copy()
    for class_id, layer in grid.beware.items():
        ruled |= _grown(layer, grid.margins_m.get(class_id, 0.0), grid.spec.resolution_m)
    for margin_m, mask in grid.wide_zones:
        ruled |= _grown(mask, margin_m, grid.spec.resolution_m)
    return grid.geometric, ruled


def nearby(mask: npt.NDArray[np.bool_], grid: OccupancyGrid, pose: Pose2, reach_m: float) -> Points:
    """(N, 2) centres of marked cells within a square of `reach_m` around the robot, in the base frame."""
    row, col = grid.spec.cell(pose.x_m, pose.y_m)
    reach = math.ceil(reach_m / grid.spec.resolution_m)
    top, left = max(row - reach, 0), max(col - reach, 0)
    cells = np.argwhere(mask[top : max(row + reach + 1, 0), left : max(col + reach + 1, 0)])
    centres = grid.spec.centres(cells + np.array([top, left])) - np.array([pose.x_m, pose.y_m])
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return np.ascontiguousarray(centres @ np.array([[cos, -sin], [sin, cos]]))


def plan_motion(
    *,
    geometric: Points,
    ruled: Points,
    path_base: Points,
    previous: Motion,
    profile: RobotProfile,
    rules: LocalRules,
    cell_m: float,
) -> Motion:
    """The motion that follows the path best without touching anything.

    `geometric` and `ruled` are (N, 2) obstacle cells near the robot in the base frame, `path_base` is the (N, 2) path in the
    base frame, first point nearest the robot, last point the goal. `cell_m` is the side of a cell: obstacles reach half a cell
    further than their centre.
    """
    goal_m = float(np.hypot(*path_base[-1]))
    if goal_m <= rules.arrival_m:
        return Motion(twist=STANDSTILL, outcome=Outcome.ARRIVED)
    half_cell = cell_m / 2
    # The robot is where it is: a geometric cell inside its body is noise. A rule of the operator is never noise.
    geometric = geometric[_outside(geometric, profile, -half_cell)]
    if not _outside(ruled, profile, -half_cell).all():
        return Motion(twist=STANDSTILL, outcome=Outcome.IN_ZONE)
    obstacles = np.vstack([geometric, ruled])
    carrot = _carrot(path_base, rules.lookahead_m)
    bearing = math.atan2(carrot[1], carrot[0])
    turning = previous.outcome is Outcome.TURN
    if abs(bearing) > math.radians(rules.turn_until_deg if turning else rules.turn_from_deg):
        turn = _turn(obstacles, bearing, profile, rules, half_cell)
        if turn is not None:
            return turn
    return _follow(obstacles, path_base, carrot, profile, rules, half_cell) or _back_off(obstacles, profile, rules, half_cell)


def _follow(
    obstacles: Points, path_base: Points, carrot: Points, profile: RobotProfile, rules: LocalRules, half_cell: float
) -> Motion | None:
    """Drive the arc that comes nearest to the carrot; None when every arc is blocked at once."""
    curvatures, poses = _arcs()
    clear = _clearances(obstacles, poses, profile.length_m / 2, profile.width_m / 2) - half_cell
    padding = _padding(obstacles, profile, rules, half_cell)
    free = clear > padding
    to_carrot = np.hypot(poses[:, :, 0] - carrot[0], poses[:, :, 1] - carrot[1])
    heading = np.abs(_wrap(poses[:, :, 2] - _direction(path_base, rules.lookahead_m)))
    cost = to_carrot + 0.2 * heading + 0.6 * np.maximum(0.0, 0.25 - clear) + 0.02 * np.abs(curvatures)[:, None]
    cost = np.where(free, cost, np.inf)
    arc, step = np.unravel_index(int(np.argmin(cost)), cost.shape)
    start = float(np.hypot(*carrot))
    if not np.isfinite(cost[arc, step]) or to_carrot[arc, step] > start - min(0.1, 0.5 * start):
        return None
    free_m = ARC_STEP_M * float(free[arc].sum())
    goal_m = float(np.hypot(*path_base[-1]))
    # free_m ends where the padding would be touched; the padding itself is what is left after braking.
    speed = min(
        profile.max_speed_mps,
        math.sqrt(2 * rules.braking_mps2 * max(free_m - ARC_STEP_M, 0.02)),
        math.sqrt(2 * 0.5 * rules.braking_mps2 * goal_m) + 0.02,
        0.3 + 2.0 * float(clear[arc, : step + 1].min()),
        0.9 / max(abs(float(curvatures[arc])), 1e-6),
    )
    return Motion(twist=Twist(v_mps=speed, w_radps=speed * float(curvatures[arc])), outcome=Outcome.FOLLOW)


def _turn(obstacles: Points, bearing: float, profile: RobotProfile, rules: LocalRules, half_cell: float) -> Motion | None:
    """Turn in place towards the bearing, the long way round if the short one is blocked; None when neither is free."""
    padding = _padding(obstacles, profile, rules, half_cell)
    for angle in (bearing, bearing - math.copysign(2 * math.pi, bearing)):
        headings = np.linspace(0.0, angle, max(2, math.ceil(abs(angle) / math.radians(4.0))))
        poses = np.zeros((1, len(headings), 3))
        poses[0, :, 2] = headings
        clear = _clearances(obstacles, poses, profile.length_m / 2, profile.width_m / 2) - half_cell
        # Turning sweeps the corners past what stands beside the robot; half the padding is enough where it barely moves.
        if (clear > padding / 2).all():
            rate = min(rules.turn_rate_radps, 0.15 + 1.5 * abs(angle))
            return Motion(twist=Twist(v_mps=0.0, w_radps=math.copysign(rate, angle)), outcome=Outcome.TURN)
    return None


def _back_off(obstacles: Points, profile: RobotProfile, rules: LocalRules, half_cell: float) -> Motion:
    """Reverse along the clearest arc, slowly; nothing behind is seen, so only the map and the recent past vouch for it."""
    curvatures, poses = _arcs()
    behind = poses[:, : BACK_STEPS + 1] * np.array([-1.0, 1.0, -1.0])
    clear = _clearances(obstacles, behind, profile.length_m / 2, profile.width_m / 2) - half_cell
    reach = (clear > _padding(obstacles, profile, rules, half_cell)).sum(axis=1)
    arc = int(np.argmax(reach - 0.1 * np.abs(curvatures)))
    if reach[arc] <= BACK_STEPS // 2:
        return Motion(twist=STANDSTILL, outcome=Outcome.BOXED_IN)
    return Motion(twist=Twist(v_mps=-0.2, w_radps=0.2 * float(curvatures[arc])), outcome=Outcome.BACK)


ARC_STEP_M = 0.08
ARC_STEPS = 20
BACK_STEPS = 5


@cache
def _arcs() -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """(A,) curvatures in 1/m and (A, S, 3) poses (x, y, heading) along them in the base frame, from one step on."""
    spread = np.linspace(-1.0, 1.0, 41)
    curvatures = 3.0 * spread * np.abs(spread)
    along = ARC_STEP_M * np.arange(1, ARC_STEPS + 1)
    heading = curvatures[:, None] * along[None, :]
    safe = np.where(curvatures == 0, 1.0, curvatures)[:, None]
    x = np.where(curvatures[:, None] == 0, along[None, :], np.sin(heading) / safe)
    y = np.where(curvatures[:, None] == 0, 0.0, (1 - np.cos(heading)) / safe)
    return curvatures, np.stack([x, y, heading], axis=2)


def _padding(obstacles: Points, profile: RobotProfile, rules: LocalRules, half_cell: float) -> float:
    """The padding asked for, or what the robot has where it stands: it may leave a tight place but not get tighter."""
    here = _clearances(obstacles, np.zeros((1, 1, 3)), profile.length_m / 2, profile.width_m / 2)[0, 0] - half_cell
    return float(np.clip(here - 0.01, 0.0, rules.padding_m))


def _carrot(path_base: Points, lookahead_m: float) -> Points:
    """(2,) the point of the path that lies `lookahead_m` further along it, or its end."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path_base, axis=0).T))])
    return np.asarray(path_base[min(int(np.searchsorted(along, lookahead_m)), len(path_base) - 1)])


def _direction(path_base: Points, lookahead_m: float) -> float:
    """Heading of the path at the carrot."""
    ahead, here = _carrot(path_base, lookahead_m + 0.3), _carrot(path_base, lookahead_m - 0.3)
    step = ahead - here
    return math.atan2(step[1], step[0]) if np.any(step) else math.atan2(ahead[1], ahead[0])


def _outside(points: Points, profile: RobotProfile, padding_m: float) -> npt.NDArray[np.bool_]:
    """(N,) points outside the footprint grown by the padding, or shrunk where it is negative."""
    return np.asarray(
        (np.abs(points[:, 0]) > profile.length_m / 2 + padding_m) | (np.abs(points[:, 1]) > profile.width_m / 2 + padding_m)
    )


def _wrap(angles: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return np.asarray((angles + np.pi) % (2 * np.pi) - np.pi)


def _grown(mask: npt.NDArray[np.bool_], margin_m: float, resolution_m: float) -> npt.NDArray[np.bool_]:
    if margin_m <= 0:
        return mask
    return inflate(mask, inflation_radius(vehicle_width_m=0.0, safety_margin_m=margin_m, resolution_m=resolution_m))


@numba.njit(cache=True, nogil=True)
def _clearances(
    obstacles: npt.NDArray[np.float64], poses: npt.NDArray[np.float64], half_length: float, half_width: float
) -> npt.NDArray[np.float64]:
    """(A, S) least distance from the footprint to any obstacle point on the way to each pose, at most 1 m."""
    arcs, steps = poses.shape[0], poses.shape[1]
    clear = np.empty((arcs, steps))
    for a in range(arcs):
        least = 1.0
        for s in range(steps):
            cos, sin = math.cos(poses[a, s, 2]), math.sin(poses[a, s, 2])
            for k in range(len(obstacles)):
                dx, dy = obstacles[k, 0] - poses[a, s, 0], obstacles[k, 1] - poses[a, s, 1]
                out_x = max(abs(cos * dx + sin * dy) - half_length, 0.0)
                out_y = max(abs(cos * dy - sin * dx) - half_width, 0.0)
                if out_x < least and out_y < least:
                    least = min(least, math.sqrt(out_x * out_x + out_y * out_y))
            clear[a, s] = least
    return clear


def path_from(path_map: Points, pose: Pose2) -> Points:
    """(N, 2) the path from its point nearest to the robot on, in the base frame."""
    nearest = int(np.argmin(np.hypot(path_map[:, 0] - pose.x_m, path_map[:, 1] - pose.y_m)))
    offset = path_map[nearest:] - np.array([pose.x_m, pose.y_m])
    yaw = wrap_angle(pose.yaw_rad)
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.asarray(offset @ np.array([[cos, -sin], [sin, cos]]))
