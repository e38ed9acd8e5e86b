"""Goals as they may come in."""

from __future__ import annotations

from typing import Annotated, cast

from pydantic import Field, StrictBool

from web.interface.drafts import GoalChanges
from web.schemas.fields import Closed, Label, Metres, Radians

GoalId = Annotated[int, Field(strict=True, ge=0, le=2**53)]


class GoalIn(Closed):
    """A place the robot is to drive to."""

    x_m: Metres = Field(description="x in metres of the map frame")
    y_m: Metres = Field(description="y in metres of the map frame")
    yaw_rad: Radians | None = Field(
        None, description="heading to stand in, counter-clockwise from x; null for any"
    )
    name: Label = Field("", description="what the operator calls it")


class GoalPatchIn(Closed):
    """The fields of a waiting goal that change; null takes the heading away."""

    x_m: Metres | None = None
    y_m: Metres | None = None
    yaw_rad: Radians | None = None
    name: Label | None = None

    def changes(self) -> GoalChanges:
        """What was given."""
        given = self.model_dump(exclude_unset=True)
        return cast(
            "GoalChanges",
            {
                name: value
                for name, value in given.items()
                if value is not None or name == "yaw_rad"
            },
        )


class GoalOrderIn(Closed):
    """The ids of all waiting goals, in the order to drive to them."""

    ids: Annotated[list[GoalId], Field(max_length=1000)]


class LoopIn(Closed):
    """Whether goals that are reached wait again."""

    loop: StrictBool
