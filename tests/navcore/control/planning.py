"""One decision of the local planner, and what its motion would touch."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt
import shapely

from navcore.config.control import LocalPlannerConfig
from navcore.control.collision.collision_checker import COMMAND_LIFE_S
from navcore.control.local_planner import LocalPlannerInput, compute_velocity
from navcore.control.motion import IDLE, ControllerState, Motion
from navcore.control.people.people_state import NO_PEOPLE, PeopleState
from navcore.geometry.arrays import Points
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.robot.profile import HUSKY, RobotProfile

SPEC = GridSpec.centred(size_m=(6.0, 6.0), resolution_m=0.1)
LOCAL = LocalPlannerConfig()
NONE: Points = np.empty((0, 2))
AHEAD: Points = np.column_stack([np.linspace(0, 3, 31), np.zeros(31)])
ORIGIN = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
TURNING = Motion(twist=STANDSTILL, outcome=ControllerState.TURN)


def decide(
    *,
    geometric: Points = NONE,
    forbidden: Points = NONE,
    unseen: Points = NONE,
    path: Points = AHEAD,
    previous: Motion = IDLE,
    local: LocalPlannerConfig = LOCAL,
    people: PeopleState = NO_PEOPLE,
    goal_yaw_rad: float | None = None,
    ignore_predictions: bool = False,
    pose: Pose2 = ORIGIN,
    twist: Twist = STANDSTILL,
    retreat: Points | None = None,
    leaves_lane: bool = False,
    expects_return: bool = False,
    is_cautious: bool = False,
    people_cells: Points = NONE,
    profile: RobotProfile = HUSKY,
) -> Motion:
    """A decision, by default at the map's origin, where the base frame is the map frame."""
    return compute_velocity(
        LocalPlannerInput(
            geometric=geometric,
            forbidden=forbidden,
            unseen=unseen,
            cell_m=0.1,
            path=path,
            pose=pose,
            twist=twist,
            previous=previous,
            profile=profile,
            local=local,
            people=dataclasses.replace(
                people,
                expectations=dataclasses.replace(
                    people.expectations,
                    ignore_predictions=ignore_predictions,
                    leaves_lane=leaves_lane,
                    expects_return=expects_return,
                    is_cautious=is_cautious,
                ),
            ),
            goal_yaw_rad=goal_yaw_rad,
            retreat=retreat,
            people_cells=people_cells,
        )
    )


def stands(motion: Motion, outcome: ControllerState) -> bool:
    return motion.twist == STANDSTILL and motion.outcome is outcome


def simulated(twist: Twist, start: Pose2) -> list[Pose2]:
    """Where the robot comes by when the twist is held until it expires and the wheels then brake
    along the same arc."""
    step_s, pose, poses = 0.005, start, [start]
    share, elapsed = 1.0, 0.0
    fade = max(
        abs(twist.v_mps) / HUSKY.max_accel_mps2,
        abs(twist.w_radps) / HUSKY.max_yaw_accel_radps2,
        1e-9,
    )
    while share > 0:
        turn = twist.w_radps * share * step_s
        pose = pose @ Pose2(x_m=0, y_m=0, yaw_rad=turn / 2)
        pose = (
            pose
            @ Pose2(x_m=twist.v_mps * share * step_s, y_m=0, yaw_rad=0)
            @ Pose2(x_m=0, y_m=0, yaw_rad=turn / 2)
        )
        poses.append(pose)
        elapsed += step_s
        if elapsed > COMMAND_LIFE_S:
            share -= step_s / fade
    return poses


def footprints(poses: list[Pose2]) -> npt.NDArray[np.object_]:
    """The oriented body at each pose, less a tenth of a millimetre of rounding."""
    corners = HUSKY.footprint(-1e-4)
    turned = [
        corners
        @ np.array(
            [
                [math.cos(p.yaw_rad), math.sin(p.yaw_rad)],
                [-math.sin(p.yaw_rad), math.cos(p.yaw_rad)],
            ]
        )
        + [p.x_m, p.y_m]
        for p in poses
    ]
    return np.asarray(shapely.polygons(np.array(turned)))


def world(seed: int) -> tuple[Pose2, BoolGrid, BoolGrid, Points, Motion]:
    """A robot somewhere among cells that do not touch it (a few may), tight or wide, with a path
    anywhere."""
    rng = np.random.default_rng(seed)
    pose = Pose2(
        x_m=rng.uniform(-0.3, 0.3),
        y_m=rng.uniform(-0.3, 0.3),
        yaw_rad=rng.uniform(-math.pi, math.pi),
    )
    mask = rng.random((SPEC.rows, SPEC.cols)) < rng.choice([0.005, 0.02, 0.05, 0.15, 0.4])
    x, y = SPEC.centres(np.argwhere(np.ones_like(mask))).T
    gap_m = rng.choice([0.001, 0.02, 0.06, 0.12, 0.25])
    body = shapely.buffer(footprints([pose])[0], gap_m)
    shapely.prepare(body)
    touching = shapely.intersects(
        body, shapely.box(x - 0.05, y - 0.05, x + 0.05, y + 0.05)
    ).reshape(mask.shape)
    mask &= ~touching
    if rng.random() < 0.15:
        mask |= touching & (rng.random(mask.shape) < 0.02)
    forbidden = mask & (rng.random(mask.shape) < 0.5)
    bearing, length = rng.uniform(-math.pi, math.pi), rng.uniform(0.3, 3.0)
    if rng.random() < 0.6:
        bearing *= 0.2
    along = np.linspace(0, length, 30)
    path = np.column_stack(
        [along * math.cos(bearing), along * math.sin(bearing) + rng.uniform(-0.3, 0.3) * along**2]
    )
    return pose, mask & ~forbidden, forbidden, path, TURNING if rng.random() < 0.3 else IDLE


def ring(reach_x: float, reach_y: float) -> Points:
    x, y = np.arange(-reach_x, reach_x + 0.01, 0.05), np.arange(-reach_y, reach_y + 0.01, 0.05)
    return np.vstack(
        [
            *([[v, s * reach_y] for v in x] for s in (-1, 1)),
            *([[s * reach_x, v] for v in y] for s in (-1, 1)),
        ]
    )
