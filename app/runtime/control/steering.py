"""Decisions between two ticks: by the newest pose, on what the newest tick has seen.

Where the network takes long, a tick decides for where the robot was a good while ago, and its
command expires before the next one comes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

from app.runtime.control.tick_state import TickState
from navcore.geometry.transform import STANDSTILL, Twist
from navcore.mission.order import NavigationRequest
from navcore.navigator import Navigator, TickResult
from navcore.robot.driver import Command
from navcore.safety.sensor_monitor import SensorMonitor

OLDEST_S = 1.0
"""Age in seconds of what the newest tick has seen, at the newest pose, up to which the robot is
steered: it drives over no floor that no tick has seen, but the world may have changed."""


def steered(
    tick_state: TickState,
    navigator: Navigator,
    sensors: SensorMonitor,
    request: NavigationRequest,
    clock: Callable[[], int],
) -> TickState:
    """Return the outcome of a tick with the motion that is chosen again by the newest pose and
    velocity; the same one where it drives nowhere, is for another `request` than the present one,
    saw too long ago, or no newer pose can be believed."""
    last, newest = tick_state.decision, sensors.newest
    if (
        last is None
        or newest is None
        or tick_state.command is None
        or tick_state.request != request
        or not sensors.newest_is_trusted
    ):
        return tick_state
    later_s = (newest.stamp_ns - last.frame.stamp_ns) / 1e9
    if not 0.0 < later_s <= OLDEST_S:
        return tick_state
    decision = navigator.steer(last, newest.pose, newest.twist, later_s)
    if decision is None:
        return tick_state
    command = Command(twist=twist_of(decision, navigator), stamp_ns=clock())
    return dataclasses.replace(tick_state, decision=decision, command=command)


def twist_of(decision: TickResult, navigator: Navigator) -> Twist:
    """Return the twist of a decision; a standstill while a large correction waits for it."""
    return STANDSTILL if navigator.waits_for_standstill else decision.motion.twist
