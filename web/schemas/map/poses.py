"""Past poses in requests and answers."""

from __future__ import annotations

from typing import Annotated

from pydantic import BeforeValidator, Field

from web.schemas.fields import Closed, Metres, hand_over, number

MAX_POSES = 100_000
"""Largest number of corrected poses in a request."""
MAX_POSES_BYTES = 150 * MAX_POSES
"""Largest request in bytes: numbers of 17 digits."""


class NumberedPose(Closed):
    """Pose from which points of the map were observed, T_map_base."""

    id: Annotated[int, Field(strict=True, ge=0)]
    """Pose id."""
    x_m: Metres
    """x in metres of the map frame."""
    y_m: Metres
    """y in metres of the map frame."""
    yaw_rad: Annotated[float, number(-7.0, 7.0)]
    """Heading in radians, counter-clockwise from x."""


class PosesIn(Closed):
    """Corrected poses; the others stay."""

    poses: Annotated[
        list[Annotated[NumberedPose, BeforeValidator(hand_over)]],
        Field(min_length=1, max_length=MAX_POSES),
    ]
    """Corrected poses in any order."""


class PosesOut(Closed):
    """All poses from which the map was observed."""

    poses: list[NumberedPose]
    """Poses in the order of their ids."""
