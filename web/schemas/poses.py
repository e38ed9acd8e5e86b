"""Past poses as they may be put right."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from web.schemas.fields import Closed, Metres

MAX_POSES = 100_000
Angle = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-7.0, le=7.0)]


class NumberedPoseIn(Closed):
    """A pose that the map's points were seen from, T_map_base."""

    id: Annotated[int, Field(strict=True, ge=0, description="pose ID")]
    x_m: Metres
    y_m: Metres
    yaw_rad: Angle


class PosesIn(Closed):
    """Past poses as they are known by now; those that are not named stay."""

    poses: Annotated[list[NumberedPoseIn], Field(min_length=1, max_length=MAX_POSES)]
