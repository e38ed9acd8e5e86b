"""The navigation core: from an RGB-D frame and the operator's rules to a velocity.

The names below are the public ones; they load on first use.

>>> import numpy as np
>>> import navcore
>>> blocked = np.zeros((5, 5), dtype=bool)
>>> blocked[1:4, 2] = True
>>> path = navcore.plan(blocked, (2, 0), (2, 4))
>>> isinstance(path, navcore.Path), round(path.length, 3)
(True, 6.828)
>>> navcore.plan(blocked, (2, 0), (2, 2)).reason
<Reason.GOAL_BLOCKED: 'goal blocked'>
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from navcore.config.navigator import NavigatorConfig as NavigatorConfig
    from navcore.geometry.camera import Intrinsics as Intrinsics
    from navcore.geometry.camera import back_project as back_project
    from navcore.geometry.transform import Pose2 as Pose2
    from navcore.geometry.transform import Twist as Twist
    from navcore.grid.grid import GridSpec as GridSpec
    from navcore.mission.beware_list import BewareList as BewareList
    from navcore.mission.order import NavigationRequest as NavigationRequest
    from navcore.mission.zone import Zone as Zone
    from navcore.navigator import Navigator as Navigator
    from navcore.perception.esanet import build as build_esanet
    from navcore.planning.path import NoPath as NoPath
    from navcore.planning.path import Path as Path
    from navcore.planning.path import Reason as Reason
    from navcore.planning.planner import plan as plan
    from navcore.robot.frame import Frame as Frame
    from navcore.robot.profile import RobotProfile as RobotProfile

_HOMES = {
    "BewareList": "navcore.mission.beware_list",
    "Frame": "navcore.robot.frame",
    "GridSpec": "navcore.grid.grid",
    "Intrinsics": "navcore.geometry.camera",
    "NavigationRequest": "navcore.mission.order",
    "Navigator": "navcore.navigator",
    "NavigatorConfig": "navcore.config.navigator",
    "NoPath": "navcore.planning.path",
    "Path": "navcore.planning.path",
    "Pose2": "navcore.geometry.transform",
    "Reason": "navcore.planning.path",
    "RobotProfile": "navcore.robot.profile",
    "Twist": "navcore.geometry.transform",
    "Zone": "navcore.mission.zone",
    "back_project": "navcore.geometry.camera",
    "build_esanet": "navcore.perception.esanet",
    "plan": "navcore.planning.planner",
}
_RENAMED = {"build_esanet": "build"}

__all__ = [
    "BewareList",
    "Frame",
    "GridSpec",
    "Intrinsics",
    "NavigationRequest",
    "Navigator",
    "NavigatorConfig",
    "NoPath",
    "Path",
    "Pose2",
    "Reason",
    "RobotProfile",
    "Twist",
    "Zone",
    "back_project",
    "build_esanet",
    "plan",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'navcore' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), _RENAMED.get(name, name))
