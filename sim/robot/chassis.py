"""The platforms that can be simulated."""

from __future__ import annotations

from navcore.errors import BadConfiguration
from navcore.robot.profile import RobotProfile
from sim.robot.husky import HUSKY_CHASSIS
from sim.robot.jackal import JACKAL_CHASSIS
from sim.robot.skid_steer import Chassis

CHASSIS: dict[str, Chassis] = {"husky": HUSKY_CHASSIS, "jackal": JACKAL_CHASSIS}
"""Chassis by the name of the robot profile."""


def chassis_for(robot: RobotProfile) -> Chassis:
    """Return the chassis of a platform; raises `BadConfiguration` for one that has no model."""
    if robot.name not in CHASSIS:
        known = ", ".join(CHASSIS)
        raise BadConfiguration(
            f"the simulator has no model of the robot {robot.name!r}, only of: {known}"
        )
    return CHASSIS[robot.name]
