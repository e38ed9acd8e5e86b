"""Answer of the health check."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel

from web.interface.wire import DOCUMENTED


class HealthOut(BaseModel):
    """Sign of life of the console."""

    model_config = DOCUMENTED

    status: Literal["ok"] = "ok"
    """State of the console."""
    scenario: str
    """Name of the world, or of a real robot."""
    robot: str
    """Name of the platform."""
    frame_age_s: float | None
    """Age in seconds of the camera frame by which the motion was decided; null before the
    first."""
