"""Keep-out zones along the lanes of people who walk to and fro.

People who walk are not part of the map, so the shortest path may follow the lane of a person; the
person stops before the robot that waits for them, and both wait. After a while the lane is closed
like a zone, until the robot has passed or no person walks there any more, but only if the route
beside it is hardly longer.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from shapely import LineString, MultiPolygon, Point, Polygon
from shapely.ops import unary_union

from navcore.behaviours.waiting import elapsed_s
from navcore.config.behaviours import BehavioursConfig, LaneConfig
from navcore.config.people import PeopleConfig
from navcore.control.motion import ControllerState, Motion
from navcore.geometry.arrays import Points
from navcore.geometry.transform import Pose2
from navcore.mission.zone import OWN_COLOUR, Zone
from navcore.perception.people.track import Track
from navcore.robot.profile import RobotProfile

_DEFAULT = BehavioursConfig()
Walked = tuple[tuple[int, int, float, float], ...]
"""Stamp in nanoseconds, track id, x and y in metres of the map frame of people who walked."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneKeepOut:
    """A value with its transition, one for each tick."""

    zones: tuple[Zone, ...] = ()
    """Closed lanes."""
    walked: Walked = ()
    """Recent positions of people who walk, oldest first."""
    at: Pose2 | None = None
    """Pose where the robot waits, map frame; None before it waits."""
    waited_s: float = 0.0
    """Time in seconds for which it has waited there; negative while no lane may be closed again."""
    now_ns: int = 0
    """Stamp of the newest tick in nanoseconds."""
    closed_ns: int = 0
    """Stamp in nanoseconds at which the closed lanes were last updated."""
    before_m: float = 0.0
    """Length of the route in metres when the lanes were closed."""

    @property
    def walked_positions(self) -> Points:
        """(N, 2) recent positions of people who walk, map frame."""
        return np.array([note[2:] for note in self.walked]).reshape(-1, 2)

    def after(
        self,
        motion: Motion,
        people: tuple[Track, ...],
        pose: Pose2,
        stamp_ns: int,
        *,
        route_m: float | None,
        profile: RobotProfile,
        people_config: PeopleConfig,
        config: BehavioursConfig = _DEFAULT,
    ) -> LaneKeepOut:
        """Return the state after one more tick. `route_m` is the length of the route to the goal in
        metres, None without one."""
        rules, walked = config.lanes, self._walked(people, pose, stamp_ns, config.lanes)
        now = dataclasses.replace(self, now_ns=stamp_ns, walked=walked)
        if self.zones:
            return now._while_closed(pose, route_m, profile, people_config, rules)
        moved = self._distance_m(pose) > config.waiting.position_m
        step_s = elapsed_s(self.now_ns, stamp_ns, config.waiting)
        waits = motion.outcome is ControllerState.WAIT_FOR_PEOPLE or self.waited_s < 0
        gained_s = step_s if waits else 0.0
        waited_s = gained_s if moved and self.waited_s >= 0 else self.waited_s + gained_s
        now = dataclasses.replace(now, at=pose if moved else self.at, waited_s=waited_s)
        if waited_s < people_config.lane_s or route_m is None:
            return now
        zones = tuple(_lanes(now.walked, pose, profile, people_config, rules))
        return dataclasses.replace(
            now, zones=zones, closed_ns=stamp_ns, before_m=route_m, waited_s=0.0
        )

    def _while_closed(
        self,
        pose: Pose2,
        route_m: float | None,
        profile: RobotProfile,
        people_config: PeopleConfig,
        rules: LaneConfig,
    ) -> LaneKeepOut:
        passed = not self.walked or (
            self.at is not None and self._distance_m(pose) > rules.remembered_m
        )
        if route_m is None or route_m > self.before_m + rules.max_detour_m or passed:
            return dataclasses.replace(self, zones=(), waited_s=-rules.reopened_s)
        if (self.now_ns - self.closed_ns) / 1e9 < rules.update_s:
            return self
        zones = tuple(_lanes(self.walked, pose, profile, people_config, rules))
        return dataclasses.replace(self, zones=zones, closed_ns=self.now_ns)

    def _distance_m(self, pose: Pose2) -> float:
        return math.inf if self.at is None else self.at.distance_to(pose.x_m, pose.y_m)

    def _walked(
        self, people: tuple[Track, ...], pose: Pose2, stamp_ns: int, rules: LaneConfig
    ) -> Walked:
        life_ns = rules.remembered_s * 1e9
        old = next((i for i, note in enumerate(self.walked) if stamp_ns - note[0] < life_ns), None)
        found = [] if old is None else list(self.walked[old:])
        while found and found[-1][0] > stamp_ns:
            found.pop()
        for person in people:
            near = pose.distance_to(person.x_m, person.y_m) < rules.remembered_m
            if not near or person.unseen_s > 0 or person.speed_mps == 0:
                continue
            last = (note for note in reversed(self.walked) if note[1] == person.id)
            _, _, x, y = next(last, (0, 0, math.inf, math.inf))
            if abs(person.x_m - x) + abs(person.y_m - y) > rules.spacing_m:
                found.append((stamp_ns, person.id, person.x_m, person.y_m))
        return tuple(found)


def _lanes(
    walked: Walked,
    pose: Pose2,
    profile: RobotProfile,
    people_config: PeopleConfig,
    rules: LaneConfig,
) -> list[Zone]:
    """Return the strips in which people walked, as wide as a person with their personal distance.

    The circle that the robot turns in is left free, and a strip that surrounds the robot is left
    out: the robot could not leave it.
    """
    lines, width_m = [], rules.person_radius_m + people_config.personal_m
    for track_id in sorted({note[1] for note in walked}):
        points = [(x, y) for _, other, x, y in walked if other == track_id]
        line = LineString(points) if len(points) > 1 else Point(points[0])
        lines.append(line.buffer(width_m))
    here = Point(pose.x_m, pose.y_m).buffer(profile.circumscribed_radius_m + rules.gap_m)
    left = unary_union(lines).difference(here).simplify(rules.simplify_m)
    parts = left.geoms if isinstance(left, MultiPolygon) else [left]
    return [
        Zone(
            id=f"lane {index}",
            name="where a person walks to and fro",
            colour=OWN_COLOUR,
            polygon=tuple((x, y) for x, y in part.exterior.coords[:-1]),
        )
        for index, part in enumerate(parts)
        if isinstance(part, Polygon) and part.area > rules.min_area_m2 and not part.interiors
    ]
