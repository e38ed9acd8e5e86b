"""Who walks to and fro along the robot's way: where he walks is left to him, and the path leads
beside it.

People who walk are no part of the map, so the shortest path may lie in somebody's lane; he stops
before the robot that waits there for him, and both wait. After a while his lane is closed like a
zone, until the robot has passed or nobody walks there any more, but only if the way beside it is
hardly longer. A value with its transition, one for each tick.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from shapely import LineString, MultiPolygon, Point, Polygon
from shapely.ops import unary_union

from navcore.behaviours.waiting import HERE_M, STEP_S
from navcore.config.people import PeopleConfig
from navcore.control.motion import ControllerState, Motion
from navcore.geometry.transform import Pose2
from navcore.mission.zone import OWN_COLOUR, Zone
from navcore.perception.people.track import Track
from navcore.robot.profile import RobotProfile

REMEMBERED_S, REMEMBERED_M = 20.0, 8.0
"""Where somebody walked so long ago, or so far from the robot, is no longer his lane."""
SPACING_M = 0.2
"""His places are noted so far apart."""
LONGER_M = 4.0
"""For a way longer by more than this the lane is not left."""
OPEN_S = 20.0
"""A lane that was opened again is not closed for so long."""
ANEW_S = 2.0
"""So often what is closed follows where he walks, and where the robot is."""
ROOM_M = 0.15
"""Beyond the circle that the robot turns in: there the lane ends, for the robot does not stand in
what it closes."""
SMALLEST_M2 = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneKeepOut:
    """Where people have walked of late, for how long the robot has waited for them, and what of it
    is closed."""

    zones: tuple[Zone, ...] = ()
    """The lanes that are closed."""
    walked: tuple[tuple[int, int, float, float], ...] = ()
    """Stamp in ns, id, x and y in the map frame of those who walked, oldest first."""
    at: Pose2 | None = None
    """Where the robot waits …"""
    waited_s: float = 0.0
    """… and for how long it has; negative while no lane is to be closed again."""
    now_ns: int = 0
    """Stamp of the newest tick …"""
    closed_ns: int = 0
    """… and of when the lanes were closed as they are."""
    before_m: float = 0.0
    """Length of the way when the lanes were closed."""

    def after(
        self,
        motion: Motion,
        people: tuple[Track, ...],
        pose: Pose2,
        stamp_ns: int,
        *,
        way_m: float | None,
        profile: RobotProfile,
        people_config: PeopleConfig,
    ) -> LaneKeepOut:
        """With one more tick. `way_m` is the length of the way to the goal, None without one."""
        now = dataclasses.replace(
            self, now_ns=stamp_ns, walked=self._walked(people, pose, stamp_ns)
        )
        if self.zones:
            passed = not now.walked or (
                self.at is not None and self.at.distance_to(pose.x_m, pose.y_m) > REMEMBERED_M
            )
            if way_m is None or way_m > self.before_m + LONGER_M or passed:
                return dataclasses.replace(now, zones=(), waited_s=-OPEN_S)
            if (stamp_ns - self.closed_ns) / 1e9 < ANEW_S:
                return now
            return dataclasses.replace(
                now,
                zones=tuple(_lanes(now.walked, pose, profile, people_config)),
                closed_ns=stamp_ns,
            )
        moved = self.at is None or self.at.distance_to(pose.x_m, pose.y_m) > HERE_M
        step_s = min(max((stamp_ns - self.now_ns) / 1e9, 0.0), STEP_S)
        gained_s = step_s if motion.outcome is ControllerState.YIELD or self.waited_s < 0 else 0.0
        waited_s = gained_s if moved and self.waited_s >= 0 else self.waited_s + gained_s
        now = dataclasses.replace(now, at=pose if moved else self.at, waited_s=waited_s)
        if waited_s < people_config.lane_s or way_m is None:
            return now
        zones = tuple(_lanes(now.walked, pose, profile, people_config))
        return dataclasses.replace(
            now, zones=zones, closed_ns=stamp_ns, before_m=way_m, waited_s=0.0
        )

    def _walked(
        self, people: tuple[Track, ...], pose: Pose2, stamp_ns: int
    ) -> tuple[tuple[int, int, float, float], ...]:
        last = {name: (x, y) for _, name, x, y in self.walked}
        found = [note for note in self.walked if 0 <= stamp_ns - note[0] < REMEMBERED_S * 1e9]
        for one in people:
            near = pose.distance_to(one.x_m, one.y_m) < REMEMBERED_M
            x, y = last.get(one.id, (float("inf"), float("inf")))
            apart = abs(one.x_m - x) + abs(one.y_m - y) > SPACING_M
            if one.speed_mps > 0 and one.unseen_s == 0 and near and apart:
                found.append((stamp_ns, one.id, one.x_m, one.y_m))
        return tuple(found)


def _lanes(
    walked: tuple[tuple[int, int, float, float], ...],
    pose: Pose2,
    profile: RobotProfile,
    people_config: PeopleConfig,
) -> list[Zone]:
    """The strips that people walked in, as wide as they are with the room that they are left,
    without the robot's own place.

    One that lies all round the robot is none: it could not be left.
    """
    lines = []
    for name in sorted({note[1] for note in walked}):
        places = [(x, y) for _, other, x, y in walked if other == name]
        lines.append(
            (LineString(places) if len(places) > 1 else Point(places[0])).buffer(
                BODY_M + people_config.personal_m
            )
        )
    here = Point(pose.x_m, pose.y_m).buffer(profile.circumscribed_radius_m + ROOM_M)
    left = unary_union(lines).difference(here).simplify(0.05)
    parts = left.geoms if isinstance(left, MultiPolygon) else [left]
    return [
        Zone(
            id=f"lane {index}",
            name="where somebody walks to and fro",
            colour=OWN_COLOUR,
            polygon=tuple((x, y) for x, y in part.exterior.coords[:-1]),
        )
        for index, part in enumerate(parts)
        if isinstance(part, Polygon) and part.area > SMALLEST_M2 and not part.interiors
    ]


BODY_M = 0.3
"""Half of somebody's width."""
