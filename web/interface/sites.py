"""Port of the console to the sites of a robot. `app` implements it.

A site is a named place: map, zones and zone sets, missions, beware list, dock, tags. Refusals are
those of `web.interface.operations`.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Collection
from dataclasses import dataclass
from typing import Protocol

from navcore.config.localisation.tags import LARGEST_TAG
from navcore.errors import OtherSite
from navcore.geometry.transform import Pose2
from navcore.mapping.changes import ChangeKind
from navcore.toml_config import ranged
from web.interface.wire import WholePolyline, served

SITE_NAME = r"^[^\W_](?:[\w -]{0,38}[\w-])?$"
"""Names of sites, as a regular expression that no name lacks: letters of any language, digits,
blanks, `-` and `_`. `app.storage.sites.checked_name` knows what a letter is."""
MAX_ARCHIVE_BYTES = 64_000_000
"""Largest site archive in bytes."""
FAR_M = 1e6
"""Largest coordinate in metres."""
MAX_TAGS = LARGEST_TAG + 1
"""Largest number of tags of a site: each number once."""


def plain_name(name: str) -> str:
    """Return the name of a site with its letters as single characters, which they are not in names
    of files on a Mac, and without a second blank, which looks like one."""
    return re.sub(" +", " ", unicodedata.normalize("NFC", name))


def is_same_name(name: str, other: str) -> bool:
    """Return whether two names of sites differ in case alone."""
    return plain_name(name).casefold() == plain_name(other).casefold()


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class Tag:
    """Fiducial marker of a site."""

    id: int = ranged(0, LARGEST_TAG)
    """Number of the marker in its family."""
    x_m: float = ranged(-FAR_M, FAR_M)
    """x of its centre in metres of the map frame."""
    y_m: float = ranged(-FAR_M, FAR_M)
    """y of its centre in metres of the map frame."""
    z_m: float = ranged(-1000.0, 1000.0)
    """Height of its centre above the floor in metres."""
    yaw_rad: float = ranged(-100.0, 100.0)
    """Direction that its face looks in, radians of the map frame."""
    size_m: float = ranged(0.01, 10.0)
    """Side of the black square in metres."""
    sigma_m: float = ranged(0.001, 10.0, default=0.01)
    """Standard deviation of the position in metres; by default as a person measures with a tape."""
    sigma_rad: float = ranged(0.001, 3.2, default=round(math.radians(1.0), 4))
    """Standard deviation of the direction in radians."""


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class SeenTag:
    """A marker in the newest image."""

    tag: Tag
    """Where it is, by where the robot is and sees it."""
    known: bool
    """Whether the site has a marker of this number."""


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """One site in the list."""

    id: str
    """What the site is called by in the header `Site-Id`; it stays under another name."""
    name: str
    """Name of the site."""
    chosen: bool
    """Whether the robot is at this site now."""
    world: str | None
    """World in which the site was first used; null before."""
    zones: int
    """Number of zones."""
    missions: int
    """Number of saved missions."""
    map_bytes: int
    """Size of the kept map in bytes; 0 without one."""
    map_unix_s: float | None
    """Time at which the map was last written, seconds since 1970; null without a map."""
    accepted: bool
    """Whether an accepted map is there, with which the present one is compared."""
    dock: Pose2 | None
    """Pose of the robot in its dock, map frame; null without a dock."""
    tags: tuple[Tag, ...]
    """Fiducial markers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SiteChanges:
    """Changed fields of a site; what is None stays."""

    name: str | None = None
    """New name."""
    dock: Pose2 | None = None
    """Pose of the robot in its dock, map frame."""
    without_dock: bool = False
    """Whether the dock is removed."""
    tags: tuple[Tag, ...] | None = None
    """All fiducial markers."""


@served
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AreaOut:
    """Area in which the map differs from the accepted one."""

    id: int
    """Number of the area in this listing."""
    kind: ChangeKind
    """What has changed: occupied cells `appeared`, or are `gone`."""
    area_m2: float
    """Area of the changed cells in square metres."""
    outline: WholePolyline
    """Convex outline around the cells, (x, y) in metres of the map frame."""


@served
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapChanges:
    """Listing of the changes of the map of the chosen site."""

    listing: int
    """Number of the listing, for accepting areas of it."""
    accepted: bool
    """Whether there is an accepted map; without one nothing is compared."""
    areas: tuple[AreaOut, ...]
    """Changed areas, largest first."""
    left_out: int
    """Number of further areas, smaller than those."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Nav2Files:
    """Contents of the two files of a Nav2 map."""

    yaml: bytes
    """YAML file."""
    image: bytes
    """PGM or PNG file."""


PointPair = tuple[tuple[float, float], tuple[float, float]]
"""Two points (x, y) in metres."""


def at_another_site() -> OtherSite:
    """Return the refusal of an edit that was meant for the site of before."""
    return OtherSite("the robot is at another site now; nothing was changed")


class Sites(Protocol):
    """Sites of the data folder. Unlike the other ports, its methods read and write files."""

    @property
    def chosen(self) -> str:
        """Name of the site in use."""

    @property
    def chosen_id(self) -> str:
        """Its id."""

    def all(self) -> tuple[Site, ...]:
        """Return all sites by name."""

    def make(self, name: str) -> Site:
        """Make an empty site."""

    def choose(self, name: str) -> Site:
        """Use another site: its map, zones, sets, missions and beware list. Refused unless the
        robot stands and no mission drives."""

    def change(self, name: str, changes: SiteChanges) -> Site:
        """Rename a site, and set its dock and its tags: all or nothing."""

    def put_tag(self, name: str, tag: Tag) -> Site:
        """Add a tag to a site, or replace the one of its number."""

    def remove_tag(self, name: str, number: int) -> Site:
        """Remove the tag of a number from a site."""

    def seen_tags(self, size_m: float) -> tuple[SeenTag, ...]:
        """Return the markers in the newest image, by number; `size_m` is the side of their black
        square. Refused while the robot does not know where it is."""

    def copy(self, name: str, new_name: str) -> Site:
        """Copy a site with everything in it."""

    def delete(self, name: str) -> None:
        """Delete a site; refused for the one in use."""

    def export(self, name: str) -> bytes:
        """Return a site as a zip archive."""

    def add(self, name: str, archive: bytes) -> Site:
        """Make a site of an archive."""

    def export_nav2(self, name: str) -> bytes:
        """Return the map as a zip of Nav2 files: the map without the zones, and the keep-out mask
        beside it."""

    def add_nav2(
        self, name: str, files: Nav2Files, *, pairs: tuple[PointPair, PointPair] | None
    ) -> Site:
        """Make a site of a Nav2 map. `pairs`: two points of the map's frame, and the same two in
        the frame of the site; None if the frames are the same."""

    def changes(self) -> MapChanges:
        """Compare the map of the site in use with the accepted one."""

    def accept(self, listing: int | None, area_ids: Collection[int]) -> MapChanges:
        """Take areas of a listing over into the accepted map; with None for the listing the whole
        present map. Raises `Outdated` for a listing that is no longer held."""
