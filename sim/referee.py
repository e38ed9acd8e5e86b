"""Judges a run from the ground truth, with the oriented footprint, at every physics step. Knows nothing of the navigator."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from navcore.grid import BoolGrid, GridSpec
from navcore.robot import HUSKY, RobotProfile, Twist
from navcore.transform import Pose2
from sim.clearance import Outlines, distance_m
from sim.layout import beware_markings, items, obstacles
from sim.movers import Moving
from sim.people import BODY_DIAMETER_M
from sim.scenario import Scenario
from sim.shapes import Polygon, cylinder, placed
from sim.stops import StopLog
from sim.true_map import blocked_grid, shortest_way_m

CONTACT_M = 0.005
"""The model's body is 4 mm longer than the footprint, and the engine keeps a margin: nearer than this is contact."""
STANDING_MPS = 0.02
"""The wheels of a standing robot move no corner of it faster than this."""
CARRIED_ON_M = 0.1
"""A robot that was struck while standing and then moves so far without coming free collides after all."""
SERIES_PERIOD_S = 1.0


class Referee:
    """Counts what must not happen, from the moment it is made; times are seconds since then."""

    def __init__(self, scenario: Scenario, robot: RobotProfile = HUSKY) -> None:
        self._scenario, self._robot = scenario, robot
        fixed = [thing.outlines() for thing in obstacles(scenario)]
        off_limits = [thing.outlines() for thing in items(scenario)] + [(area,) for area in beware_markings(scenario)]
        self._fixed, self._beware, self._zones = Outlines.of(fixed), Outlines.of(off_limits), Outlines.of([])
        self._polygons = [outline for parts in (*fixed, *off_limits) for outline in parts]
        person = cylinder(BODY_DIAMETER_M, 1.0, (0.0, 0.0), (0, 0, 0)).outline()
        self._person = (person, float(np.hypot(*person.T).max()))
        movers = [Moving(mover, 1.0).outline() for mover in scenario.movers]
        self._movers = [(outline, float(np.hypot(*outline.T).max())) for outline in movers]
        self._zone_polygons: tuple[Polygon, ...] = ()
        self._footprint = robot.footprint()
        self._began_s: float | None = None
        self._stops = StopLog()
        self._t_s = 0.0
        self._here: Pose2 | None = None
        self._contacts: dict[int, float] = {}
        self._collided: set[int] = set()
        self._on_beware = np.zeros(self._beware.count, dtype=np.bool_)
        self._on_zone = np.zeros(0, dtype=np.bool_)
        self._excused = np.zeros(0, dtype=np.bool_)
        self._series: tuple[list[float], list[float]] = ([], [])
        self.collisions = 0
        """Contacts that began, or went on, while the robot drove."""
        self.struck_while_standing = 0
        """Times that somebody walked into the standing robot."""
        self.min_clearance_m = math.inf
        """Least distance of the footprint from any obstacle or person so far."""
        self.beware_intrusions = 0
        """Times that the footprint came over a beware marking, or over the place where an item lay at the start."""
        self.beware_intrusion_s = 0.0
        """How long it was there."""
        self.zone_intrusions = 0
        """Times that the footprint came into a zone of the operator."""
        self.zone_intrusion_s = 0.0
        """How long it was there."""
        self.distance_m = 0.0
        """Way of the robot's middle."""

    def observe(self, *, t_s: float, pose: Pose2, rolling: Twist, people: Sequence[Pose2], period_s: float) -> None:
        """Judge one physics step from the true pose, what its wheels do, and all that moves; `t_s` on the simulator's clock.

        By its wheels, because a standing robot that somebody pushes does not drive.
        """
        self._began_s = t_s - period_s if self._began_s is None else self._began_s
        self._t_s = t_s - self._began_s
        if self._here is not None:
            self.distance_m += self._here.distance_to(pose.x_m, pose.y_m)
        self._here = pose
        body = placed(self._footprint, pose)
        drives = abs(rolling.v_mps) + abs(rolling.w_radps) * self._robot.circumscribed_radius_m > STANDING_MPS
        self._judge_contacts(body, people, drives)
        self._judge_areas(body, period_s)
        self._sample()

    def set_zones(self, polygons: Sequence[Polygon]) -> None:
        """Judge by these zones, (N, 2) each, from now on. A zone drawn over the robot counts once it has left it."""
        before = {
            _key(p): (on, excused) for p, on, excused in zip(self._zone_polygons, self._on_zone, self._excused, strict=True)
        }
        self._zone_polygons = tuple(np.array(polygon, dtype=np.float64) for polygon in polygons)
        self._zones = Outlines.of([(polygon,) for polygon in self._zone_polygons])
        inside = np.zeros(self._zones.count, dtype=np.bool_)
        if self._here is not None:
            inside, _ = self._zones.near(placed(self._footprint, self._here), 0.0, 0.0)
        states = [before.get(_key(p), (False, now)) for p, now in zip(self._zone_polygons, inside, strict=True)]
        self._on_zone = np.array([on for on, _ in states], dtype=np.bool_)
        self._excused = np.array([excused for _, excused in states], dtype=np.bool_)

    @property
    def zones(self) -> tuple[Polygon, ...]:
        """The zones judged by."""
        return self._zone_polygons

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
        return float(np.interp(t_s, [0.0, *self._series[0], self._t_s], [0.0, *self._series[1], self.distance_m]))

    def summary(self) -> dict[str, Any]:
        """All verdicts under the names of the episode report, without the series."""
        return {
            "distance_m": round(self.distance_m, 3),
            "collisions": self.collisions,
            "struck_while_standing": self.struck_while_standing,
            "min_clearance_m": round(self.min_clearance_m, 4),
            "beware_intrusions": self.beware_intrusions,
            "beware_intrusion_s": round(self.beware_intrusion_s, 3),
            "zone_intrusions": self.zone_intrusions,
            "zone_intrusion_s": round(self.zone_intrusion_s, 3),
            "stops": self.stops,
        }

    def violations(self) -> int:
        """Collisions and intrusions; 0 is a clean run."""
        return self.collisions + self.beware_intrusions + self.zone_intrusions

    def true_blocked(self, spec: GridSpec, inflation_m: float) -> BoolGrid:
        """(rows, cols) where the robot's centre may not be: walls, furniture, items and beware markings, inflated."""
        return blocked_grid(self._polygons, spec, inflation_m)

    def shortest_m(self, spec: GridSpec, inflation_m: float, goals: Sequence[tuple[float, float]]) -> float | None:
        """Shortest way from the start through all goals on the true map; None when there is none."""
        x_m, y_m, _ = self._scenario.start
        return shortest_way_m(self.true_blocked(spec, inflation_m), spec, (x_m, y_m), goals)

    def _judge_contacts(self, body: Polygon, people: Sequence[Pose2], drives: bool) -> None:
        touched, self.min_clearance_m = self._fixed.near(body, CONTACT_M, self.min_clearance_m)
        now = {int(k) for k in np.flatnonzero(touched)} if touched.any() else set()
        shapes = [self._person] * (len(people) - len(self._movers)) + self._movers
        for i, (person, shape) in enumerate(zip(people, shapes, strict=True)):
            gap_m = self._gap_to(person, *shape, body)
            self.min_clearance_m = min(self.min_clearance_m, gap_m)
            if gap_m <= CONTACT_M:
                now.add(self._fixed.count + i)
        self._count_contacts(now, drives)

    def _gap_to(self, person: Pose2, outline: Polygon, reach_m: float, body: Polygon) -> float:
        """Exact where it matters: infinite for somebody who is neither in contact nor nearer than anything before."""
        assert self._here is not None
        apart_m = self._here.distance_to(person.x_m, person.y_m) - self._robot.circumscribed_radius_m - reach_m
        if apart_m > CONTACT_M and apart_m >= self.min_clearance_m:
            return math.inf
        return distance_m(body, placed(outline, person))

    def _count_contacts(self, now: set[int], drives: bool) -> None:
        """Each contact counts once: as a collision, or as a blow that the standing robot took."""
        for thing in now:
            new = thing not in self._contacts
            if new:
                self._contacts[thing] = self.distance_m
                self.struck_while_standing += not drives and thing >= self._fixed.count
            carried = self.distance_m - self._contacts[thing] > CARRIED_ON_M
            if thing not in self._collided and drives and (new or carried):
                self._collided.add(thing)
                self.collisions += 1
        self._contacts = {thing: since for thing, since in self._contacts.items() if thing in now}
        self._collided &= now

    def _judge_areas(self, body: Polygon, period_s: float) -> None:
        on_beware, _ = self._beware.near(body, 0.0, 0.0)
        self.beware_intrusions += int((on_beware & ~self._on_beware).sum())
        self.beware_intrusion_s += period_s * bool(on_beware.any())
        self._on_beware = on_beware
        if not self._zones.count:
            return
        in_zone, _ = self._zones.near(body, 0.0, 0.0)
        self._excused &= in_zone
        on_zone: npt.NDArray[np.bool_] = in_zone & ~self._excused
        self.zone_intrusions += int((on_zone & ~self._on_zone).sum())
        self.zone_intrusion_s += period_s * bool(on_zone.any())
        self._on_zone = on_zone

    def _sample(self) -> None:
        if self._t_s >= len(self._series[0]) * SERIES_PERIOD_S:
            self._series[0].append(self._t_s)
            self._series[1].append(self.distance_m)


def _key(polygon: Polygon) -> bytes:
    return polygon.tobytes()
