"""What the routes of journal, explanation, sightings and series send and take."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from web.interface.insight import Kind
from web.schemas.fields import Name
from web.schemas.responses import Figure

MAX_KEYS = 64
Pixel = Annotated[int, Field(strict=True, ge=0, le=100_000)]
Key = Annotated[str, Field(strict=True, min_length=1, max_length=120)]
Place = tuple[float, float]


class EntryOut(BaseModel):
    """One decision of the robot, or something that led to one."""

    id: int
    start: int = Field(description="which start of the console wrote it, counted from 1")
    stamp_s: float = Field(description="robot's monotonic clock, of that start")
    unix_s: float = Field(description="wall clock")
    kind: Kind
    text: str
    place: Place | None = Field(description="metres of the map frame; null when it has no place")


class JournalOut(BaseModel):
    """A part of the log, oldest first."""

    newest: int = Field(description="id of the newest entry; ask again with `since` at this")
    oldest: int = Field(
        description="id of the oldest entry that is still kept; ask with `before` to get there"
    )
    start: int = Field(
        description="which start of the console this is: entries with a smaller one are from earlier"
    )
    entries: list[EntryOut]


class StretchOut(BaseModel):
    """A part of the path and the rule it lies against."""

    key: str | None = Field(description="null where it runs in the open")
    first: int = Field(description="index of its first point")
    last: int = Field(description="index of its last point")


class RuleOut(BaseModel):
    """Something that closes cells."""

    key: str = Field(description="`class:<id>`, `zone:<id>` or `wall`")
    name: str
    along_m: Figure = Field(description="metres of the path that lie against it")
    saves_m: Figure = Field(
        description="how much shorter the path would be without it; null when not known"
    )


class LiftOut(BaseModel):
    """What would have to go for a path to open."""

    keys: list[str] | None = Field(
        description="a smallest set of rules; null when none opens a path, or none was found"
    )
    exact: bool = Field(
        description="whether that is proven; false when the search was given up at its bound"
    )
    at_least: int = Field(description="no smaller number of rules opens a path")


class ExplanationOut(BaseModel):
    """Why the path leads where it does, or what would open one."""

    goal: Place
    found: bool
    reason: str | None = Field(description="why there is no path")
    length_m: Figure
    path: list[Place]
    stretches: list[StretchOut]
    rules: list[RuleOut]
    all_cost_m: Figure = Field(
        description="how much shorter the path would be with every rule lifted"
    )
    lift: LiftOut | None = Field(description="only without a path")


class ArcOut(BaseModel):
    """One motion that the robot can choose."""

    points: list[Place] = Field(
        description="as far as the body can be driven along it, metres of the map frame"
    )
    touch: Place | None = Field(
        description="where it would touch something; null for an arc that is free to its end"
    )


class CandidatesOut(BaseModel):
    """What the robot chooses its next motion from."""

    arcs: list[ArcOut]
    chosen: int | None = Field(
        description="index of the arc that is driven; null while it does something else or stands"
    )


class WithoutIn(BaseModel):
    """Rules to leave out, in thought only."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    without: Annotated[list[Key], Field(min_length=1, max_length=MAX_KEYS)] = Field(
        description="keys as `GET explain` names them"
    )


class AlternativeOut(BaseModel):
    """The path without some rules; nothing is applied."""

    found: bool
    reason: str | None
    length_m: Figure
    difference_m: Figure = Field(description="its length less that of the present path")
    path: list[Place]


class SightingOut(BaseModel):
    """A thing of the beware list that was recognised at one place."""

    id: int
    class_name: str
    class_id: int
    place: Place
    confidence: float
    looks: int = Field(description="pictures that showed it")
    first_s: float
    last_s: float
    age_s: Figure = Field(description="since it was last seen")
    verdict: Literal["wrong"] | None


class LabellingOut(BaseModel):
    """The folder of pictures for the next training."""

    folder: str
    pictures: int
    bytes_used: int
    max_pictures: int
    max_bytes: int


class SightingsOut(BaseModel):
    """Everything recognised, newest first."""

    seen: dict[str, int] = Field(description="class id → how many, without those called wrong")
    sightings: list[SightingOut]
    labelling: LabellingOut


class WrongIn(BaseModel):
    """What it is instead."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    class_name: Name | None = Field(
        None, description="of the beware list; null when it is nothing of it"
    )


class SnapshotOut(BaseModel):
    """A picture that is held for corrections."""

    snapshot: int


class ExampleIn(BaseModel):
    """Something in a held picture that was missed."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    snapshot: Annotated[int, Field(strict=True, ge=0, le=2**53)] = Field(
        description="as `POST sightings/snapshots` gave it"
    )
    class_name: Name
    box: tuple[Pixel, Pixel, Pixel, Pixel] = Field(
        description="left, top, right, bottom in pixels of the camera's picture"
    )
