"""What may come in by HTTP: pydantic models, strict about types, keys and finite numbers."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Discriminator, Field, StrictBool, StrictStr, Tag

from navcore.beware import LARGEST_CLASS_ID, MAX_MARGIN_M
from navcore.zone_shapes import MAX_BENDS, Circle, Corridor, Shape
from navcore.zones import MAX_CORNERS, MAX_LIMIT_MPS, MIN_LIMIT_MPS, ZoneKind
from web.access.users import LONGEST_PASSWORD
from web.drafts import PreviewDraft, ZoneDraft

MAX_NAME = 80
MAX_POSES = 100_000
MAX_CLASSES = LARGEST_CLASS_ID
FAR_M = 1e6
"""No map is larger; keeps arithmetic on what a client sends far away from overflow."""


def _printable(text: str) -> str:
    """Control characters and lone surrogates would break logs, labels and every later answer that shows the name."""
    if not text.isprintable() or not text.strip():
        raise ValueError("must be printable text and not blank")
    return text


Metres = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-FAR_M, le=FAR_M)]
Margin = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=MAX_MARGIN_M)]
Relief = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.01, le=2.0)]
Share = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1.0)]
Degrees = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=360.0)]
Angle = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-7.0, le=7.0)]
Name = Annotated[StrictStr, Field(min_length=1, max_length=MAX_NAME), AfterValidator(_printable)]
Corner = tuple[Metres, Metres]
Radians = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-100.0, le=100.0)]
Seconds = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e11)]
Speed = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=MIN_LIMIT_MPS, le=MAX_LIMIT_MPS)]
Colour = Annotated[StrictStr, Field(pattern=r"^#[0-9a-f]{6}$")]
Label = Annotated[StrictStr, Field(max_length=MAX_NAME), AfterValidator(lambda text: _printable(text) if text else text)]
GoalId = Annotated[int, Field(strict=True, ge=0, le=2**53)]
MAX_IMPORT = 500
MAX_FILE = 900_000
"""Characters of a file within a body."""


class _Closed(BaseModel):
    """A body whose unknown keys are refused by name."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class GoalIn(_Closed):
    """A place the robot is to drive to."""

    x_m: Metres = Field(description="x in metres of the map frame")
    y_m: Metres = Field(description="y in metres of the map frame")
    yaw_rad: Radians | None = Field(None, description="heading to stand in, counter-clockwise from x; null for any")
    name: Label = Field("", description="what the operator calls it")


class GoalPatchIn(_Closed):
    """The fields of a waiting goal that change; null takes the heading away."""

    x_m: Metres | None = None
    y_m: Metres | None = None
    yaw_rad: Radians | None = None
    name: Label | None = None

    def changes(self) -> dict[str, object]:
        """What was given."""
        given = self.model_dump(exclude_unset=True)
        return {name: value for name, value in given.items() if value is not None or name == "yaw_rad"}


class GoalOrderIn(_Closed):
    """The ids of all waiting goals, in the order to drive to them."""

    ids: Annotated[list[GoalId], Field(max_length=1000)]


class LoopIn(_Closed):
    """Whether goals that are reached wait again."""

    loop: StrictBool


class PlaceIn(_Closed):
    """A place on the map."""

    x_m: Metres
    y_m: Metres


class PolygonIn(_Closed):
    """GeoJSON Polygon with one ring, in metres of the map frame; the first corner may be repeated at the end."""

    type: Literal["Polygon"]
    coordinates: Annotated[list[Annotated[list[Corner], Field(max_length=MAX_CORNERS + 1)]], Field(min_length=1, max_length=1)]

    def shape(self) -> None:
        """It was drawn corner by corner."""

    def corners(self) -> tuple[tuple[float, float], ...]:
        """The ring as given."""
        return tuple(self.coordinates[0])


class CircleIn(_Closed):
    """GeoJSON Point with a radius: a circle."""

    type: Literal["Point"]
    coordinates: Corner
    radius_m: Metres

    def shape(self) -> Circle:
        """The circle."""
        return Circle(centre=self.coordinates, radius_m=self.radius_m)

    def corners(self) -> tuple[tuple[float, float], ...]:
        """The polygon around it."""
        return self.shape().outline()


class CorridorIn(_Closed):
    """GeoJSON LineString with a width: a strip, like tape on the floor."""

    type: Literal["LineString"]
    coordinates: Annotated[list[Corner], Field(max_length=MAX_BENDS)]
    width_m: Metres

    def shape(self) -> Corridor:
        """The strip."""
        return Corridor(line=tuple(self.coordinates), width_m=self.width_m)

    def corners(self) -> tuple[tuple[float, float], ...]:
        """The polygon around it."""
        return self.shape().outline()


GeometryIn = Annotated[PolygonIn | CircleIn | CorridorIn, Discriminator("type")]
DrawnIn = Annotated[CircleIn | CorridorIn, Discriminator("type")]


class ZoneRulesIn(_Closed):
    """Everything of a zone but its outline."""

    name: Name = Field(description="what the operator calls it")
    enabled: StrictBool = Field(True, description="whether it binds the robot")
    margin_m: Margin = Field(0.0, description="room kept around it beyond the robot's own margin")
    kind: ZoneKind = Field(ZoneKind.KEEP_OUT, description="what it demands")
    max_speed_mps: Speed | None = Field(None, description="the limit of a speed limit")
    colour: Colour | None = Field(None, description="#rrggbb; null for the console's own")
    expires_at_s: Seconds | None = Field(None, description="when it is switched off, seconds since 1970 by the robot's clock")
    expires_in_s: Seconds | None = Field(None, description="the same from now on; wins over expires_at_s")
    drawn: DrawnIn | None = Field(None, description="what a Polygon was made of; dropped when its corners were moved")

    def drafted(self, geometry: GeometryIn) -> ZoneDraft:
        """What the system stores."""
        shape: Shape | None = geometry.shape()
        return ZoneDraft(
            name=self.name,
            polygon=geometry.corners(),
            enabled=self.enabled,
            margin_m=self.margin_m,
            kind=self.kind,
            max_speed_mps=self.max_speed_mps,
            colour=self.colour,
            expires_at_s=self.expires_at_s,
            expires_in_s=self.expires_in_s,
            drawn=shape or (None if self.drawn is None else self.drawn.shape()),
        )


class ZonePropertiesIn(ZoneRulesIn):
    """The properties of a zone's Feature."""

    version: int | None = Field(None, description="ignored; `If-Match` guards against lost edits")
    frame: Literal["map"] | None = Field(None, description="named local frame of the coordinates")


class ZoneFeatureIn(_Closed):
    """A zone as a GeoJSON Feature."""

    type: Literal["Feature"]
    id: StrictStr | int | None = Field(None, description="ignored: the path names the zone")
    geometry: GeometryIn
    properties: ZonePropertiesIn

    def draft(self) -> ZoneDraft:
        """What the system stores."""
        return self.properties.drafted(self.geometry)


class PlainZoneIn(ZoneRulesIn):
    """A zone as a bare geometry with a name."""

    geometry: GeometryIn

    def draft(self) -> ZoneDraft:
        """What the system stores."""
        return self.drafted(self.geometry)


def _zone_form(value: Any) -> str:
    kind = value.get("type") if isinstance(value, dict) else getattr(value, "type", None)
    return "Feature" if kind is not None else "plain"


ZoneIn = Annotated[
    Annotated[ZoneFeatureIn, Tag("Feature")] | Annotated[PlainZoneIn, Tag("plain")],
    Discriminator(_zone_form),
]


class _Open(BaseModel):
    """A body from another program: what is not known is left out."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class ImportedPropertiesIn(ZoneRulesIn):
    """Properties of a Feature of another program: all but the known ones are left out, and even a name may be missing."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    name: Name = "Imported zone"


class ImportedFeatureIn(_Open):
    """A Feature of another program."""

    type: Literal["Feature"]
    geometry: GeometryIn
    properties: ImportedPropertiesIn | None = None

    def draft(self) -> ZoneDraft:
        """What the system stores."""
        return (self.properties or ImportedPropertiesIn.model_validate({})).drafted(self.geometry)


class ZoneImportIn(_Open):
    """A GeoJSON FeatureCollection in metres of the map frame."""

    type: Literal["FeatureCollection"]
    features: Annotated[list[ImportedFeatureIn], Field(min_length=1, max_length=MAX_IMPORT)]


class MaskImportIn(_Closed):
    """A Nav2 keep-out mask: what its two files hold."""

    yaml: Annotated[StrictStr, Field(max_length=20_000)] = Field(description="text of the YAML file")
    picture: Annotated[StrictStr, Field(max_length=MAX_FILE)] = Field(description="the PGM or PNG file, base64")
    name: Name = "Mask"


class PixelIn(_Closed):
    """A place in the camera's picture, as shares of its width and height."""

    right: Share = Field(description="from the left edge, 0 to 1")
    down: Share = Field(description="from the upper edge, 0 to 1")


class ColourRuleIn(_Closed):
    """Pixels of a colour, in HSV."""

    hue_deg: tuple[Degrees, Degrees] = Field(description="first and last hue, going up; may wrap around red")
    min_saturation: Share = 0.5
    min_value: Share = 0.2
    max_height_m: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=3.0)] = 0.05
    fallback: StrictBool = Field(False, description="used only while no network knows the class")


class BewareClassIn(_Closed):
    """One thing to beware of."""

    name: Name
    class_id: Annotated[int, Field(strict=True, ge=1, le=LARGEST_CLASS_ID)]
    enabled: StrictBool = True
    margin_m: Margin = 0.0
    min_confidence: Share = 0.5
    colour: ColourRuleIn | None = None
    min_height_m: Relief | None = Field(None, description="what is flatter is only a picture of it")
    label: Name | None = Field(None, description="what the console calls it")
    display: StrictStr | None = Field(None, description="ignored: the console's own colour")
    found_by: StrictStr | None = Field(None, description="ignored: what finds it here")


class BewareListIn(_Closed):
    """A whole list, in the operator's order."""

    classes: Annotated[list[BewareClassIn], Field(max_length=MAX_CLASSES)]
    version: int | None = Field(None, description="ignored; `If-Match` guards against lost edits")


class BewarePatchIn(_Closed):
    """The fields of one class that change; null takes away `colour`, `min_height_m` or `label`, and leaves the others."""

    enabled: StrictBool | None = None
    margin_m: Margin | None = None
    min_confidence: Share | None = None
    colour: ColourRuleIn | None = None
    min_height_m: Relief | None = None
    label: Name | None = None


class PreviewIn(_Closed):
    """A draft: a goal, a zone, or both."""

    goal: GoalIn | None = Field(None, description="default: the present goal")
    start: PlaceIn | None = Field(None, description="default: where the robot stands")
    polygon: Annotated[list[Corner], Field(max_length=MAX_CORNERS + 1)] | None = Field(
        None, description="corners of a keep-out; `zone` says more"
    )
    zone: ZoneIn | None = Field(None, description="a zone as it would be stored; wins over `polygon`")
    replaces: Annotated[StrictStr, Field(max_length=MAX_NAME)] | None = Field(
        None, description="id of the stored zone that the draft takes the place of, or that would be deleted"
    )

    def draft(self) -> PreviewDraft:
        """What is to be tried."""
        zone = None if self.zone is None else self.zone.draft()
        if zone is None and self.polygon is not None:
            zone = ZoneDraft(name="the draft", polygon=tuple(self.polygon))
        goal = None if self.goal is None else (self.goal.x_m, self.goal.y_m)
        start = None if self.start is None else (self.start.x_m, self.start.y_m)
        return PreviewDraft(goal=goal, start=start, zone=zone, replaces=self.replaces)


class NumberedPoseIn(_Closed):
    """A pose that the map's points were seen from, T_map_base."""

    id: Annotated[int, Field(strict=True, ge=0, description="pose ID")]
    x_m: Metres
    y_m: Metres
    yaw_rad: Angle


class PosesIn(_Closed):
    """Past poses as they are known by now; those that are not named stay."""

    poses: Annotated[list[NumberedPoseIn], Field(min_length=1, max_length=MAX_POSES)]


class Here(_Closed):
    """A page says that it is still there."""

    type: Literal["here"]


class Drive(_Closed):
    """A page's hand is on the robot: how fast it is to go until it hears more, 0.25 s at most."""

    type: Literal["drive"]
    v_mps: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-5.0, le=5.0)]
    w_radps: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-10.0, le=10.0)]
    t_ms: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e15)] = Field(
        description="when it was sent, by a clock of the page that only goes forward"
    )


Password = Annotated[StrictStr, Field(max_length=LONGEST_PASSWORD)]


class RoleIn(_Closed):
    """What somebody may do."""

    role: Literal["viewer", "operator", "admin"]


class PasswordIn(_Closed):
    """A new password."""

    password: Password


class OwnPasswordIn(PasswordIn):
    """One's own new password, and the present one as a proof."""

    present: Password


class NewUserIn(RoleIn, PasswordIn):
    """Who may log in from now on."""

    name: Name
