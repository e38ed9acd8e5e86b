"""Zones as they may come in: GeoJSON in metres of the map frame, a bare geometry, or files of other
programs."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, StrictBool, StrictStr, Tag

from navcore.mission.zone import MAX_CORNERS, MAX_LIMIT_MPS, MIN_LIMIT_MPS, ZoneKind
from navcore.mission.zone_shapes import MAX_BENDS, Circle, Corridor, Shape
from web.interface.drafts import ZoneDraft
from web.schemas.fields import Closed, Corner, Margin, Metres, Name

Seconds = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e11)]
Speed = Annotated[
    float, Field(strict=True, allow_inf_nan=False, ge=MIN_LIMIT_MPS, le=MAX_LIMIT_MPS)
]
Colour = Annotated[StrictStr, Field(pattern=r"^#[0-9a-f]{6}$")]
MAX_IMPORT = 500
MAX_FILE = 900_000
"""Characters of a file within a body."""


class PolygonIn(Closed):
    """GeoJSON Polygon with one ring, in metres of the map frame; the first corner may be repeated
    at the end."""

    type: Literal["Polygon"]
    coordinates: Annotated[
        list[Annotated[list[Corner], Field(max_length=MAX_CORNERS + 1)]],
        Field(min_length=1, max_length=1),
    ]

    def shape(self) -> None:
        """It was drawn corner by corner."""

    def corners(self) -> tuple[tuple[float, float], ...]:
        """The ring as given."""
        return tuple(self.coordinates[0])


class CircleIn(Closed):
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


class CorridorIn(Closed):
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


class ZoneRulesIn(Closed):
    """Everything of a zone but its outline."""

    name: Name = Field(description="what the operator calls it")
    enabled: StrictBool = Field(True, description="whether it binds the robot")
    margin_m: Margin = Field(0.0, description="room kept around it beyond the robot's own margin")
    kind: ZoneKind = Field(ZoneKind.KEEP_OUT, description="what it demands")
    max_speed_mps: Speed | None = Field(None, description="the limit of a speed limit")
    colour: Colour | None = Field(None, description="#rrggbb; null for the console's own")
    expires_at_s: Seconds | None = Field(
        None, description="when it is switched off, seconds since 1970 by the robot's clock"
    )
    expires_in_s: Seconds | None = Field(
        None, description="the same from now on; wins over expires_at_s"
    )
    drawn: DrawnIn | None = Field(
        None, description="what a Polygon was made of; dropped when its corners were moved"
    )

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


class ZoneFeatureIn(Closed):
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
    """Properties of a Feature of another program: all but the known ones are left out, and even a
    name may be missing."""

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


class MaskImportIn(Closed):
    """A Nav2 keep-out mask: what its two files hold."""

    yaml: Annotated[StrictStr, Field(max_length=20_000)] = Field(
        description="text of the YAML file"
    )
    picture: Annotated[StrictStr, Field(max_length=MAX_FILE)] = Field(
        description="the PGM or PNG file, base64"
    )
    name: Name = "Mask"
