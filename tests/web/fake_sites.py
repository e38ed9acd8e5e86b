"""Sites in memory behind the fake robot: names and rules of the real ones, without files."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection

import numpy as np

from navcore.errors import NotKnown, Outdated, Refused
from navcore.formats.alignment import align
from navcore.formats.nav2_map import read
from navcore.geometry.transform import Pose2
from navcore.mapping.changes import ChangeKind
from web.interface.sites import (
    AreaOut,
    MapChanges,
    Nav2Files,
    PointPair,
    SeenTag,
    Site,
    SiteChanges,
    Tag,
)

AREAS = tuple(
    AreaOut(
        id=number,
        kind=kind,
        area_m2=area_m2,
        outline=np.array([[x, 3.0], [x + 1.0, 3.0], [x + 1.0, 4.0]]),
    )
    for number, (kind, area_m2, x) in enumerate(
        ((ChangeKind.APPEARED, 0.8, -4.0), (ChangeKind.GONE, 0.16, 2.0))
    )
)


class FakeSites:
    """Implementation of `web.interface.sites.Sites`."""

    def __init__(self, drives: Callable[[], bool]) -> None:
        """`drives` says whether a mission drives."""
        self._drives = drives
        self._chosen = "default"
        self._sites: dict[str, Site] = {}
        self._areas: tuple[AreaOut, ...] | None = None
        self._listing = self._made = 0
        self.archives: list[bytes] = []
        self.placed: Pose2 | None = None
        self.make("default")

    @property
    def chosen(self) -> str:
        """Implement the port."""
        return self._chosen

    @property
    def chosen_id(self) -> str:
        """Implement the port."""
        return self._sites[self._chosen].id

    def all(self) -> tuple[Site, ...]:
        """Implement the port."""
        return tuple(
            dataclasses.replace(site, chosen=name == self._chosen)
            for name, site in sorted(self._sites.items())
        )

    def make(self, name: str) -> Site:
        """Implement the port."""
        if name in self._sites:
            raise Refused(f"a site is called {name!r} already")
        self._made += 1
        self._sites[name] = Site(
            id=f"id {self._made}",
            name=name,
            chosen=False,
            world=None,
            zones=0,
            missions=0,
            map_bytes=0,
            map_unix_s=None,
            accepted=False,
            dock=None,
            tags=(),
        )
        return self._sites[name]

    def choose(self, name: str) -> Site:
        """Implement the port."""
        if self._drives():
            raise Refused("the mission is driving; pause or cancel it, then change the site")
        self._chosen = self._named(name).name
        return self._named(name)

    def change(self, name: str, changes: SiteChanges) -> Site:
        """Implement the port."""
        site = self._named(name)
        new_name = changes.name or name
        if new_name != name:
            if new_name in self._sites:
                raise Refused(f"a site is called {new_name!r} already")
            del self._sites[name]
            self._chosen = new_name if self._chosen == name else self._chosen
        self._sites[new_name] = dataclasses.replace(
            site,
            name=new_name,
            dock=None if changes.without_dock else changes.dock or site.dock,
            tags=site.tags if changes.tags is None else changes.tags,
        )
        return self._sites[new_name]

    def put_tag(self, name: str, tag: Tag) -> Site:
        """Implement the port."""
        others = (one for one in self._named(name).tags if one.id != tag.id)
        tags = tuple(sorted((*others, tag), key=lambda one: one.id))
        return self.change(name, SiteChanges(tags=tags))

    def remove_tag(self, name: str, number: int) -> Site:
        """Implement the port."""
        tags = tuple(tag for tag in self._named(name).tags if tag.id != number)
        return self.change(name, SiteChanges(tags=tags))

    def seen_tags(self, size_m: float) -> tuple[SeenTag, ...]:
        """Implement the port: a tag of number 12 straight ahead."""
        known = {tag.id for tag in self._named(self._chosen).tags}
        tag = Tag(id=12, x_m=3.0, y_m=0.5, z_m=0.6, yaw_rad=3.1416, size_m=size_m, sigma_m=0.02)
        return (SeenTag(tag=tag, known=12 in known),)

    def copy(self, name: str, new_name: str) -> Site:
        """Implement the port."""
        self._named(name)
        return self.make(new_name)

    def delete(self, name: str) -> None:
        """Implement the port."""
        if self._named(name).name == self._chosen:
            raise Refused(f"the robot is at site {name!r}; choose another one first")
        del self._sites[name]

    def export(self, name: str) -> bytes:
        """Implement the port."""
        return f"archive of {self._named(name).name}".encode()

    def add(self, name: str, archive: bytes) -> Site:
        """Implement the port."""
        self.archives.append(archive)
        return self.make(name)

    def export_nav2(self, name: str) -> bytes:
        """Implement the port."""
        return f"map of {self._named(name).name}".encode()

    def add_nav2(
        self, name: str, files: Nav2Files, *, pairs: tuple[PointPair, PointPair] | None
    ) -> Site:
        """Implement the port."""
        read(files.yaml, files.image, "map")
        self.placed = None if pairs is None else align(*pairs)
        return self.make(name)

    def changes(self) -> MapChanges:
        """Implement the port."""
        self._listing += 1
        return MapChanges(
            listing=self._listing,
            accepted=self._areas is not None,
            areas=self._areas or (),
            left_out=0,
        )

    def accept(self, listing: int | None, area_ids: Collection[int]) -> MapChanges:
        """Implement the port: the first acceptance of everything finds the areas of a test."""
        if listing is None:
            self._areas = AREAS if self._areas is None else ()
        elif listing != self._listing or self._areas is None:
            raise Outdated("this listing of changes is no longer held; list the changes again")
        else:
            self._areas = tuple(area for area in self._areas if area.id not in area_ids)
        return self.changes()

    def _named(self, name: str) -> Site:
        try:
            return self._sites[name]
        except KeyError:
            raise NotKnown(f"no site is called {name!r}") from None
