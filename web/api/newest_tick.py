"""The newest tick, for the routes that show or use the map and the camera image."""

from __future__ import annotations

from fastapi import HTTPException

from web.interface.operations import RobotService
from web.interface.snapshots import TickSnapshot


def newest_tick(operations: RobotService) -> TickSnapshot:
    """Return the values of the newest tick; answers 404 before the first."""
    tick = operations.newest_tick()
    if tick is None:
        raise HTTPException(404, "the camera has delivered no picture yet")
    return tick
