"""Anchors of zones and goals on disk, and where the contents of a site are on its stored map.

Zones and goals are stored as soon as a correction has moved them, the map that was corrected some
seconds later. Where both are of different moments (a kill in between, a copy or an export while
the robot drives) the poses of the stored map tell where each zone and goal belongs on it.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from app.console.mission.saved_missions import MISSIONS
from app.console.mission.zone_editor import SETS
from app.storage.records import goal_of, goal_record, zone_of, zone_record
from app.storage.site_store import SiteStore
from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2
from navcore.mapping.storage import map_file
from navcore.mission.anchors import Anchor, Anchored, Anchors
from navcore.mission.mission import Goal
from navcore.mission.zone import Zone

ANCHORS = ("anchors", "map")
"""Kind and name of the stored document."""
MISSION = ("mission in progress", "mission")
"""Kind and name of the stored document."""
Record = Mapping[str, Any]
Poses = npt.NDArray[np.float64]
log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Placing:
    """Where zones and goals are on a stored map."""

    anchors: Anchors
    """Anchors in the numbering of its poses."""
    poses: Sequence[Pose2]
    """T_map_base of its poses by ID."""

    def zone(self, zone: Zone) -> Zone:
        """Return a stored zone where the map has it; the same one where it stays."""
        return self.anchors.zone_at(zone, self.poses)

    def goal(self, record: Record) -> Record:
        """Return the record of a stored goal where the map has it; the same one where it stays."""
        goal = Goal(**{"id": 0, **record})
        there = self.anchors.goal_at(goal, self.poses)
        return record if there is goal else {**record, **goal_record(there)}

    def zone_set(self, records: Sequence[Record]) -> Sequence[Record]:
        """Return the records of a set of zones where the map has them; the same ones where all
        stay."""
        zones = list(map(zone_of, records))
        there = list(map(self.zone, zones))
        return records if there == zones else list(map(zone_record, there))

    def mission(self, record: Record) -> Record:
        """Return the record of a saved mission, or of that in progress, with its waiting goals
        where the map has them; the same one where all stay."""
        waiting = "goals" if "goals" in record else "queue"
        there = list(map(self.goal, record[waiting]))
        return record if there == record[waiting] else {**record, waiting: there}


AS_STORED = Placing(anchors=Anchors(), poses=())
"""Where nothing tells more than what is stored."""


def save_anchors(site: SiteStore, anchors: Anchors) -> None:
    """Store the anchors in place of those of before; raises `StorageFailed`."""
    zones = [
        {"outline": outline, "zone": zone_record(held.item), **_anchor_record(held.anchor)}
        for outline, held in anchors.zones.items()
        if held is not None
    ]
    goals = [
        {"spot": spot, "goal": goal_record(held.item), **_anchor_record(held.anchor)}
        for spot, held in anchors.goals.items()
        if held is not None
    ]
    document = {"numbering": anchors.numbering, "zones": zones, "goals": goals}
    site.save_document(*ANCHORS, document if zones or goals else None)


def placing(site: SiteStore, numbering: str, poses: Poses) -> Placing:
    """Return where the contents of a site are on a stored map with these (P, 3) `poses`, whose IDs
    are of this `numbering`; of another numbering nothing is known, and all is where it was
    stored."""
    kind, name = ANCHORS
    record = site.documents(kind).get(name)
    if record is None or record["numbering"] != numbering:
        return AS_STORED
    return Placing(
        anchors=Anchors(
            numbering=numbering,
            zones={
                tuple((x, y) for x, y in one["outline"]): Anchored(
                    item=zone_of(one["zone"]), anchor=_anchor_of(one)
                )
                for one in record["zones"]
            },
            goals={
                (x, y, yaw): Anchored(item=goal_of(one["goal"]), anchor=_anchor_of(one))
                for one in record["goals"]
                for x, y, yaw in [one["spot"]]
            },
        ),
        poses=tuple(Pose2(x_m=x, y_m=y, yaw_rad=yaw) for x, y, yaw in poses.tolist()),
    )


def placing_in(site: SiteStore, map_data: bytes | None) -> Placing:
    """Return where the contents of a site are on the map of a file."""
    kind, name = ANCHORS
    if map_data is None or name not in site.documents(kind):
        return AS_STORED
    try:
        return placing(site, *map_file.numbered_poses(map_data, site.map_file.name))
    except BadConfiguration:
        return AS_STORED  # which a damaged map does not change


def settle(site: SiteStore, numbering: str, poses: Poses) -> None:
    """Store zones, sets, missions and the mission in progress where the stored map with these
    `poses` has them, as it is loaded. Its poses are constants from then on, so that no anchor is
    needed any more. Raises `StorageFailed`."""
    with site.writing():
        found = placing(site, numbering, poses)
        moved = [
            replace(there, version=zone.version + 1)
            for zone in site.zones()
            if (there := found.zone(zone)) is not zone
        ]
        for zone in moved:
            log.warning("zone %r is moved to where the map that is loaded has it", zone.name)
        site.change_zones(moved, [])
        placed: Mapping[str, Callable[[Any], Any]] = {
            SETS: found.zone_set,
            MISSIONS: found.mission,
            MISSION[0]: found.mission,
        }
        for kind, place in placed.items():
            for name, document in site.documents(kind).items():
                if (there := place(document)) is not document:
                    site.save_document(kind, name, there)
        site.save_document(*ANCHORS, None)


def _anchor_record(anchor: Anchor) -> Record:
    poses = [(pose_id, pose.x_m, pose.y_m, pose.yaw_rad) for pose_id, pose in anchor.poses]
    return {"poses": poses, "centre": anchor.centre}


def _anchor_of(record: Record) -> Anchor:
    x_m, y_m = record["centre"]
    return Anchor(
        poses=tuple(
            (pose_id, Pose2(x_m=x, y_m=y, yaw_rad=yaw)) for pose_id, x, y, yaw in record["poses"]
        ),
        centre=(x_m, y_m),
    )
