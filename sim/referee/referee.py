"""Judges a run from the ground truth, with the oriented footprint, at every physics step. Knows
nothing of the navigator."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from navcore.geometry.transform import Pose2, Twist
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.robot.profile import HUSKY, RobotProfile
from sim.models.solids import Polygon, cylinder, placed
from sim.physics.movers import Moving
from sim.physics.pedestrians import BODY_DIAMETER_M
from sim.referee.clearance import Outlines, distance_m
from sim.referee.contacts import Contacts
from sim.referee.intrusions import IntrusionMonitor, Parts
from sim.referee.stops import StopLog
from sim.scenario.layout import items, obstacles
from sim.scenario.schema import Scenario
from sim.truth.shortest_path import length_m, shortest_way
from sim.truth.true_map import blocked_grid, rasterise

CONTACT_M = 0.005
"""The model's body is 4 mm longer than the footprint, and the engine keeps a margin: nearer than
this is contact."""
STANDING_MPS = 0.02
"""The wheels of a standing robot move no corner of it faster than this."""
SHOVED_M = 0.01
"""An item that lies so far from where it lay at the start is judged at both places."""
SERIES_PERIOD_S = 1.0


class Referee:
    """Counts what must not happen, from the moment it is made; times are seconds since then."""

    def __init__(self, scenario: Scenario, robot: RobotProfile = HUSKY) -> None:
        self._scenario, self._robot = scenario, robot
        fixed = obstacles(scenario)
        self._fixed = Outlines.of([thing.outlines() for thing in fixed])
        self._fixed_polygons = [outline for thing in fixed for outline in thing.outlines()]
        self._fixed_names = [thing.name for thing in fixed]
        self._items = items(scenario)
        markings = [
            (marking.name, (np.array(marking.polygon),))
            for marking in scenario.markings
            if marking.beware
        ]
        self._beware = IntrusionMonitor(
            [*((item.name, item.outlines()) for item in self._items), *markings]
        )
        self._zones = IntrusionMonitor([])
        person = cylinder(BODY_DIAMETER_M, 1.0, (0.0, 0.0), (0, 0, 0)).outline()
        self._person = (person, float(np.hypot(*person.T).max()))
        movers = [Moving(mover, 1.0).outline() for mover in scenario.movers]
        self._movers = [(outline, float(np.hypot(*outline.T).max())) for outline in movers]
        self._footprint = robot.footprint()
        self._began_s: float | None = None
        self._stops = StopLog()
        self._t_s = 0.0
        self._here: Pose2 | None = None
        self._contacts = Contacts(self._name_of, lambda thing: thing >= self._fixed.count)
        self._series: tuple[list[float], list[float]] = ([], [])
        self.min_clearance_m = math.inf
        """Least distance of the footprint from any obstacle or person so far."""
        self.distance_m = 0.0
        """Way of the robot's middle."""

    def observe(
        self,
        *,
        t_s: float,
        pose: Pose2,
        rolling: Twist,
        people: Sequence[Pose2],
        period_s: float,
        items: Sequence[Pose2] = (),
        odometry: Pose2 | None = None,
    ) -> None:
        """Judge one physics step from the true pose, what its wheels do, and all that moves; `t_s`
        on the simulator's clock.

        By its wheels, because a standing robot that somebody pushes does not drive. `items`: where
        the scenario's items are now, in its order; where they were at the start when left out.
        `odometry`: where the robot takes itself to be, which changes no verdict; where it is when
        left out.
        """
        self._began_s = t_s - period_s if self._began_s is None else self._began_s
        self._t_s = t_s - self._began_s
        if self._here is not None:
            self.distance_m += self._here.distance_to(pose.x_m, pose.y_m)
        self._here = pose
        body = placed(self._footprint, pose)
        drives = (
            abs(rolling.v_mps) + abs(rolling.w_radps) * self._robot.circumscribed_radius_m
            > STANDING_MPS
        )
        self._judge_contacts(body, people, drives)
        believed = body if odometry is None else placed(self._footprint, odometry)
        self._beware.judge(
            body, believed, t_s=self._t_s, period_s=period_s, displaced=self._shoved(items)
        )
        self._zones.judge(body, believed, t_s=self._t_s, period_s=period_s, displaced={})
        self._sample()

    def set_zones(self, polygons: Sequence[Polygon]) -> None:
        """Judge by these zones, (N, 2) each, from now on. A zone drawn over the robot counts once
        it has left it."""
        body = None if self._here is None else placed(self._footprint, self._here)
        named = [
            (f"zone {i}", (np.array(polygon, dtype=np.float64),))
            for i, polygon in enumerate(polygons, start=1)
        ]
        self._zones.replace(named, body=body)

    @property
    def zones(self) -> tuple[Polygon, ...]:
        """The zones judged by."""
        return tuple(self._zones.polygons)

    @property
    def collisions(self) -> int:
        """Contacts that began, or went on, while the robot drove."""
        return self._contacts.collisions

    @property
    def struck_while_standing(self) -> int:
        """Times that somebody walked into the standing robot."""
        return self._contacts.struck_while_standing

    @property
    def beware_intrusions(self) -> int:
        """Times that the footprint came over a beware marking, the place where an item lay at the
        start, or an item."""
        return len(self._beware.intrusions)

    @property
    def beware_intrusion_s(self) -> float:
        """How long it was there."""
        return self._beware.seconds

    @property
    def zone_intrusions(self) -> int:
        """Times that the footprint came into a zone of the operator."""
        return len(self._zones.intrusions)

    @property
    def zone_intrusion_s(self) -> float:
        """How long it was there."""
        return self._zones.seconds

    def note_stop(self, reason: str | None) -> None:
        """Say why the robot is held, None when it is free to move; called in every control cycle."""
        self._stops.note(reason, self._t_s)

    @property
    def stops(self) -> list[dict[str, Any]]:
        """t_s, duration_s and reason of every stop, the present one included."""
        return self._stops.intervals(self._t_s)

    @property
    def series(self) -> dict[str, list[float]]:
        """t_s and distance_m, once a second."""
        return {"t_s": list(self._series[0]), "distance_m": list(self._series[1])}

    def distance_at(self, t_s: float) -> float:
        """Way driven until `t_s`, from the series."""
        return float(
            np.interp(
                t_s, [0.0, *self._series[0], self._t_s], [0.0, *self._series[1], self.distance_m]
            )
        )

    def summary(self) -> dict[str, Any]:
        """All verdicts under the names of the episode report, without the series."""
        return {
            "distance_m": round(self.distance_m, 3),
            "collisions": self.collisions,
            "struck_while_standing": self.struck_while_standing,
            "contacts": self._contacts.log(),
            "min_clearance_m": round(self.min_clearance_m, 4),
            "beware_intrusions": self.beware_intrusions,
            "beware_intrusion_s": round(self.beware_intrusion_s, 3),
            "beware_intrusion_m2s": round(self._beware.m2s, 5),
            "intruded": dict(Counter(intrusion.what for intrusion in self._beware.intrusions)),
            "zone_intrusions": self.zone_intrusions,
            "zone_intrusion_s": round(self.zone_intrusion_s, 3),
            "zone_intrusion_m2s": round(self._zones.m2s, 5),
            "intrusions": sorted(
                [*self._beware.log(), *self._zones.log()], key=lambda intrusion: intrusion["t_s"]
            ),
            "stops": self.stops,
        }

    def violations(self) -> int:
        """Collisions and intrusions; 0 is a clean run."""
        return self.collisions + self.beware_intrusions + self.zone_intrusions

    def true_blocked(self, spec: GridSpec, inflation_m: float) -> BoolGrid:
        """(rows, cols) where the robot's centre may not be: walls, furniture, items, beware
        markings and zones, inflated."""
        return blocked_grid(self._polygons(), spec, inflation_m)

    def true_cells(self, spec: GridSpec) -> tuple[BoolGrid, BoolGrid, BoolGrid]:
        """(rows, cols) each: walls and furniture; items and beware markings; zones. Where they were
        at the start."""
        fixed, beware, zones = self._fixed_polygons, self._beware.polygons, self._zones.polygons
        return rasterise(fixed, spec), rasterise(beware, spec), rasterise(zones, spec)

    def shortest_m(
        self, spec: GridSpec, inflation_m: float, goals: Sequence[tuple[float, float]]
    ) -> float | None:
        """Shortest way from the start through all goals for who knows the true map, in the plane;
        None when there is none.

        No part of it is nearer than `inflation_m` to anything; a start that is nearer is left
        straight away.
        """
        x_m, y_m, _ = self._scenario.start
        way = shortest_way(self._polygons(), inflation_m, spec, [(x_m, y_m), *goals])
        return None if way is None else length_m(way)

    def _polygons(self) -> list[Polygon]:
        return [*self._fixed_polygons, *self._beware.polygons, *self._zones.polygons]

    def _name_of(self, thing: int) -> str:
        if thing < self._fixed.count:
            return self._fixed_names[thing]
        return "person" if thing < self._fixed.count + len(self._scenario.people) else "mover"

    def _shoved(self, now: Sequence[Pose2]) -> dict[int, Parts]:
        """Outlines of the items that are no longer where they lay at the start, by number."""
        return {
            number: [placed(solid.outline(), pose) for solid in item.solids]
            for number, (item, pose) in enumerate(zip(self._items, now, strict=bool(now)))
            if item.pose.distance_to(pose.x_m, pose.y_m) > SHOVED_M
        }

    def _judge_contacts(self, body: Polygon, people: Sequence[Pose2], drives: bool) -> None:
        touched, self.min_clearance_m = self._fixed.near(body, CONTACT_M, self.min_clearance_m)
        now = {int(k) for k in np.flatnonzero(touched)} if touched.any() else set()
        shapes = [self._person] * (len(people) - len(self._movers)) + self._movers
        for i, (person, shape) in enumerate(zip(people, shapes, strict=True)):
            gap_m = self._gap_to(person, *shape, body)
            self.min_clearance_m = min(self.min_clearance_m, gap_m)
            if gap_m <= CONTACT_M:
                now.add(self._fixed.count + i)
        self._contacts.judge(now, drives=drives, t_s=self._t_s, driven_m=self.distance_m)

    def _gap_to(self, person: Pose2, outline: Polygon, reach_m: float, body: Polygon) -> float:
        """Exact where it matters: infinite for somebody who is neither in contact nor nearer than
        anything before."""
        assert self._here is not None
        apart_m = (
            self._here.distance_to(person.x_m, person.y_m)
            - self._robot.circumscribed_radius_m
            - reach_m
        )
        if apart_m > CONTACT_M and apart_m >= self.min_clearance_m:
            return math.inf
        return distance_m(body, placed(outline, person))

    def _sample(self) -> None:
        if self._t_s >= len(self._series[0]) * SERIES_PERIOD_S:
            self._series[0].append(self._t_s)
            self._series[1].append(self.distance_m)
