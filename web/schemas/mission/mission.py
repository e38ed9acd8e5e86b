"""Goals and saved missions in requests and answers."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, Field, StrictBool

from navcore.mission.mission import Goal, Phase
from web.interface.drafts import GoalChanges
from web.interface.wire import DOCUMENTED
from web.schemas.fields import Changes, Closed, Label, Metres, Radians

GoalId = Annotated[int, Field(strict=True, ge=0, le=2**53)]


class GoalIn(Closed):
    """Goal position, with or without a heading."""

    x_m: Metres
    """x in metres of the map frame."""
    y_m: Metres
    """y in metres of the map frame."""
    yaw_rad: Radians | None = None
    """Heading at the goal in radians, counter-clockwise from x; null for any."""
    name: Label = ""
    """Name that the operator gave it."""


GoalPatchIn = Annotated[GoalChanges, Changes(GoalIn, optional=("yaw_rad",))]
"""Changed fields of a waiting goal; null removes the heading."""


class GoalOrderIn(Closed):
    """Order of the waiting goals."""

    ids: Annotated[list[GoalId], Field(max_length=1000)]
    """Ids of all waiting goals, in the new order."""


class LoopIn(Closed):
    """Repetition of the mission."""

    loop: StrictBool
    """Whether reached goals are queued again."""


class MissionOut(BaseModel):
    """Goals and phase of the mission."""

    model_config = DOCUMENTED

    phase: Phase
    """State of the mission as the operator asked for it."""
    queue: tuple[Goal, ...]
    """Goals to reach, the present one first."""
    reached: tuple[Goal, ...]
    """Last reached goals, oldest first; at most 20."""
    reached_count: int
    """Number of reached goals of the mission."""
    loop: bool
    """Whether reached goals are queued again."""


class SavedMissionOut(BaseModel):
    """Goals saved under a name."""

    model_config = DOCUMENTED

    name: str
    """Name of the saved mission."""
    goals: int
    """Number of goals."""
    loop: bool
    """Whether reached goals are queued again."""
