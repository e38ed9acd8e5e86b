"""Messages of a page on the teleoperation websocket."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict

from web.interface.wire import DOCUMENTED
from web.schemas.fields import MAX_NAME, Closed, number


class HeartbeatMessage(Closed):
    """Sign of life of a page."""

    type: Literal["here"]
    """Kind of the message."""


class StopMessage(BaseModel):
    """Emergency stop on the open connection, because opening another one could take long. It is
    refused for nothing else that it says."""

    model_config = DOCUMENTED | ConfigDict(frozen=True)

    type: Literal["stop"]
    """Kind of the message."""
    by: Any = None
    """Means by which the operator stopped the robot, see `stop_label`."""


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


def stop_label(by: object, otherwise: str) -> str:
    """Return the means by which an operator stopped the robot as it is shown and logged: at most
    `MAX_NAME` printable characters, `otherwise` without any. No label refuses a stop."""
    return by[:MAX_NAME] if isinstance(by, str) and by.isprintable() and by.strip() else otherwise
