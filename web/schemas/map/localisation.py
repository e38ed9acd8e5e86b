"""Place of the robot in requests."""

from __future__ import annotations

from typing import Annotated

from web.schemas.fields import Closed, Metres, number


class PoseIn(Closed):
    """Where an operator says the robot is, T_map_base."""

    x_m: Metres
    """x in metres of the map frame."""
    y_m: Metres
    """y in metres of the map frame."""
    yaw_rad: Annotated[float, number(-7.0, 7.0)]
    """Heading in radians, counter-clockwise from x."""
