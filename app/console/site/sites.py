"""The sites of a running console: the one in use, its accepted map, its session over a restart."""

from __future__ import annotations

import dataclasses
import math
import threading
from collections import OrderedDict
from collections.abc import Callable, Collection
from contextlib import AbstractContextManager, suppress
from typing import Any, Protocol

from app.console.mission.path_settings import stored_unknown_price
from app.console.site import dock_and_tags, site_files
from app.console.site.dock_and_tags import Dock, Tags
from app.console.site.placing import MISSION, numbered, settle
from app.console.site.site_archive import pack
from app.console.site.site_map import (
    accepted_map,
    begin_list,
    cells_on,
    map_of,
    save_accepted,
)
from app.runtime.control.operator_state import OperatorState, PlaceSearch
from app.runtime.control.robot_controller import RobotController
from app.runtime.record.map_keeper import MapKeeper
from app.storage import Store
from app.storage.records import goal_of, goal_record
from app.storage.site_store import SiteStore
from navcore.config.mapping import MappingConfig
from navcore.errors import Outdated, Refused, StorageFailed
from navcore.formats.nav2_map import read as nav2_map_of
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.grid.grid import GridSpec
from navcore.localisation.estimate import LocalisationEstimate
from navcore.localisation.fixes import TagMap
from navcore.mapping.changes import CellMap, ChangedArea, accept, changed_areas
from navcore.mapping.point_map import PointMap
from navcore.mission.beware_list import BewareList, default_beware_list
from navcore.mission.mission import Mission, Phase
from web.interface.meant_site import require_meant_site
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
from web.interface.snapshots import TickSnapshot

LAST_PLACE = ("place of the robot", "last")
"""Kind and name of the stored document."""
SESSION_PERIOD_S = 0.5
"""Time between two looks for a changed mission or place, seconds: a kill loses no more of it."""
MOVED_M, MOVED_RAD = 0.1, 0.1
"""Motion after which the place of the robot is stored again."""
STAYED_M, STAYED_RAD = 1.0, math.radians(90.0)
"""Motion by odometry within which a robot that comes back to a site knows its place there still."""
MAX_AREAS = 200
"""Largest number of changed areas in a listing."""
MAX_LISTINGS = 8
"""Number of listings that are held."""


class SiteUser(Protocol):
    """What shows and edits the contents of the site in use; the console's operations are one."""

    def leaving_site(self, keep_map: Callable[[], None]) -> AbstractContextManager[None]:
        """Hold every edit of the present site, and call `keep_map` once none changes its map any
        more; after the block they are refused."""

    def enter_site(self, site: SiteStore) -> None:
        """Edit the contents of another site from now on."""


class MapView(Protocol):
    """A source of the newest map; `app.runtime.record.recorder.Recorder` is one."""

    @property
    def picture(self) -> TickSnapshot | None:
        """Values of the newest tick; None before the first."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Listing:
    """Changes as an operator has seen them."""

    spec: GridSpec
    """Grid of the cells of the areas."""
    areas: tuple[ChangedArea, ...]
    """Changed areas in the order of their numbers."""


class LiveSites:
    """Satisfies the console's port `Sites`. Safe from any thread: one change at a time."""

    def __init__(
        self,
        store: Store,
        *,
        controller: RobotController,
        view: MapView,
        keeper: MapKeeper,
        user: SiteUser,
        config: MappingConfig,
        world: str,
        has_own_map: bool = True,
        world_tags: TagMap | None = None,
        new_beware: BewareList | None = None,
    ) -> None:
        """`has_own_map`: whether the map is kept in the folder of the site, not in another file.
        `world_tags`: tags of the world, for sites that name none. `new_beware`: list of a new site,
        by default the shipped one."""
        self._world_tags = world_tags or TagMap()
        self._new_beware = new_beware or default_beware_list()
        self._store, self._controller, self._view, self._keeper = store, controller, view, keeper
        self._user, self._config, self._world, self._has_own_map = user, config, world, has_own_map
        self._lock = threading.RLock()
        self._saved: Mission | None = None
        self._placed: Pose2 | None = None
        self._has_entered, self._old_picture = True, view.picture
        self._left: dict[str, tuple[LocalisationEstimate, bool]] = {}
        """Place at which each site was left, by its id, and whether it was believed for good."""
        self._listings: OrderedDict[int, _Listing] = OrderedDict()
        self._listed = 0
        self._tags = self._world_tags
        self._use_tags()

    @property
    def chosen(self) -> str:
        """Name of the site in use."""
        return self._store.site.name

    @property
    def chosen_id(self) -> str:
        """Id of the site whose goals, zones and list are in force."""
        return self._controller.intent.site_id

    def all(self) -> tuple[Site, ...]:
        """Return all sites by name."""
        return site_files.listed(self._store.sites, self._store.site.id)

    def make(self, name: str) -> Site:
        """Make an empty site."""
        return self._site(self._store.sites.make(name))

    def choose(self, name: str) -> Site:
        """Use another site from now on."""
        with self._lock:
            site = self._store.sites.open(name)
            if not self._is_chosen(site):
                self._enter(site)
            return self._site(site)

    def change(self, name: str, changes: SiteChanges) -> Site:
        """Rename a site, and set its dock and its tags; the one in use goes on under its new
        name."""
        with self._lock:
            with self._store.sites.renaming(name, changes.name) as site:
                if changes.dock is not None or changes.without_dock or changes.tags is not None:
                    dock_and_tags.furnish(site, *_furnishings(site, changes))
            if self._is_chosen(site):
                self._store.site = site
            self._use_tags()
            return self._site(site)

    def put_tag(self, name: str, tag: Tag) -> Site:
        """Add a tag to a site, or replace the one of its number."""
        return self._retag(name, lambda tags: dock_and_tags.with_tag(tags, tag))

    def remove_tag(self, name: str, number: int) -> Site:
        """Remove the tag of a number from a site."""
        return self._retag(name, lambda tags: dock_and_tags.without_tag(tags, number))

    def _retag(self, name: str, change: Callable[[Tags], Tags]) -> Site:
        """Change the tags of a site as they are stored now: others change them, too, also from the
        command line."""
        with self._lock:
            with self._store.sites.renaming(name, None) as site:
                tags = change(dock_and_tags.stored_tags(site))
                dock_and_tags.furnish(site, dock_and_tags.dock_of(site), tags)
            self._use_tags()
            return self._site(site)

    def seen_tags(self, size_m: float) -> tuple[SeenTag, ...]:
        """Return the tags in the newest image, placed by where the robot is."""
        known = dock_and_tags.tags_of(self._store.site)
        return dock_and_tags.seen_tags(self._controller.tick_state.decision, size_m, known)

    def copy(self, name: str, new_name: str) -> Site:
        """Copy a site with everything in it."""
        self._write_map_of(name)
        return self._site(self._store.sites.copy(name, new_name))

    def delete(self, name: str) -> None:
        """Delete a site; refused for the one in use."""
        with self._lock:
            site = self._store.sites.open(name)
            if self._is_chosen(site):
                raise Refused(f"the robot is at site {self.chosen!r}; choose another one first")
            self._store.sites.delete(name)
            self._left.pop(site.id, None)

    def export(self, name: str) -> bytes:
        """Return a site as a zip archive."""
        self._write_map_of(name)
        return pack(self._store.sites.open(name))

    def add(self, name: str, archive: bytes) -> Site:
        """Make a site of an archive."""
        return self._site(site_files.add(self._store.sites, name, archive))

    def export_nav2(self, name: str) -> bytes:
        """Return the map as Nav2 files, with the keep-out mask beside it."""
        self._write_map_of(name)
        return site_files.export_nav2(self._store.sites.open(name), self._config)

    def add_nav2(
        self, name: str, files: Nav2Files, *, pairs: tuple[PointPair, PointPair] | None
    ) -> Site:
        """Make a site of a Nav2 map."""
        sites, nav2_map = self._store.sites, nav2_map_of(files.yaml, files.image, "map")
        first = self._controller.navigator.first_grid
        made = site_files.add_nav2(sites, name, nav2_map, pairs=pairs, first_grid=first)
        return self._site(made)

    # The accepted map

    def changes(self) -> MapChanges:
        """Compare the map of the site in use with the accepted one."""
        with self._lock:
            present, accepted = self._present(), accepted_map(self._store.site)
            areas = () if accepted is None else changed_areas(accepted, present)
            self._listed += 1
            self._listings[self._listed] = _Listing(spec=present.spec, areas=areas[:MAX_AREAS])
            while len(self._listings) > MAX_LISTINGS:
                self._listings.popitem(last=False)
            return MapChanges(
                listing=self._listed,
                accepted=accepted is not None,
                areas=tuple(_area_out(i, area) for i, area in enumerate(areas[:MAX_AREAS])),
                left_out=max(len(areas) - MAX_AREAS, 0),
            )

    def accept(self, listing: int | None, area_ids: Collection[int]) -> MapChanges:
        """Take areas of a listing over into the accepted map: what the operator saw, not what the
        robot sees now."""
        with self._lock:
            require_meant_site()
            if listing is None:
                save_accepted(self._store.site, self._present())
                return self.changes()
            seen = self._listings.get(listing)
            if seen is None or any(area_id >= len(seen.areas) for area_id in area_ids):
                raise Outdated("this listing of changes is no longer held; list the changes again")
            before = accepted_map(self._store.site)
            if before is None:
                raise Refused("there is no accepted map yet; accept the whole map first")
            chosen = [seen.areas[area_id] for area_id in sorted(set(area_ids))]
            save_accepted(self._store.site, accept(before, seen.spec, chosen))
            return self.changes()

    # The session over a restart

    def keep_session(self) -> None:
        """Store the goals, the phase and the place of the robot if they have changed; called
        periodically."""
        with self._lock:
            mission, place = self._controller.intent.mission, self._known_place()
            if mission is not self._saved:
                self._store.site.save_document(*MISSION, _mission_record(mission))
                self._saved = mission
            if place is not None and _has_moved(self._placed, place):
                self._store.site.save_document(*LAST_PLACE, dataclasses.asdict(place))
                self._placed = place

    def _known_place(self) -> Pose2 | None:
        """Return T_map_base of the robot on the map of the site in use; None where that is not
        known."""
        # First: until the next tick after a change of site, the place is that on the map before.
        if not (self._has_own_map and self._has_entered):
            return None
        place = self._controller.place
        # Before the first tick the place is no estimate yet.
        has_place = self._controller.tick_state.decision is not None and place.is_known
        is_open = self._controller.navigator.held_map is not None
        return place.T_map_base if has_place and not is_open else None

    # Inside

    def _enter(self, site: SiteStore) -> None:
        self._require_own_map()
        self._controller.require_standing()
        before, spec = self._store.site, self._controller.navigator.first_grid
        left = self._controller.place
        is_believed = self._controller.navigator.held_map is None
        expected, kept = self._expected_place(site)
        stored = map_of(site, PointMap(spec, self._config).state())
        settle(site, numbered(stored.state.numbering, stored.state.poses))
        mission, zones, beware = mission_of(site), site.zones(), site.beware() or self._new_beware
        price, tags = stored_unknown_price(site), self._tags_of(site)
        self.keep_session()
        replaced = self._saved

        def edit(intent: OperatorState) -> OperatorState:
            nonlocal replaced
            replaced = intent.mission
            # A version that was in force names one list only, at whatever site.
            version = max(intent.beware.version + 1, beware.version)
            listed = dataclasses.replace(beware, version=version)
            return dataclasses.replace(
                intent,
                site=site.name,
                site_id=site.id,
                mission=dataclasses.replace(mission, runs=intent.mission.runs + 1),
                zones=zones,
                beware=listed,
                by_hand=None,
                search=PlaceSearch.NONE,
                unknown_price=price,
            )

        def replace_map() -> None:
            self._controller.navigator.map.restore(stored.state)
            self._controller.navigator.adopt_map(expected, kept=kept)
            self._keeper.use(site.map_file, stored.class_names)
            self._has_entered, self._old_picture = True, self._view.picture
            self._controller.navigator.localisation.tags = self._tags

        with self._user.leaving_site(self._write_map):
            with self._store.sites.choosing(site, self._world):
                # Until the next tick the robot's place is that on the map of the site before.
                self._has_entered, tags_before, self._tags = False, self._tags, tags
                self._store.site = site
                try:
                    self._controller.enter_site(edit, replace_map)
                except Refused:
                    self._store.site = before  # that of the editors, which go on
                    self._has_entered, self._tags = True, tags_before
                    raise
            self._keeper.left = before.map_file
            with suppress(StorageFailed):  # it is stored before its first edit, then
                begin_list(site, self._new_beware)
            self._user.enter_site(site)
        self._left.pop(site.id, None)
        if left.is_known:
            self._left[before.id] = left, is_believed
        self._placed = None
        self._listings.clear()
        if replaced is not None and replaced is not self._saved:  # by a goal of the last moment
            before.save_document(*MISSION, _mission_record(replaced))

    def _expected_place(self, site: SiteStore) -> tuple[Pose2 | None, LocalisationEstimate | None]:
        """Return T_map_base at which to look for the robot, and the estimate of its place that
        still holds. A robot that has left the site in this session is where odometry, which has
        gone on since, has it, and if it has hardly moved it knows its place still, unless that was
        on trial. Odometry's turn while it stood, an hour perhaps, is its gyro's drift."""
        if site.id not in self._left:
            return expected_place(site), None
        left, is_believed = self._left[site.id]
        moved = left.T_driven_base.inverse() @ self._controller.place.T_driven_base
        is_there = math.hypot(moved.x_m, moved.y_m) < STAYED_M and abs(moved.yaw_rad) < STAYED_RAD
        return left.T_map_base @ moved, left if is_there and is_believed else None

    def _use_tags(self) -> None:
        """Tell the robot of the tags of the present site, of another one with its map."""
        self._tags = self._tags_of(self._store.site)
        if self._has_entered:
            self._controller.navigator.localisation.tags = self._tags

    def _tags_of(self, site: SiteStore) -> TagMap:
        """Return the tags of a site, else those of the world."""
        tags = dock_and_tags.tags_of(site)
        return tags if tags.tags else self._world_tags

    def _require_own_map(self) -> None:
        if not self._has_own_map:
            raise Refused(
                "the map is kept in the file given with --map; restart without it to change sites"
            )

    def _write_map_of(self, name: str) -> None:
        """Write the present map before the site in use is copied."""
        if self._has_own_map and self._is_chosen(self._store.sites.open(name)):
            self._write_map()

    def _write_map(self) -> None:
        """Write the present map, with all that an operator was told is erased, unless it is still
        that of the site before, which was written then."""
        if self._has_entered:
            self._keeper.write_now(self._controller.edit_map)

    def _present(self) -> CellMap:
        picture = self._view.picture
        if picture is None or picture is self._old_picture or not self._has_entered:
            raise Refused("there is no map yet; the camera has not delivered an image")
        return cells_on(picture.grid, picture.seen)

    def _is_chosen(self, site: SiteStore) -> bool:
        return site.id == self._store.site.id

    def _site(self, site: SiteStore) -> Site:
        return next(one for one in self.all() if one.id == site.id)


def _furnishings(site: SiteStore, changes: SiteChanges) -> tuple[Dock, Tags]:
    """Return dock and tags of a site after changes."""
    dock = None if changes.without_dock else changes.dock or dock_and_tags.dock_of(site)
    tags = dock_and_tags.stored_tags(site) if changes.tags is None else changes.tags
    return dock, tags


def mission_of(site: SiteStore) -> Mission:
    """Return the mission that was last stored at a site, paused; an empty one before the first."""
    kind, name = MISSION
    record = site.documents(kind).get(name)
    if record is None:
        return Mission()
    queue, reached = (tuple(map(goal_of, record[which])) for which in ("queue", "reached"))
    return Mission(
        phase=Phase(record["phase"]),
        queue=queue,
        reached=reached,
        reached_count=record.get("reached_count", len(reached)),
        cancelled=record["cancelled"],
        next_id=record["next_id"],
        loop=record["loop"],
    ).stored()


def last_place_of(site: SiteStore) -> Pose2 | None:
    """Return T_map_base at which the robot was last known to be at a site; None if it never was."""
    kind, name = LAST_PLACE
    record = site.documents(kind).get(name)
    return None if record is None else Pose2(**record)


def expected_place(site: SiteStore) -> Pose2 | None:
    """Return T_map_base at which to look for the robot first: where it was last known to be, else
    in the dock."""
    return last_place_of(site) or dock_and_tags.dock_of(site)


def _has_moved(before: Pose2 | None, now: Pose2) -> bool:
    return (
        before is None
        or before.distance_to(now.x_m, now.y_m) > MOVED_M
        or abs(wrap_angle(now.yaw_rad - before.yaw_rad)) > MOVED_RAD
    )


def _mission_record(mission: Mission) -> dict[str, Any]:
    return {
        "phase": str(mission.phase),
        "queue": [{"id": goal.id, **goal_record(goal)} for goal in mission.queue],
        "reached": [{"id": goal.id, **goal_record(goal)} for goal in mission.reached],
        "reached_count": mission.reached_count,
        "cancelled": mission.cancelled,
        "next_id": mission.next_id,
        "loop": mission.loop,
    }


def _area_out(number: int, area: ChangedArea) -> AreaOut:
    return AreaOut(id=number, kind=area.kind, area_m2=round(area.area_m2, 3), outline=area.outline)
