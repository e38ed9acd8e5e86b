"""What may come in by HTTP: pydantic models, strict about types, keys and finite numbers."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Discriminator, Field, StrictBool, StrictStr, Tag

from navcore.beware import LARGEST_CLASS_ID, MAX_MARGIN_M
from navcore.zones import MAX_CORNERS
from web.access.users import LONGEST_PASSWORD
from web.port import ZoneDraft

MAX_NAME = 80
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
Name = Annotated[StrictStr, Field(min_length=1, max_length=MAX_NAME), AfterValidator(_printable)]
Corner = tuple[Metres, Metres]


class _Closed(BaseModel):
    """A body whose unknown keys are refused by name."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class GoalIn(_Closed):
    """A place the robot is to drive to."""

    x_m: Metres = Field(description="x in metres of the map frame")
    y_m: Metres = Field(description="y in metres of the map frame")


class PolygonIn(_Closed):
    """GeoJSON Polygon with one ring, in metres of the map frame; the first corner may be repeated at the end."""

    type: Literal["Polygon"]
    coordinates: Annotated[list[Annotated[list[Corner], Field(max_length=MAX_CORNERS + 1)]], Field(min_length=1, max_length=1)]

    def corners(self) -> tuple[tuple[float, float], ...]:
        """The ring as given."""
        return tuple(self.coordinates[0])


class ZonePropertiesIn(_Closed):
    """Everything of a zone but its outline."""

    name: Name = Field(description="what the operator calls it")
    enabled: StrictBool = Field(True, description="whether it binds the robot")
    margin_m: Margin = Field(0.0, description="room kept around it beyond the robot's own margin")
    version: int | None = Field(None, description="ignored; `If-Match` guards against lost edits")
    frame: Literal["map"] | None = Field(None, description="named local frame of the coordinates")


class ZoneFeatureIn(_Closed):
    """A zone as a GeoJSON Feature."""

    type: Literal["Feature"]
    id: StrictStr | int | None = Field(None, description="ignored: the path names the zone")
    geometry: PolygonIn
    properties: ZonePropertiesIn

    def draft(self) -> ZoneDraft:
        """What the system stores."""
        p = self.properties
        return ZoneDraft(name=p.name, polygon=self.geometry.corners(), enabled=p.enabled, margin_m=p.margin_m)


class PlainZoneIn(_Closed):
    """A zone as a bare geometry with a name."""

    name: Name
    geometry: PolygonIn
    enabled: StrictBool = True
    margin_m: Margin = 0.0

    def draft(self) -> ZoneDraft:
        """What the system stores."""
        return ZoneDraft(name=self.name, polygon=self.geometry.corners(), enabled=self.enabled, margin_m=self.margin_m)


def _zone_form(value: Any) -> str:
    kind = value.get("type") if isinstance(value, dict) else getattr(value, "type", None)
    return "Feature" if kind is not None else "plain"


ZoneIn = Annotated[
    Annotated[ZoneFeatureIn, Tag("Feature")] | Annotated[PlainZoneIn, Tag("plain")],
    Discriminator(_zone_form),
]


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
    polygon: Annotated[list[Corner], Field(max_length=MAX_CORNERS + 1)] | None = Field(None, description="corners of a zone")


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
