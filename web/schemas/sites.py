"""Sites in requests and answers, and the document of a site archive."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, StrictBool, StrictStr, field_validator

from navcore.config.localisation.tags import LARGEST_TAG
from navcore.geometry.transform import Pose2
from navcore.mission.beware_list import LARGEST_CLASS_ID, MAX_RETIRED
from navcore.mission.mission import MAX_GOALS
from web.interface.sites import MAX_TAGS, SITE_NAME, PointPair, Site, SiteChanges, Tag
from web.interface.wire import DOCUMENTED
from web.schemas.beware import BewareEntry
from web.schemas.fields import Body, Closed, Corner, Name, PoseIn, UnknownPrice
from web.schemas.mission.mission import GoalIn
from web.schemas.zones import MAX_IMPORT, ImportedFeatureIn, Nav2FilesIn

SiteName = Annotated[StrictStr, Field(pattern=SITE_NAME)]
TagIn = Annotated[Tag, Body()]
Tags = Annotated[list[TagIn], Field(max_length=MAX_TAGS)]
AreaId = Annotated[int, Field(strict=True, ge=0, le=2**53)]
Pair = tuple[Corner, Corner]


class SiteIn(Closed):
    """Name of a new site."""

    name: SiteName
    """1 to 40 letters, digits, blanks, `-` and `_`, beginning with a letter or digit."""


class SiteChangesIn(Closed):
    """Changed fields of a site; what is left out stays."""

    name: SiteName | None = None
    """New name; null leaves it unchanged."""
    dock: PoseIn | None = None
    """Pose of the robot in its dock; null removes it."""
    tags: Tags | None = None
    """Fiducial markers of the site; null removes them."""

    def changes(self) -> SiteChanges:
        """Return the changes."""
        given = self.model_fields_set
        return SiteChanges(
            name=self.name,
            dock=None if self.dock is None else Pose2(**self.dock.model_dump()),
            without_dock="dock" in given and self.dock is None,
            tags=tuple(self.tags or ()) if "tags" in given else None,
        )


class AlignmentIn(Closed):
    """Two points that are known in the frame of a map and in that of the site."""

    on_map: Pair
    """Points (x, y) in metres of the map's own frame."""
    on_site: Pair
    """The same points in metres of the map frame of the site."""

    def pairs(self) -> tuple[PointPair, PointPair]:
        """Return both pairs of points."""
        return self.on_map, self.on_site


class Nav2ImportIn(Nav2FilesIn):
    """Content of the two files of a Nav2 map, and where it lies."""

    name: SiteName
    """Name of the new site."""
    alignment: AlignmentIn | None = None
    """Where the map lies; null if its frame is that of the site."""


class AcceptIn(Closed):
    """Changed areas to take over into the accepted map."""

    listing: Annotated[int, Field(strict=True, ge=0, le=2**53)] | None = None
    """Number of the listing that the operator has seen; null for the whole present map."""
    areas: Annotated[tuple[AreaId, ...], Field(max_length=1000)] = ()
    """Numbers of areas of that listing."""


class SitesOut(BaseModel):
    """All sites."""

    model_config = DOCUMENTED

    chosen: str
    """Name of the site in use."""
    sites: tuple[Site, ...]
    """Sites by name."""


class StoredMissionIn(Closed):
    """Saved mission in an archive."""

    goals: Annotated[list[GoalIn], Field(max_length=MAX_GOALS)]
    """Goals in order."""
    loop: StrictBool
    """Whether reached goals are queued again."""


class BewareDocument(Closed):
    """Beware list in an archive."""

    classes: Annotated[list[BewareEntry], Field(max_length=LARGEST_CLASS_ID)]
    """Classes of the list."""
    retired: Annotated[
        list[tuple[Name, Annotated[int, Field(strict=True, ge=1, le=LARGEST_CLASS_ID)]]],
        Field(max_length=MAX_RETIRED),
    ]
    """Names and ids of removed classes, whose points may be on the map."""


Features = Annotated[list[ImportedFeatureIn], Field(max_length=MAX_IMPORT)]


class SiteDocument(Closed):
    """`site.json` of an archive."""

    format: Literal["bewarenav site"]
    """Mark of the format."""
    version: Literal[1]
    """Version of the format."""
    zones: Features
    """Zones as GeoJSON Features."""
    zone_sets: Annotated[dict[Name, Features], Field(max_length=50)]
    """Zones of each set; there `expires_at_s` is the remaining time."""
    missions: Annotated[dict[Name, StoredMissionIn], Field(max_length=200)]
    """Saved missions by name."""
    beware: BewareDocument | None
    """Beware list; null for that of the package."""
    dock: PoseIn | None
    """Pose in the dock."""
    tags: Tags
    """Fiducial markers."""
    accepted: dict[str, Any] | None
    """Accepted map, packed; null without one."""
    unknown_price: UnknownPrice | None = None
    """Cost of a metre of unseen floor in metres of seen floor; null for that of the
    configuration."""

    @field_validator("tags", mode="before")
    @classmethod
    def _without_unseen(cls, tags: Any) -> Any:
        """Drop the tags whose number is beyond the family, which earlier versions stored: no camera
        sees them."""
        return [tag for tag in tags if not _is_unseen(tag)] if isinstance(tags, list) else tags


def _is_unseen(tag: Any) -> bool:
    number = tag.get("id") if isinstance(tag, dict) else None
    return isinstance(number, int) and number > LARGEST_TAG
