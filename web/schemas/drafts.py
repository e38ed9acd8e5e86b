"""Previews and positions in the camera image, in requests and answers."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, Field, StrictStr

from navcore.mission.zone import MAX_CORNERS
from navcore.planning.path import NoPath
from web.interface.drafts import PathPreview, PreviewDraft, ZoneDraft
from web.interface.wire import DOCUMENTED, Position, polyline
from web.schemas.fields import MAX_NAME, Closed, Corner, Metres, Share, UnknownPrice
from web.schemas.mission.mission import GoalIn
from web.schemas.zones import ZoneIn


class ClickIn(Closed):
    """Click into the camera image."""

    right: Share
    """Distance from the left edge as a share of the width, 0 to 1."""
    down: Share
    """Distance from the upper edge as a share of the height, 0 to 1."""
    frame: Annotated[StrictStr, Field(max_length=32)] | None = None
    """Name of the image, from its header `Frame` or from a look; null for the newest one."""


class PlaceIn(Closed):
    """Position on the map."""

    x_m: Metres
    """x in metres of the map frame."""
    y_m: Metres
    """y in metres of the map frame."""


class PreviewIn(Closed):
    """Draft of a goal, of a zone, of a setting, or of several."""

    goal: GoalIn | None = None
    """Goal; null for the present one."""
    start: PlaceIn | None = None
    """Start of the path; null for the robot's position."""
    polygon: Annotated[list[Corner], Field(max_length=MAX_CORNERS + 1)] | None = None
    """Corners of a keep-out zone in metres of the map frame; `zone` can say more."""
    zone: ZoneIn | None = None
    """Zone as it would be stored; takes precedence over `polygon`."""
    replaces: Annotated[StrictStr, Field(max_length=MAX_NAME)] | None = None
    """Id of the stored zone that the draft replaces, or that is to be deleted."""
    unknown_price: UnknownPrice | None = None
    """Cost of a metre of unseen floor in metres of seen floor; null for the one in force."""

    def draft(self) -> PreviewDraft:
        """Return the draft."""
        zone = None if self.zone is None else self.zone.draft()
        if zone is None and self.polygon is not None:
            zone = ZoneDraft(name="the draft", polygon=tuple(self.polygon))
        goal = None if self.goal is None else (self.goal.x_m, self.goal.y_m)
        start = None if self.start is None else (self.start.x_m, self.start.y_m)
        return PreviewDraft(
            goal=goal,
            start=start,
            zone=zone,
            replaces=self.replaces,
            unknown_price=self.unknown_price,
        )


class PathPreviewOut(BaseModel):
    """Path that would be driven."""

    model_config = DOCUMENTED

    found: bool
    """Whether there would be a path."""
    length_m: float | None
    """Length of the path in metres; null without one."""
    time_s: float | None
    """Estimated travel time in seconds; null without a path."""
    unseen_m: float | None
    """Length of the path over floor that was not seen yet, metres; null without a path."""
    path: list[Position]
    """Points (x, y) of the path in metres of the map frame."""

    @staticmethod
    def of(preview: PathPreview) -> PathPreviewOut:
        """Return the answer for a path."""
        return PathPreviewOut(
            found=not isinstance(preview.outcome, NoPath),
            length_m=preview.length_m,
            time_s=preview.time_s,
            unseen_m=preview.unseen_m,
            path=polyline(preview.points),
        )


def difference(new: float | None, old: float | None) -> float | None:
    """Return how much more one value is than another; None when one is missing."""
    return None if new is None or old is None else round(new - old, 3)


class PreviewOut(PathPreviewOut):
    """Effect of a draft."""

    model_config = DOCUMENTED

    reason: str | None
    """Reason why there would be no path; null when there would be one."""
    cut_by: tuple[str, ...]
    """Names of the zones that cut the goal off."""
    present: PathPreviewOut | None
    """Path without the draft; null without a goal."""
    change_m: float | None
    """Additional length of the path in metres; null when one of the paths is missing."""
    change_s: float | None
    """Additional travel time in seconds; null when one of the paths is missing."""


class RegionOut(BaseModel):
    """Region at a position in the camera image."""

    model_config = DOCUMENTED

    name: str | None
    """Name in the beware list; null for an object separated by its depth."""
    footprint: tuple[Position, ...]
    """Outline on the floor, (x, y) in metres of the map frame."""
    outline: list[Position]
    """Outline in the image, as shares of width and height."""
