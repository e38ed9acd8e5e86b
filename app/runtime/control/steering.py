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
from app.runtime.control.watched_frames import Watched
from navcore.geometry.transform import STANDSTILL, Twist
from navcore.mission.order import NavigationRequest
from navcore.navigator import Navigator, TickResult
from navcore.robot.driver import Command
from navcore.robot.frame import Frame

OVERDUE = 2.0
"""Multiple of the time that the labels of the last frame took after which those of the next one are
overdue, and no decision is made without them."""
OLDEST_S = 1.0
"""Age in seconds of what the newest tick has seen, at the newest image, up to which the robot is
steered: it drives over no floor that no tick has seen, but the world may have changed."""


def may_steer(tick_state: TickState, newest: Frame) -> bool:
    """Return whether a frame is newer than that of the last decision, and the robot drives."""
    frame_ns = tick_state.frame_ns
    is_newer = frame_ns is None or newest.stamp_ns > frame_ns
    return is_newer and tick_state.command is not None


def steered(
    tick_state: TickState,
    navigator: Navigator,
    watched: Watched,
    request: NavigationRequest,
    clock: Callable[[], int],
) -> TickState:
    """Return the outcome of a tick with the motion that is chosen again by the newest of the
    `watched` images; the same one where it is for another `request` than the present one, saw too
    long ago, or that image cannot be believed."""
    sensors, obstacles = watched
    last, newest = tick_state.decision, sensors.newest
    if (
        last is None
        or newest is None
        or tick_state.request != request
        or not sensors.newest_is_trusted
    ):
        return tick_state
    later_s = (newest.stamp_ns - last.frame.stamp_ns) / 1e9
    if not 0.0 < later_s <= OLDEST_S:
        return tick_state
    decision = navigator.steer(newest, obstacles.all_points.astype(np.float64))
    if decision is None:
        return tick_state
    command = Command(twist=twist_of(decision, navigator), stamp_ns=clock())
    return dataclasses.replace(
        tick_state, decision=decision, frame_ns=newest.stamp_ns, command=command
    )


def twist_of(decision: TickResult, navigator: Navigator) -> Twist:
    """Return the twist of a decision; a standstill while a large correction waits for it."""
    return STANDSTILL if navigator.waits_for_standstill else decision.motion.twist
