"""Zones in requests and answers: GeoJSON in metres of the map frame, bare geometries, and files of
other programs.

The models are not those of geojson-pydantic, which refuse neither unknown keys nor numbers as text,
and know neither the radius of a Point nor the width of a LineString.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    StrictBool,
    StrictStr,
    Tag,
    model_validator,
)

from navcore.errors import BadConfiguration
from navcore.mission.beware_list import MAX_MARGIN_M
from navcore.mission.zone import MAX_CORNERS, MAX_LIMIT_MPS, MIN_LIMIT_MPS, Zone, ZoneKind
from navcore.mission.zone_shapes import MAX_BENDS, Circle, Corridor, Shape
from web.interface.drafts import EditHistory, ZoneDraft
from web.interface.sites import Nav2Files
from web.interface.wire import DOCUMENTED
from web.schemas.fields import Closed, Corner, Metres, Name, hand_over, number

Seconds = Annotated[float, number(0.0, 1e11)]
Speed = Annotated[float, number(MIN_LIMIT_MPS, MAX_LIMIT_MPS)]
Margin = Annotated[float, number(0.0, MAX_MARGIN_M)]
Colour = Annotated[StrictStr, Field(pattern=r"^#[0-9a-f]{6}$")]
Ring = Annotated[list[Corner], Field(max_length=MAX_CORNERS + 1)]
MAX_IMPORT = 500
"""Largest number of zones in an import."""
MAX_IMPORT_BYTES = 24_000_000
"""Largest GeoJSON of an import in bytes: as many zones of 1000 corners with 17 digits each."""
MAX_IMAGE_FILE = 12_000_000
"""Largest number of characters of an image in base64: a PGM of 3000 × 3000 cells."""


class PolygonGeometry(Closed):
    """GeoJSON Polygon with one ring; the first corner may be repeated at the end."""

    type: Literal["Polygon"] = "Polygon"
    """Type of the geometry."""
    coordinates: Annotated[list[Ring], Field(min_length=1, max_length=1)]
    """Ring of corners (x, y) in metres of the map frame."""

    def shape(self) -> None:
        """Return None: a polygon is drawn corner by corner."""

    def corners(self) -> tuple[Corner, ...]:
        """Return the ring as given."""
        return tuple(self.coordinates[0])


class CircleGeometry(Closed):
    """GeoJSON Point with a radius: a circle."""

    type: Literal["Point"] = "Point"
    """Type of the geometry."""
    coordinates: Corner
    """Centre (x, y) in metres of the map frame."""
    radius_m: Metres
    """Radius in metres."""

    def shape(self) -> Circle:
        """Return the circle."""
        return Circle(centre=self.coordinates, radius_m=self.radius_m)

    def corners(self) -> tuple[Corner, ...]:
        """Return the polygon around the circle."""
        return self.shape().outline()


class CorridorGeometry(Closed):
    """GeoJSON LineString with a width: a strip along a line."""

    type: Literal["LineString"] = "LineString"
    """Type of the geometry."""
    coordinates: Annotated[list[Corner], Field(max_length=MAX_BENDS)]
    """Points (x, y) of the line in metres of the map frame."""
    width_m: Metres
    """Width of the strip in metres."""

    def shape(self) -> Corridor:
        """Return the strip."""
        return Corridor(line=tuple(self.coordinates), width_m=self.width_m)

    def corners(self) -> tuple[Corner, ...]:
        """Return the polygon around the strip."""
        return self.shape().outline()


Geometry = Annotated[PolygonGeometry | CircleGeometry | CorridorGeometry, Discriminator("type")]
Drawn = Annotated[CircleGeometry | CorridorGeometry, Discriminator("type")]


class ZoneRules(Closed):
    """Properties of a zone without its outline."""

    name: Name
    """Name that the operator gave it."""
    enabled: StrictBool = True
    """Whether the rule holds."""
    margin_m: Margin = 0.0
    """Clearance in metres beyond the robot's own margin."""
    kind: ZoneKind = ZoneKind.KEEP_OUT
    """Rule that holds in the zone."""
    max_speed_mps: Speed | None = None
    """Speed limit in metres per second; null for a keep-out zone."""
    colour: Colour | None = None
    """Colour `#rrggbb` in the console; null for the default."""
    expires_at_s: Seconds | None = None
    """Time at which the zone is disabled, seconds since 1970 by the robot's clock; null for
    never."""
    drawn: Drawn | None = None
    """Shape that a Polygon was made from; dropped when its corners were moved."""


class ZoneRulesIn(ZoneRules):
    """Properties of a zone in a request, without its outline."""

    expires_in_s: Seconds | None = None
    """Time from now until the zone is disabled, seconds; takes precedence over `expires_at_s`."""

    def drafted(self, geometry: Geometry) -> ZoneDraft:
        """Return the draft of a zone with these properties."""
        shape: Shape | None = geometry.shape()
        rules = {name: value for name, value in self if name in _DRAFTED}
        drawn = shape or (None if self.drawn is None else self.drawn.shape())
        return ZoneDraft(polygon=geometry.corners(), drawn=drawn, **rules)


_DRAFTED = set(ZoneRulesIn.model_fields) - {"drawn"}


class ZonePropertiesIn(ZoneRulesIn):
    """Properties of a zone's Feature in a request."""

    version: int | None = None
    """Ignored; `If-Match` guards against lost edits."""
    frame: Literal["map"] | None = None
    """Named local frame of the coordinates."""


class ZoneFeatureIn(Closed):
    """Zone as a GeoJSON Feature."""

    type: Literal["Feature"]
    """Type of the object."""
    id: StrictStr | int | None = None
    """Ignored; the path of the request names the zone."""
    geometry: Geometry
    """Outline of the zone."""
    properties: ZonePropertiesIn
    """Rule and name of the zone."""

    def draft(self) -> ZoneDraft:
        """Return the draft of the zone."""
        return self.properties.drafted(self.geometry)


class PlainZoneIn(ZoneRulesIn):
    """Zone as a bare geometry with a name."""

    geometry: Geometry
    """Outline of the zone."""

    def draft(self) -> ZoneDraft:
        """Return the draft of the zone."""
        return self.drafted(self.geometry)


def _zone_form(value: Any) -> str:
    kind = value.get("type") if isinstance(value, dict) else getattr(value, "type", None)
    return "Feature" if kind is not None else "plain"


ZoneIn = Annotated[
    Annotated[ZoneFeatureIn, Tag("Feature")] | Annotated[PlainZoneIn, Tag("plain")],
    Discriminator(_zone_form),
]


class _Open(BaseModel):
    """Body from another program; unknown keys are dropped."""

    model_config = DOCUMENTED | ConfigDict(extra="ignore", frozen=True)


class ImportedPropertiesIn(ZoneRulesIn):
    """Properties of a Feature of another program; unknown keys are dropped, a name may be
    missing."""

    model_config = ConfigDict(extra="ignore")

    name: Name = "Imported zone"
    """Name of the zone."""


class ImportedFeatureIn(_Open):
    """Feature of another program."""

    type: Literal["Feature"]
    """Type of the object."""
    geometry: Geometry
    """Outline of the zone."""
    properties: ImportedPropertiesIn | None = None
    """Rule and name of the zone."""

    def draft(self) -> ZoneDraft:
        """Return the draft of the zone."""
        return (self.properties or ImportedPropertiesIn.model_validate({})).drafted(self.geometry)


class ZoneImportIn(_Open):
    """GeoJSON FeatureCollection in metres of the map frame."""

    type: Literal["FeatureCollection"]
    """Type of the object."""
    features: Annotated[
        list[Annotated[ImportedFeatureIn, BeforeValidator(hand_over)]],
        Field(min_length=1, max_length=MAX_IMPORT),
    ]
    """Zones to add."""

    @model_validator(mode="before")
    @classmethod
    def _is_a_collection(cls, value: Any) -> Any:
        if not isinstance(value, dict) or value.get("type") != "FeatureCollection":
            raise ValueError("This is no GeoJSON of zones: expected a FeatureCollection.")
        return value


class Nav2FilesIn(Closed):
    """Content of the two files of a Nav2 map."""

    yaml: Annotated[StrictStr, Field(max_length=20_000)]
    """Text of the YAML file."""
    picture: Annotated[StrictStr, Field(max_length=MAX_IMAGE_FILE)]
    """PGM or PNG file in base64."""

    def files(self) -> Nav2Files:
        """Return the files; raises `BadConfiguration`."""
        try:
            image = base64.b64decode(self.picture, validate=True)
        except ValueError:
            raise BadConfiguration("body.picture: is not base64") from None
        return Nav2Files(yaml=self.yaml.encode(errors="replace"), image=image)


class MaskImportIn(Nav2FilesIn):
    """Content of the two files of a Nav2 keep-out mask."""

    name: Name = "Mask"
    """Name of the zones."""


class ZonePropertiesOut(ZoneRules):
    """Properties of a stored zone."""

    version: int
    """Version of the zone; its ETag."""
    frame: Literal["map"] = "map"
    """Frame of the coordinates."""


class ZoneOut(BaseModel):
    """Stored zone as a GeoJSON Feature; its version is the ETag."""

    model_config = DOCUMENTED

    type: Literal["Feature"] = "Feature"
    """Type of the object."""
    id: str
    """Id of the zone."""
    geometry: PolygonGeometry
    """Outline, its ring closed."""
    properties: ZonePropertiesOut
    """Rule and name of the zone."""

    @staticmethod
    def of(zone: Zone) -> ZoneOut:
        """Return the Feature of a zone; its values are not validated again."""
        rules = {name: getattr(zone, name) for name in ZoneRules.model_fields if name != "drawn"}
        return ZoneOut(
            id=zone.id,
            geometry=PolygonGeometry.model_construct(
                coordinates=[[*zone.polygon, zone.polygon[0]]]
            ),
            properties=ZonePropertiesOut.model_construct(
                **rules, drawn=_drawn(zone.drawn), version=zone.version
            ),
        )


class ZonesOut(BaseModel):
    """All stored zones as a GeoJSON FeatureCollection."""

    model_config = DOCUMENTED

    type: Literal["FeatureCollection"] = "FeatureCollection"
    """Type of the object."""
    features: list[ZoneOut]
    """Zones in the order in which they were first stored."""
    undo: str | None
    """Edit that `zones/undo` takes back; null for none."""
    redo: str | None
    """Edit that `zones/redo` repeats; null for none."""

    @staticmethod
    def of(zones: Iterable[Zone], history: EditHistory) -> ZonesOut:
        """Return the collection of zones."""
        features = [ZoneOut.of(zone) for zone in zones]
        return ZonesOut(features=features, undo=history.undo, redo=history.redo)


class ZoneSetOut(BaseModel):
    """Zones saved under a name."""

    model_config = DOCUMENTED

    name: str
    """Name of the set."""
    zones: int
    """Number of zones."""


def _drawn(shape: Shape | None) -> CircleGeometry | CorridorGeometry | None:
    if isinstance(shape, Circle):
        return CircleGeometry.model_construct(coordinates=shape.centre, radius_m=shape.radius_m)
    if shape is None:
        return None
    return CorridorGeometry.model_construct(coordinates=list(shape.line), width_m=shape.width_m)
