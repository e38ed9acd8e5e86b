"""Messages of a page on the teleoperation websocket."""

from __future__ import annotations

from typing import Annotated, Literal

from web.schemas.fields import Closed, Name, number


class HeartbeatMessage(Closed):
    """Sign of life of a page."""

    type: Literal["here"]
    """Kind of the message."""


class StopMessage(Closed):
    """Emergency stop on the open connection, because opening another one could take long."""

    type: Literal["stop"]
    """Kind of the message."""
    by: Name = "console"
    """Means by which the operator stopped the robot."""


class DriveMessage(Closed):
    """Velocity that holds until the next message, for 0.25 s at most."""

    type: Literal["drive"]
    """Kind of the message."""
    v_mps: Annotated[float, number(-5.0, 5.0)]
    """Forward speed in metres per second."""
    w_radps: Annotated[float, number(-10.0, 10.0)]
    """Turn rate in radians per second, counter-clockwise."""
    t_ms: Annotated[float, number(0.0, 1e15)]
    """Time of sending by a monotonic clock of the page, milliseconds."""
