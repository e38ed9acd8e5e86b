"""The referee: judges a run by the ground truth, with the oriented footprint, at every physics
step. It knows nothing of the navigator."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from navcore.geometry.polyline import length_m
from navcore.geometry.transform import Pose2, Twist
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.robot.profile import HUSKY, RobotProfile
from sim.models.solids import Polygon, cylinder
from sim.physics.movers import TimedMover
from sim.physics.pedestrians import BODY_DIAMETER_M
from sim.referee.clearance import Outlines, distance_m
from sim.referee.contacts import Contacts
from sim.referee.intrusions import IntrusionMonitor, Parts
from sim.referee.stops import EVERYTHING, StopLog
from sim.scenario.layout import items, obstacles
from sim.scenario.schema import Scenario
from sim.truth.shortest_path import shortest_path
from sim.truth.true_map import blocked_grid, rasterise
from sim.truth.untraversable import untraversable_ground

CONTACT_M = 0.005
"""Distance that counts as contact: the body of the model is 4 mm longer than the footprint, and the
engine keeps a margin."""
STANDING_MPS = 0.02
"""Speed of a corner of the footprint below which the robot stands."""
DISPLACED_M = 0.001
"""Displacement of an item from which it is judged at both positions; the engine's own motion of a
body at rest is less."""


class Referee:
    """Counts contacts and intrusions from its creation on; its times are seconds since then."""

    def __init__(
        self, scenario: Scenario, robot: RobotProfile = HUSKY, pose: Pose2 | None = None
    ) -> None:
        """`pose`: the true T_map_base of a robot that stands in the world already."""
        self._scenario, self._robot = scenario, robot
        fixed = obstacles(scenario)
        self._fixed = Outlines.of([entry.outlines() for entry in fixed])
        self._fixed_polygons = [outline for entry in fixed for outline in entry.outlines()]
        self._fixed_names = [entry.name for entry in fixed]
        self._items = items(scenario)
        markings = [
            (marking.name, (np.array(marking.polygon),))
            for marking in scenario.markings
            if marking.beware
        ]
        self._beware = IntrusionMonitor(
            [*((item.name, item.outlines()) for item in self._items), *markings],
            objects=len(self._items),
        )
        self._zones = IntrusionMonitor([])
        self._ground = IntrusionMonitor(
            [(area.kind, area.outlines) for area in untraversable_ground(scenario, robot)]
        )
        # That of a body on the steepest slope, with one end raised by the highest step.
        self._max_tilt_rad = math.atan(robot.max_slope) + math.atan(
            robot.max_step_m / (robot.length_m / 2)
        )
        person = cylinder(BODY_DIAMETER_M, 1.0, (0.0, 0.0), (0, 0, 0)).outline()
        self._person = (person, float(np.hypot(*person.T).max()))
        movers = [TimedMover(mover, 1.0).outline() for mover in scenario.movers]
        self._movers = [(outline, float(np.hypot(*outline.T).max())) for outline in movers]
        self._footprint = robot.footprint()
        self._began_s: float | None = None
        self._stops = StopLog()
        self._t_s = 0.0
        self._pose = pose
        self._contacts = Contacts(self._name_of, lambda number: number >= self._fixed.count)
        self._item_outlines = Outlines.of([item.outlines() for item in self._items])
        self.min_clearance_m = math.inf
        """Least distance of the footprint from any obstacle or person so far."""
        self.min_item_clearance_m = math.inf
        """The same from any item, where it lay at the start."""
        self.distance_m = 0.0
        """Distance driven by the centre of the robot."""
        self.fell = False
        """Whether the robot was ever tilted more than on the steepest slope and highest step of its
        profile: it fell over an edge, or climbed onto something."""

    def observe(
        self,
        *,
        t_s: float,
        pose: Pose2,
        rolling: Twist,
        people: Sequence[Pose2],
        period_s: float,
        items: Sequence[Pose2] = (),
        pushed_items: Collection[int] = (),
        odometry: Pose2 | None = None,
        tilt_rad: float = 0.0,
    ) -> None:
        """Judge one physics step from the true pose, the rolling of the wheels, and all moving
        bodies; `t_s` on the clock of the simulator.

        The wheels decide whether the robot drives, because a standing robot that a person pushes
        does not drive. `items`: present poses of the items of the scenario, in its order; those at
        the start when left out. `pushed_items`: numbers of those that the body pushes. `odometry`:
        the pose by odometry, which changes no verdict; the true pose when left out. `tilt_rad`: the
        true angle of the body from the vertical.
        """
        self._began_s = t_s - period_s if self._began_s is None else self._began_s
        self._t_s = t_s - self._began_s
        before = self._pose or pose
        self.distance_m += before.distance_to(pose.x_m, pose.y_m)
        self._pose = pose
        body = pose.to_parent(self._footprint)
        driving = (
            abs(rolling.v_mps) + abs(rolling.w_radps) * self._robot.circumscribed_radius_m
            > STANDING_MPS
        )
        self._judge_contacts(body, people, driving, before, rolling, period_s)
        believed = body if odometry is None else odometry.to_parent(self._footprint)
        self._beware.judge(
            body,
            believed,
            t_s=self._t_s,
            period_s=period_s,
            displaced=self._displaced(items),
            pushed=pushed_items,
        )
        _, self.min_item_clearance_m = self._item_outlines.proximity(
            body, 0.0, self.min_item_clearance_m
        )
        for areas in (self._zones, self._ground):
            areas.judge(body, believed, t_s=self._t_s, period_s=period_s, displaced={})
        self.fell = self.fell or tilt_rad > self._max_tilt_rad

    def set_zones(self, polygons: Sequence[Polygon]) -> None:
        """Replace the zones, (N, 2) corners each. A zone drawn over the robot counts once the robot
        has left it."""
        body = None if self._pose is None else self._pose.to_parent(self._footprint)
        named = [
            (f"zone {i}", (np.array(polygon, dtype=np.float64),))
            for i, polygon in enumerate(polygons, start=1)
        ]
        self._zones.replace(named, body=body)

    def note_teleport(self, pose: Pose2) -> None:
        """Note that the robot has been put at another true pose: the distance between was not
        driven, and an area that it stands in counts once it has been left."""
        self._pose = pose
        body = pose.to_parent(self._footprint)
        for areas in (self._beware, self._zones, self._ground):
            areas.excuse(body)

    @property
    def zones(self) -> tuple[Polygon, ...]:
        """The zones in force."""
        return tuple(self._zones.polygons)

    @property
    def touched(self) -> bool:
        """Whether the robot touched anything, or was touched, at whatever speed."""
        return self._contacts.touched

    @property
    def collisions(self) -> int:
        """Number of contacts that began, or went on, while the robot drove."""
        return self._contacts.collisions

    @property
    def struck_while_standing(self) -> int:
        """Number of times that a person or mover struck the standing robot."""
        return self._contacts.struck_while_standing

    @property
    def beware_intrusions(self) -> int:
        """Number of times that the footprint came over a beware marking or the original position of
        an item, or touched an item."""
        return len(self._beware.intrusions)

    @property
    def beware_intrusion_s(self) -> float:
        """Total time of the beware intrusions."""
        return self._beware.seconds

    @property
    def zone_intrusions(self) -> int:
        """Number of times that the footprint came into a zone of the operator."""
        return len(self._zones.intrusions)

    @property
    def zone_intrusion_s(self) -> float:
        """Total time of the zone intrusions."""
        return self._zones.seconds

    @property
    def ground_intrusions(self) -> int:
        """Number of times that the footprint came over ground on which the robot cannot drive: an
        edge, a slope or bumps beyond its limits."""
        return len(self._ground.intrusions)

    def note_stop(self, reason: str | None) -> None:
        """Record why the robot is held, None when it is free to move; called in every control
        cycle."""
        self._stops.note(reason, self._t_s)

    @property
    def stops(self) -> list[dict[str, Any]]:
        """t_s, duration_s and reason of every stop, including the present one."""
        return self._stops.intervals(self._t_s)

    def summary(self, part: slice = EVERYTHING) -> dict[str, Any]:
        """Return all verdicts under the names of the episode report. `part`:
        which of all contacts, intrusions and stops are listed; all are counted."""
        return {
            "distance_m": round(self.distance_m, 3),
            "collisions": self.collisions,
            "struck_while_standing": self.struck_while_standing,
            "contacts": self._contacts.log(part),
            "min_clearance_m": round(self.min_clearance_m, 4),
            "min_item_clearance_m": round(self.min_item_clearance_m, 4),
            "beware_intrusions": self.beware_intrusions,
            "beware_intrusion_s": round(self.beware_intrusion_s, 3),
            "beware_intrusion_m2s": round(self._beware.m2s, 5),
            "intruded": _by_name(self._beware),
            "zone_intrusions": self.zone_intrusions,
            "zone_intrusion_s": round(self.zone_intrusion_s, 3),
            "zone_intrusion_m2s": round(self._zones.m2s, 5),
            "ground_intrusions": self.ground_intrusions,
            "ground_intrusion_s": round(self._ground.seconds, 3),
            "ground_intruded": _by_name(self._ground),
            "fell": self.fell,
            "intrusions": sorted(
                [*self._beware.log(part), *self._zones.log(part), *self._ground.log(part)],
                key=lambda intrusion: intrusion["t_s"],
            )[part],
            "stops": self._stops.intervals(self._t_s, part),
        }

    def violations(self) -> int:
        """Return the number of collisions, intrusions and falls; 0 is a clean run."""
        intrusions = self.beware_intrusions + self.zone_intrusions + self.ground_intrusions
        return self.collisions + intrusions + self.fell

    def true_blocked(self, spec: GridSpec, inflation_m: float) -> BoolGrid:
        """Return (rows, cols), True where the centre of the robot may not be: walls, furniture,
        untraversable ground, items, beware markings and zones, inflated."""
        return blocked_grid(self._polygons(), spec, inflation_m)

    def true_cells(self, spec: GridSpec) -> tuple[BoolGrid, BoolGrid, BoolGrid]:
        """Return (rows, cols) masks of walls and furniture, of what the camera sees over (items,
        beware markings and untraversable ground), and of zones, at their original positions."""
        low = [*self._beware.polygons, *self._ground.polygons]
        fixed, zones = self._fixed_polygons, self._zones.polygons
        return rasterise(fixed, spec), rasterise(low, spec), rasterise(zones, spec)

    def shortest_m(
        self, spec: GridSpec, inflation_m: float, goals: Sequence[tuple[float, float]]
    ) -> float | None:
        """Return the length of the shortest path from the start through all goals on the true map,
        in the plane; None when there is none.

        No part of it is nearer than `inflation_m` to anything; a start that is nearer is left
        straight away.
        """
        x_m, y_m, _ = self._scenario.start
        path = shortest_path(self._polygons(), inflation_m, spec, [(x_m, y_m), *goals])
        return None if path is None else length_m(path)

    def _polygons(self) -> list[Polygon]:
        areas = (self._beware, self._zones, self._ground)
        return [*self._fixed_polygons, *(one for area in areas for one in area.polygons)]

    def _name_of(self, number: int) -> str:
        if number < self._fixed.count:
            return self._fixed_names[number]
        return "person" if number < self._fixed.count + len(self._scenario.people) else "mover"

    def _displaced(self, now: Sequence[Pose2]) -> dict[int, Parts]:
        """Return the outlines of the items that have left their original position, by number."""
        return {
            number: [pose.to_parent(solid.outline()) for solid in item.solids]
            for number, (item, pose) in enumerate(zip(self._items, now, strict=bool(now)))
            if item.pose.distance_to(pose.x_m, pose.y_m) > DISPLACED_M
        }

    def _judge_contacts(
        self,
        body: Polygon,
        people: Sequence[Pose2],
        driving: bool,
        before: Pose2,
        rolling: Twist,
        period_s: float,
    ) -> None:
        """Judge what the body touches. Fixed things are driven against by all of a step, since the
        body scrapes along them; people and movers only where it moves towards them, since they may
        follow a robot that makes way."""
        assert self._pose is not None
        touched, self.min_clearance_m = self._fixed.proximity(body, CONTACT_M, self.min_clearance_m)
        step_m = before.distance_to(self._pose.x_m, self._pose.y_m)
        turned_m = abs(rolling.w_radps) * self._robot.circumscribed_radius_m
        along = step_m, (abs(rolling.v_mps) + turned_m) * period_s
        now = {int(k): along for k in np.flatnonzero(touched)} if touched.any() else {}
        rolled = Pose2(x_m=rolling.v_mps * period_s, y_m=0.0, yaw_rad=rolling.w_radps * period_s)
        shapes = [self._person] * (len(people) - len(self._movers)) + self._movers
        for i, (person, shape) in enumerate(zip(people, shapes, strict=True)):
            gap_m = self._gap_to(person, *shape, body)
            self.min_clearance_m = min(self.min_clearance_m, gap_m)
            if gap_m <= CONTACT_M:
                there = self._pose @ rolled
                now[self._fixed.count + i] = (
                    self._advance_m(before, self._pose, person),
                    self._advance_m(self._pose, there, person),
                )
        self._contacts.judge(now, driving=driving, t_s=self._t_s)

    def _advance_m(self, before: Pose2, after: Pose2, person: Pose2) -> float:
        """Return by how much the point of the body that is nearest to the middle of a person after
        a motion has moved towards it, in metres; 0 where it has moved away."""
        centre = np.array([person.x_m, person.y_m])
        half = np.array([self._robot.length_m, self._robot.width_m]) / 2
        nearest = np.clip(after.from_parent(centre), -half, half)
        here, there = after.to_parent(nearest), before.to_parent(nearest)
        return max(0.0, math.dist(there, centre) - math.dist(here, centre))

    def _gap_to(self, person: Pose2, outline: Polygon, reach_m: float, body: Polygon) -> float:
        """Return the distance to a person, infinite for one who is neither in contact nor nearer
        than anything before."""
        assert self._pose is not None
        apart_m = (
            self._pose.distance_to(person.x_m, person.y_m)
            - self._robot.circumscribed_radius_m
            - reach_m
        )
        if apart_m > CONTACT_M and apart_m >= self.min_clearance_m:
            return math.inf
        return distance_m(body, person.to_parent(outline))


def _by_name(areas: IntrusionMonitor) -> dict[str, int]:
    """Return the number of intrusions into the areas of each name."""
    return dict(Counter(intrusion.what for intrusion in areas.intrusions))
