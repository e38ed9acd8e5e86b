"""The newest frames as the safety gate sees them: checked, with the obstacles that they show."""

from __future__ import annotations

from navcore.config.safety import SensorMonitorConfig
from navcore.robot.frame import Frame
from navcore.robot.profile import RobotProfile
from navcore.safety.collision_monitor import RecentObstacles
from navcore.safety.sensor_monitor import SensorMonitor

Watched = tuple[SensorMonitor, RecentObstacles]
"""Check of the frames, and the obstacles that the plausible ones show."""


def watched_after(
    watched: Watched,
    newest: Frame,
    profile: RobotProfile,
    config: SensorMonitorConfig,
    *,
    now_ns: int,
) -> Watched:
    """Return what is known after one more frame; the same frame again changes nothing. `now_ns` as
    for `SensorMonitor.after`."""
    sensors, obstacles = watched
    if newest is sensors.newest:
        return watched
    sensors = sensors.after(newest, profile, config, now_ns=now_ns)
    if sensors.newest_is_trusted:
        repeats = sensors.repeats
        obstacles = obstacles.carried(newest) if repeats else obstacles.after(newest, profile)
    return sensors, obstacles
