"""What is only tried or pointed at: a place in the camera's picture, a draft of a goal or a zone."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StrictStr

from navcore.mission.zone import MAX_CORNERS
from web.interface.drafts import PreviewDraft, ZoneDraft
from web.schemas.fields import MAX_NAME, Closed, Corner, Metres, Share
from web.schemas.mission import GoalIn
from web.schemas.zones import ZoneIn


class PixelIn(Closed):
    """A place in the camera's picture, as shares of its width and height."""

    right: Share = Field(description="from the left edge, 0 to 1")
    down: Share = Field(description="from the upper edge, 0 to 1")


class PlaceIn(Closed):
    """A place on the map."""

    x_m: Metres
    y_m: Metres


class PreviewIn(Closed):
    """A draft: a goal, a zone, or both."""

    goal: GoalIn | None = Field(None, description="default: the present goal")
    start: PlaceIn | None = Field(None, description="default: where the robot stands")
    polygon: Annotated[list[Corner], Field(max_length=MAX_CORNERS + 1)] | None = Field(
        None, description="corners of a keep-out; `zone` says more"
    )
    zone: ZoneIn | None = Field(
        None, description="a zone as it would be stored; wins over `polygon`"
    )
    replaces: Annotated[StrictStr, Field(max_length=MAX_NAME)] | None = Field(
        None,
        description="id of the stored zone that the draft takes the place of, or that would be deleted",
    )

    def draft(self) -> PreviewDraft:
        """What is to be tried."""
        zone = None if self.zone is None else self.zone.draft()
        if zone is None and self.polygon is not None:
            zone = ZoneDraft(name="the draft", polygon=tuple(self.polygon))
        goal = None if self.goal is None else (self.goal.x_m, self.goal.y_m)
        start = None if self.start is None else (self.start.x_m, self.start.y_m)
        return PreviewDraft(goal=goal, start=start, zone=zone, replaces=self.replaces)
