"""Past poses in requests and answers."""

from __future__ import annotations

from typing import Annotated

from pydantic import BeforeValidator, Field

from web.schemas.fields import Closed, PoseIn, hand_over

MAX_POSES = 100_000
"""Largest number of corrected poses in a request."""
MAX_POSES_BYTES = 150 * MAX_POSES
"""Largest request in bytes: numbers of 17 digits."""


class NumberedPose(PoseIn):
    """Pose from which points of the map were observed, T_map_base."""

    id: Annotated[int, Field(strict=True, ge=0)]
    """Pose id."""


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
