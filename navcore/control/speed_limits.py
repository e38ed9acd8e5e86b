"""Speed limits of zones: the speed they allow now, and the travel time along a route."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence

import numpy as np
import shapely
from shapely.geometry import Polygon

from navcore.config.control import CONTROL_CONFIG, LocalPlannerConfig, SpeedLimitConfig
from navcore.control.motion import Motion
from navcore.geometry.arrays import Points
from navcore.geometry.transform import Pose2, Twist
from navcore.mission.zone import Zone, ZoneKind
from navcore.mission.zone_growth import area_of
from navcore.robot.profile import RobotProfile


def allowed_speed_mps(
    zones: Iterable[Zone],
    pose: Pose2,
    speed_mps: float,
    profile: RobotProfile,
    local: LocalPlannerConfig,
    config: SpeedLimitConfig = CONTROL_CONFIG.speed_limits,
) -> float:
    """Return the speed that brakes down to each limit before the footprint touches its zone, and
    keeps it there; inf without one.

    `speed_mps` is the present speed, with which the robot drives on until the wheels respond.
    """
    limits = [zone for zone in zones if _is_limit(zone)]
    if not limits:
        return math.inf
    body = Polygon(pose.to_parent(profile.footprint()))
    latency_m = abs(speed_mps) * config.latency_s
    return min(
        _braking_mps(zone, float(shapely.distance(body, area_of(zone))) - latency_m, local)
        for zone in limits
    )


def slowed(motion: Motion, allowed_mps: float) -> Motion:
    """Return the motion along the same arc, no faster than is allowed."""
    speed = abs(motion.twist.v_mps)
    if speed <= allowed_mps:
        return motion
    share = allowed_mps / speed
    return dataclasses.replace(
        motion, twist=Twist(v_mps=motion.twist.v_mps * share, w_radps=motion.twist.w_radps * share)
    )


def travel_time_s(
    points: Points,
    zones: Sequence[Zone],
    profile: RobotProfile,
) -> float:
    """Estimate the travel time in seconds along (N, 2) points in metres.

    It counts full speed, and each limit within its zone, so that of two paths under the same limits
    the longer one takes longer. Turns in place and waiting for people are not counted.
    """
    if len(points) < 2:
        return 0.0
    steps = np.diff(points, axis=0)
    speeds = np.full(len(steps), profile.max_speed_mps)
    middles = shapely.points(points[:-1] + steps / 2)
    for zone in zones:
        if _is_limit(zone):
            touched = shapely.dwithin(
                middles, area_of(zone), profile.circumscribed_radius_m + zone.margin_m
            )
            speeds[touched] = np.minimum(speeds[touched], _limit_mps(zone))
    return float((np.hypot(*steps.T) / speeds).sum())


def _is_limit(zone: Zone) -> bool:
    return zone.enabled and zone.kind is ZoneKind.SPEED_LIMIT


def _limit_mps(zone: Zone) -> float:
    assert zone.max_speed_mps is not None
    return zone.max_speed_mps


def _braking_mps(zone: Zone, distance_m: float, local: LocalPlannerConfig) -> float:
    return math.sqrt(
        _limit_mps(zone) ** 2 + 2 * local.braking_mps2 * max(distance_m - zone.margin_m, 0.0)
    )
