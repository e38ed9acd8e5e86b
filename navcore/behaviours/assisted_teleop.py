"""Assisted teleoperation: a velocity given by hand may not drive into a forbidden area."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from navcore.config.behaviours import TeleopConfig
from navcore.config.safety import DEFAULT_SAFETY
from navcore.costmap.costmap import Costmap, box_around
from navcore.costmap.local_costmap import split_areas
from navcore.geometry.kinematics import arc_position
from navcore.geometry.transform import Pose2, Twist
from navcore.grid.grid import GridSpec, OccupancyGrid
from navcore.mission.zone import Zone
from navcore.robot.profile import RobotProfile
from navcore.safety.collision_monitor import braking_s

_DEFAULT = TeleopConfig()


def stays_out(
    twist: Twist,
    pose: Pose2,
    profile: RobotProfile,
    *,
    zones: Sequence[Zone],
    spec: GridSpec,
    seen: Costmap | None,
    config: TeleopConfig = _DEFAULT,
) -> bool:
    """Return whether the robot, driving at a velocity and then braking, covers no more of any
    forbidden area than it covers now.

    A robot that stands in an area may thus be driven out of it, and not farther in, nor over an
    object or another zone inside of it. `zones` are the operator's present ones; `seen`, a costmap
    over `spec`, holds what is known of the beware list, None for nothing.
    """
    until_s = (
        DEFAULT_SAFETY.collision.reaction_s + config.pose_age_s + braking_s(twist, profile) / 2
    )
    reach_m = (
        profile.circumscribed_radius_m
        + abs(twist.v_mps) * until_s
        + max((zone.margin_m for zone in zones), default=0.0)
    )
    grid = (
        _nothing(spec.part(*box_around(spec, pose, reach_m)))
        if seen is None
        else seen.around(pose, reach_m)
    )
    under, others = split_areas(grid, zones, profile, pose)
    steps = math.ceil(until_s / config.step_s)
    poses = [pose @ _after(twist, until_s * step / steps) for step in range(1, steps + 1)]
    for area in (*under, others):
        if area.any():
            covered = _covered(area, grid.spec, pose, profile)
            if any(_covered(area, grid.spec, later, profile) > covered for later in poses):
                return False
    return True


def _nothing(spec: GridSpec) -> OccupancyGrid:
    """An occupancy grid without obstacles."""
    empty = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
    return OccupancyGrid(spec=spec, geometric=empty, beware={}, zones=empty)


def _after(twist: Twist, t_s: float) -> Pose2:
    """The pose on an arc from the origin after some seconds."""
    x_m, y_m = arc_position(float(twist.v_mps), float(twist.w_radps), t_s)
    return Pose2(x_m=x_m, y_m=y_m, yaw_rad=twist.w_radps * t_s)


def _covered(
    forbidden: npt.NDArray[np.bool_], spec: GridSpec, pose: Pose2, profile: RobotProfile
) -> int:
    """Number of footprint points, half a cell apart, on forbidden cells."""
    body = _body(profile.length_m, profile.width_m, spec.resolution_m / 2)
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    x = pose.x_m + cos * body[:, 0] - sin * body[:, 1]
    y = pose.y_m + sin * body[:, 0] + cos * body[:, 1]
    col = np.floor((x - spec.origin_x_m) / spec.resolution_m).astype(np.int64)
    row = np.floor((y - spec.origin_y_m) / spec.resolution_m).astype(np.int64)
    inside = (row >= 0) & (row < spec.rows) & (col >= 0) & (col < spec.cols)
    return int(np.count_nonzero(forbidden[row[inside], col[inside]]))


@lru_cache(maxsize=4)
def _body(length_m: float, width_m: float, step_m: float) -> npt.NDArray[np.float64]:
    """(N, 2) points all over the footprint in metres of the base frame."""
    x = np.linspace(-length_m / 2, length_m / 2, math.ceil(length_m / step_m) + 1)
    y = np.linspace(-width_m / 2, width_m / 2, math.ceil(width_m / step_m) + 1)
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    points.flags.writeable = False
    return points
