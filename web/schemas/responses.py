"""What goes out by HTTP: pydantic models, so that the OpenAPI document says what is sent."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, Field


def _finite_or_none(value: Any) -> Any:
    """JSON knows no NaN; a figure that is none is shown as missing instead of failing the whole
    answer."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


Figure = Annotated[float | None, BeforeValidator(_finite_or_none)]


class PoseOut(BaseModel):
    """Where the robot stands, by odometry."""

    x_m: Figure
    y_m: Figure
    yaw_rad: Figure


class TwistOut(BaseModel):
    """A velocity."""

    v_mps: Figure
    w_radps: Figure


class GoalOut(BaseModel):
    """A goal of the mission."""

    id: int
    x_m: float
    y_m: float
    yaw_rad: float | None = Field(description="heading to stand in; null for any")
    name: str


class ReasonOut(BaseModel):
    """Why the robot does not move."""

    code: str
    text: str


class StateOut(BaseModel):
    """Everything small that is shown: one consistent snapshot."""

    type: Literal["state"] = "state"
    stamp_s: Figure
    scenario: str
    robot: str
    phase: str
    moving: bool
    summary: str
    stop_latched: bool
    reasons: list[ReasonOut]
    pose: PoseOut
    twist: TwistOut
    command: TwistOut
    queue: list[GoalOut]
    reached: list[GoalOut]
    distance_to_goal_m: Figure
    travelled_m: Figure
    explored_m2: Figure
    replans: int
    tick_ms: Figure
    frame_age_s: Figure
    zones_version: int
    beware_version: int
    beware_enabled: int = Field(
        description="number of enabled classes of the beware list; at 0 the robot bewares of nothing"
    )
    by_hand: bool = Field(description="somebody drives it by hand")
    in_zone: bool = Field(
        description="the robot stands in an area that it must not be in; mission/leave gets it out"
    )
    loop: bool = Field(description="goals that are reached wait again")
    segmenter: str = Field(description="what labels the pictures")
    segmenter_warning: str | None = Field(
        description="why it is not what it should be; null when it is"
    )
    picture_serial: int | None = Field(
        description="grows with every tick; `path` and `camera.jpg` follow it"
    )
    grid_version: int | None = Field(
        description="changes whenever the map does; `map.png` follows it"
    )


class MissionOut(BaseModel):
    """The goals and what was asked for."""

    phase: str
    queue: list[GoalOut]
    reached: list[GoalOut]
    loop: bool = Field(description="goals that are reached wait again")


class SavedMissionOut(BaseModel):
    """Goals kept under a name."""

    name: str
    goals: int
    loop: bool


class PolygonOut(BaseModel):
    """GeoJSON Polygon, ring closed, metres of the map frame."""

    type: Literal["Polygon"] = "Polygon"
    coordinates: list[list[tuple[float, float]]]


class CircleOut(BaseModel):
    """A circle that a zone was drawn as."""

    type: Literal["Point"] = "Point"
    coordinates: tuple[float, float]
    radius_m: float


class CorridorOut(BaseModel):
    """A strip along a line that a zone was drawn as."""

    type: Literal["LineString"] = "LineString"
    coordinates: list[tuple[float, float]]
    width_m: float


class ZonePropertiesOut(BaseModel):
    """Everything of a stored zone but its outline."""

    name: str
    enabled: bool
    margin_m: float
    kind: str = Field(description="keep-out or speed-limit")
    max_speed_mps: float | None
    colour: str | None
    expires_at_s: float | None = Field(
        description="when it is switched off, seconds since 1970 by the robot's clock"
    )
    drawn: CircleOut | CorridorOut | None = Field(description="what the polygon was made of")
    version: int
    frame: Literal["map"] = "map"


class ZoneOut(BaseModel):
    """A stored zone as a GeoJSON Feature; its version is the ETag."""

    type: Literal["Feature"] = "Feature"
    id: str
    geometry: PolygonOut
    properties: ZonePropertiesOut


class ZonesOut(BaseModel):
    """All stored zones."""

    type: Literal["FeatureCollection"] = "FeatureCollection"
    features: list[ZoneOut]
    undo: str | None = Field(description="the edit that zones/undo takes back")
    redo: str | None = Field(description="the edit that zones/redo does again")


class ZoneSetOut(BaseModel):
    """Zones kept under a name."""

    name: str
    zones: int


class RegionOut(BaseModel):
    """What was clicked in the picture."""

    name: str | None = Field(
        description="of the beware list; null for a thing told apart by its depth"
    )
    footprint: list[tuple[float, float]] = Field(
        description="its outline on the floor, metres of the map frame"
    )
    outline: list[tuple[float, float]] = Field(
        description="its outline in the picture, shares of width and height"
    )


class ColourRuleOut(BaseModel):
    """Pixels of a colour, in HSV."""

    hue_deg: tuple[float, float]
    min_saturation: float
    min_value: float
    max_height_m: float
    fallback: bool


class BewareClassOut(BaseModel):
    """One thing to beware of, and the colour the console draws it in."""

    name: str
    class_id: int
    enabled: bool
    margin_m: float
    min_confidence: float
    colour: ColourRuleOut | None
    min_height_m: float | None
    max_height_m: float | None
    min_size_m: float | None
    label: str | None
    display: str
    found_by: str = Field(description="network, colour rule, network and colour rule, or nothing")


class BewareOut(BaseModel):
    """The list in force; its version is the ETag."""

    version: int
    classes: list[BewareClassOut]
    can_undo: bool = Field(description="whether `beware/undo` has an edit to undo")


class MapOut(BaseModel):
    """Where the map lies and how large the robot is."""

    frame: Literal["map"] = "map"
    version: int
    resolution_m: float
    rows: int
    cols: int
    origin_x_m: float = Field(description="x of the lower-left corner")
    origin_y_m: float = Field(description="y of the lower-left corner")
    robot_length_m: float
    robot_width_m: float


class PersonOut(BaseModel):
    """Who walks or stands about."""

    id: int
    x_m: Figure
    y_m: Figure
    vx_mps: Figure
    vy_mps: Figure
    radius_m: Figure


class TilesOut(BaseModel):
    """Which parts of the map have changed."""

    version: int = Field(description="ask again with `since` at this")
    tile_cells: int = Field(
        description="cells to a side of a tile; those at the upper and right rim may be smaller"
    )
    rows: int
    cols: int
    changed: list[tuple[int, int, int]] = Field(
        description="row and column of the tile, and the version at which it changed"
    )


class PathOut(BaseModel):
    """The planned path, its corners and the way driven, in metres of the map frame; and what else
    moves with the robot."""

    serial: int
    path: list[tuple[float, float]]
    waypoints: list[tuple[float, float]]
    driven: list[tuple[float, float]]
    people: list[PersonOut]
    closed: list[ZoneOut] = Field(
        description="where the robot keeps out for a while of its own accord; the names say why"
    )
    view: list[tuple[float, float]] = Field(description="the floor that the camera looks at")


class WayOut(BaseModel):
    """A path that would be driven."""

    found: bool
    length_m: Figure
    time_s: Figure = Field(description="how long it would take, about")
    path: list[tuple[float, float]]


class PreviewOut(WayOut):
    """What a draft would lead to."""

    reason: str | None = Field(description="why there would be no path")
    cut_by: list[str] = Field(description="names of the zones that cut the goal off")
    present: WayOut | None = Field(description="the path without the draft")
    change_m: Figure = Field(description="how much longer the path would be")
    change_s: Figure = Field(description="how much longer it would take")


class VisitorOut(BaseModel):
    """Somebody at the console."""

    name: str
    role: str
    logged_in: bool = Field(
        description="false on a console that serves its own machine without a log-in"
    )


class ControlOut(BaseModel):
    """Who drives."""

    type: Literal["control"] = "control"
    serial: int = Field(description="grows with every change")
    you: VisitorOut | None
    yours: bool = Field(description="whether you are in control")
    holder: VisitorOut | None
    asking: VisitorOut | None = Field(description="who would like to have it")
    asked_by_you: bool
    before: VisitorOut | None = Field(description="who had it before")
    was_yours: bool
    taken: bool = Field(description="whether the holder took it from the one before")


class UserOut(BaseModel):
    """Who may log in."""

    name: str
    role: str
    has_token: bool


class TokenOut(BaseModel):
    """A bearer token; it is shown this once."""

    token: str


class HealthOut(BaseModel):
    """That the console answers, and how old the robot's newest picture is."""

    status: Literal["ok"] = "ok"
    scenario: str
    robot: str
    frame_age_s: Figure


class ProblemBody(BaseModel):
    """What is wrong, in one word for programs and one sentence for people, and where."""

    code: str
    message: str
    where: str | None


class Problem(BaseModel):
    """Every refusal has this shape."""

    error: ProblemBody


class NumberedPoseOut(BaseModel):
    """A pose that the map's points were seen from, T_map_base."""

    id: int
    x_m: float
    y_m: float
    yaw_rad: float


class PosesOut(BaseModel):
    """All of them, in the order of their IDs."""

    poses: list[NumberedPoseOut]
