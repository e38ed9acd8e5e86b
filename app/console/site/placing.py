"""Where the contents of a site are on its stored map.

Zones and goals are stored as soon as a correction has moved them, the map that was corrected some
seconds later. Where both are of different moments (a kill in between, a copy or an export while
the robot drives) the poses of the stored map tell where each zone and goal belongs on it.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
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
from navcore.mission.anchor import NO_POSES, NumberedPoses
from navcore.mission.anchors import placed

MISSION = ("mission in progress", "mission")
"""Kind and name of the stored document."""
Record = Mapping[str, Any]
log = logging.getLogger(__name__)


def numbered(numbering: str, poses: npt.NDArray[np.float64]) -> NumberedPoses:
    """Return the (P, 3) poses of a stored map, whose IDs are of a numbering."""
    return NumberedPoses(
        numbering=numbering,
        poses=tuple(Pose2(x_m=x, y_m=y, yaw_rad=yaw) for x, y, yaw in poses.tolist()),
    )


def poses_of_file(map_data: bytes | None, where: str) -> NumberedPoses:
    """Return the poses of a map file; none without one, and for a damaged one."""
    if map_data is None:
        return NO_POSES
    try:
        return numbered(*map_file.numbered_poses(map_data, where))
    except BadConfiguration:
        return NO_POSES


def zones_on(records: Sequence[Record], poses: NumberedPoses) -> Sequence[Record]:
    """Return the records of stored zones where a map has them; the same ones where all stay."""
    zones = list(map(zone_of, records))
    there = [placed(zone, poses) for zone in zones]
    return records if there == zones else list(map(zone_record, there))


def mission_on(record: Record, poses: NumberedPoses) -> Record:
    """Return the record of a saved mission, or of that in progress, with its waiting goals where a
    map has them; the same one where all stay."""
    waiting = "goals" if "goals" in record else "queue"
    goals = list(map(goal_of, record[waiting]))
    there = [placed(goal, poses) for goal in goals]
    if there == goals:
        return record
    moved = zip(record[waiting], there, strict=True)
    return {**record, waiting: [{**goal, **goal_record(now)} for goal, now in moved]}


def settle(site: SiteStore, poses: NumberedPoses) -> None:
    """Store zones, sets, missions and the mission in progress where a stored map has them, as it is
    loaded: all or nothing. Raises `StorageFailed`."""
    with site.writing():
        moved = [
            replace(there, version=zone.version + 1)
            for zone in site.zones()
            if (there := placed(zone, poses)) is not zone
        ]
        for zone in moved:
            log.warning("zone %r is moved to where the map that is loaded has it", zone.name)
        site.change_zones(moved, [])
        documents: Mapping[str, Callable[[Any, NumberedPoses], Any]] = {
            SETS: zones_on,
            MISSIONS: mission_on,
            MISSION[0]: mission_on,
        }
        for kind, on_map in documents.items():
            for name, document in site.documents(kind).items():
                if (there := on_map(document, poses)) is not document:
                    site.save_document(kind, name, there)
