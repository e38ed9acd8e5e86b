"""Decisions between two ticks: by the newest image, whose labels are not made yet, on the map of
the newest tick.

A tick decides for where the robot was when its image was taken, which is older by the time that the
labels take; with a slow network its command would expire before the next one comes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from app.runtime.control.tick_state import TickState
from navcore.geometry.transform import STANDSTILL, Twist
from navcore.mission.order import NavigationRequest
from navcore.navigator import Navigator, TickResult
from navcore.robot.driver import Command
from navcore.safety.collision_monitor import RecentObstacles
from navcore.safety.sensor_monitor import SensorMonitor

OVERDUE = 2.0
"""Multiple of the time that the labels of the last frame took after which those of the next one are
overdue, and no decision is made without them."""
OLDEST_S = 1.0
"""Age in seconds of what the newest tick has seen, at the newest image, up to which the robot is
steered: it drives over no floor that no tick has seen, but the world may have changed."""


def steered(
    tick_state: TickState,
    navigator: Navigator,
    sensors: SensorMonitor,
    obstacles: RecentObstacles,
    request: NavigationRequest,
    clock: Callable[[], int],
) -> TickState:
    """Return the outcome of a tick with the motion that is chosen again by the newest image, which
    `sensors` has checked and whose `obstacles` the safety gate has found; the same one where it
    drives nowhere, is for another `request` than the present one, saw too long ago, or there is no
    newer image that can be believed."""
    last, newest = tick_state.decision, sensors.newest
    if (
        last is None
        or newest is None
        or tick_state.command is None
        or tick_state.request != request
        or not sensors.newest_is_trusted
        or sensors.repeats
    ):
        return tick_state
    later_s = (newest.stamp_ns - last.frame.stamp_ns) / 1e9
    is_newer = tick_state.frame_ns is None or newest.stamp_ns > tick_state.frame_ns
    if not is_newer or not 0.0 < later_s <= OLDEST_S:
        return tick_state
    decision = navigator.steer(last, newest, obstacles.all_points.astype(np.float64))
    if decision is None:
        return tick_state
    command = Command(twist=twist_of(decision, navigator), stamp_ns=clock())
    return dataclasses.replace(
        tick_state, decision=decision, frame_ns=newest.stamp_ns, command=command
    )


def twist_of(decision: TickResult, navigator: Navigator) -> Twist:
    """Return the twist of a decision; a standstill while a large correction waits for it."""
    return STANDSTILL if navigator.waits_for_standstill else decision.motion.twist
