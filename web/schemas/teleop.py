"""What a page says while it holds the robot by the hand."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from web.schemas.fields import Closed, Name


class HeartbeatMessage(Closed):
    """A page says that it is still there."""

    type: Literal["here"]


class StopMessage(Closed):
    """The emergency stop, on the connection that is open already: a new one may be long in coming."""

    type: Literal["stop"]
    by: Name = "console"


class DriveMessage(Closed):
    """A page's hand is on the robot: how fast it is to go until it hears more, 0.25 s at most."""

    type: Literal["drive"]
    v_mps: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-5.0, le=5.0)]
    w_radps: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-10.0, le=10.0)]
    t_ms: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e15)] = Field(
        description="when it was sent, by a clock of the page that only goes forward"
    )
