"""Margins of zones that follow the robot's uncertainty relative to each zone.

A zone belongs to the place beside which it was drawn. What counts is how uncertain the robot's
position has become since it was there, not how uncertain it is in the map: a zone drawn beside the
robot is exact however far it has come by dead reckoning. Since then it has become no more uncertain
than by its motion and by what absolute positions have moved it, and no more than place and robot
are in the map, together: a zone that was drawn at the start is kept by the position in the map,
which is well known again where the robot comes back.

With the margin that the planner keeps besides, the growth is more than that of the safety gate:
where the planner leads, the gate lets pass.

Where the position is so uncertain that the safety gate slows the robot down beside the zone, the
zone has a clearance besides, so that the path leads round at a distance. The clearance gives way to
a robot that is nearer already, which can then drive away, and it is given up where no path keeps
it: the robot passes slowly.

The growth itself may come over a robot beside the zone, which then drives out of it before it goes
on to its goal (`navcore.control.motions.growth_exit`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import shapely

from navcore.config.localisation.zone_margins import ZoneMarginConfig
from navcore.config.safety import DEFAULT_SAFETY, KeepOutMonitorConfig
from navcore.geometry.transform import Matrix, Pose2, growth
from navcore.localisation.estimate import LocalisationEstimate
from navcore.mission.zone import Zone
from navcore.mission.zone_growth import (
    GrownZone,
    beyond_margin,
    covering,
    distance_m,
    grow,
    largest_axis_m,
    relative_distance,
    spread_of,
)
from navcore.robot.profile import RobotProfile

_ZERO = np.zeros((2, 2))
_EXACT = np.zeros((2, 2, 2))
_DEFAULT = ZoneMarginConfig()


@dataclass(slots=True, eq=False)
class _Margin:
    """What is known of one version of a zone."""

    anchor: Matrix
    """(2, 2, 2) covariances of the robot's position when it was beside the zone, in the map and by
    motion."""
    grown: Zone
    """The zone, grown by what the covariance asks for beyond the safety margin."""
    covariance: Matrix = field(default_factory=lambda: _ZERO)
    """(2, 2) covariance by which the zone is grown at present."""
    clearance_m: float = 0.0
    """Distance in metres that is kept from the grown zone besides."""
    cleared: Zone | None = None
    """The grown zone with its clearance, if it has one."""
    covers_robot: bool = False
    """Whether the robot is in the growth, and not in the zone itself."""


class ZoneMargins:
    """Grows the zones of an operator as the robot's uncertainty grows, in steps: every change costs
    a new costmap."""

    def __init__(
        self,
        profile: RobotProfile,
        config: ZoneMarginConfig = _DEFAULT,
        *,
        safety_margin_m: float,
        frozen: bool = False,
        gate: KeepOutMonitorConfig = DEFAULT_SAFETY.keep_out,
    ) -> None:
        """`safety_margin_m`: of the inflation; with `frozen` the map was loaded, and its zones
        belong to its own frame."""
        self._config, self._gate, self._frozen = config, gate, frozen
        self._footprint = profile.footprint()
        self._safety_margin_m = safety_margin_m
        self._inflation_m = profile.width_m / 2 + safety_margin_m
        self._margins: dict[tuple[str, int], _Margin] = {}
        self._trail: dict[tuple[int, int], tuple[float, float, Matrix]] = {}
        """The newest position in each cell of a coarse grid that the robot was in, in metres, and
        the (2, 2, 2) covariances there, in the map and by motion."""
        self._gives_up = False

    def follow(self, zones: tuple[Zone, ...], place: LocalisationEstimate) -> tuple[Zone, ...]:
        """Return the zones, grown by the present uncertainty; the same objects as long as their
        growth has not changed."""
        if place.is_known:
            self._note(place)
        keys = {(zone.id, zone.version) for zone in zones}
        self._margins = {key: one for key, one in self._margins.items() if key in keys}
        return tuple(self._grown(zone, place) for zone in zones)

    @property
    def keeps_clearance(self) -> bool:
        """Whether any zone has a clearance."""
        return any(margin.clearance_m > 0 for margin in self._margins.values())

    def give_up_clearance(self) -> None:
        """Keep no clearance from now on: no path does."""
        self._gives_up = True

    def restore_clearance(self) -> None:
        """Keep clearances again, as for another goal."""
        self._gives_up = False

    def near(
        self,
        zones: tuple[Zone, ...],
        place: LocalisationEstimate,
        reach_m: float,
        besides_m: float,
    ) -> tuple[GrownZone, ...]:
        """Return the closed zones within `reach_m` of the robot's middle as the safety gate grows
        them, or by less where the robot is nearer: by `besides_m` less than up to its body, so that
        it may stay as near as it is, and move along there. `follow` has to be called before."""
        here, found = place.T_map_base, []
        outline = here.to_parent(self._footprint)[None]
        middle = np.array([shapely.points(here.x_m, here.y_m)])
        most_m = self._gate.sigmas * math.sqrt(float(np.trace(self._by_motion(place))))
        for zone in zones:
            if not zone.closed or float(distance_m(zone, middle)[0]) > reach_m + most_m:
                continue
            spread = spread_of(covering(self.covariance(zone, place)), self._gate.sigmas)
            growth_m = largest_axis_m(spread)
            if growth_m > self._config.negligible_m:
                now = float(relative_distance(zone, spread, outline)[0])
                share = np.clip(now - besides_m / growth_m, 0.0, 1.0)
                found.append(GrownZone(zone, share * spread))
        return tuple(found)

    def covering_robot(
        self, zones: tuple[Zone, ...], place: LocalisationEstimate
    ) -> tuple[GrownZone, ...]:
        """Return the zones, as the safety gate grows them, whose growth the robot is in, but not
        in the zone itself. `follow` has to be called before."""
        if not zones:
            return ()
        body = np.array([shapely.polygons(place.T_map_base.to_parent(self._footprint))])
        found = []
        for zone in zones:
            margin = self._margins[zone.id, zone.version]
            least_m = self._config.body_gap_m if margin.covers_robot else self._config.within_m
            margin.covers_robot = (
                zone.closed
                and margin.grown is not zone
                and float(distance_m(margin.grown, body)[0]) < least_m
                and float(distance_m(zone, body)[0]) > 0
            )
            if margin.covers_robot:
                needed = covering(self.covariance(zone, place))
                found.append(GrownZone(zone, spread_of(needed, self._gate.sigmas)))
        return tuple(found)

    def covariance(self, zone: Zone, place: LocalisationEstimate) -> Matrix:
        """Return the (2, 2) covariance of the robot's position relative to a zone, square
        metres."""
        margin = self._margins.get((zone.id, zone.version))
        in_map, by_motion = _EXACT if margin is None else margin.anchor
        since = growth(self._by_motion(place), by_motion)
        both = place.positions[0] + in_map
        return np.asarray(min(since, both, key=lambda bound: float(np.linalg.eigvalsh(bound)[-1])))

    def covariances(
        self, zones: tuple[Zone, ...], place: LocalisationEstimate
    ) -> dict[str, Matrix]:
        """Return the covariance relative to each zone by its id."""
        return {zone.id: self.covariance(zone, place) for zone in zones}

    def _by_motion(self, place: LocalisationEstimate) -> Matrix:
        """Return the (2, 2) covariance of the position by motion: in a loaded map the one in it,
        which its zones belong to."""
        return np.asarray(place.positions[1]) if self._frozen else place.relative

    def _grown(self, zone: Zone, place: LocalisationEstimate) -> Zone:
        margin = self._margins.get((zone.id, zone.version))
        if margin is None:
            margin = _Margin(anchor=self._anchor(zone), grown=zone)
            self._margins[zone.id, zone.version] = margin
        covariance, config = self.covariance(zone, place), self._config
        growth_m = largest_axis_m(spread_of(covariance, self._gate.sigmas))
        if growth_m <= config.negligible_m:
            margin.covariance, margin.grown, margin.clearance_m = _ZERO, zone, 0.0
            return zone
        kept_m = largest_axis_m(spread_of(margin.covariance, self._gate.sigmas))
        needed = covering(covariance)
        # An ellipse contains another one if the difference of the covariances has no negative
        # eigenvalue.
        suffices = np.linalg.eigvalsh(margin.covariance - needed)[0] >= 0
        if not suffices or kept_m > config.kept_ratio * (growth_m + config.step_m):
            slack = (1 + config.slack) * needed + config.step_m**2 * np.eye(2)
            margin.covariance, margin.cleared = slack, None
            margin.grown = grow(zone, self._planned(slack, zone))
        keeps = zone.closed and not self._gives_up
        clearance_m = self._clearance_m(margin, growth_m, place.T_map_base) if keeps else 0.0
        if not clearance_m:
            margin.clearance_m = 0.0
            return margin.grown
        if margin.cleared is None or margin.clearance_m != clearance_m:
            spread = self._planned(margin.covariance, zone) + clearance_m * np.eye(2)
            margin.clearance_m, margin.cleared = clearance_m, grow(zone, spread)
        return margin.cleared

    def _planned(self, covariance: Matrix, zone: Zone) -> Matrix:
        """Return the ellipse by which a zone is grown: beyond the safety margin, which the planner
        keeps from closed zones besides."""
        spread = spread_of(covariance, self._gate.sigmas)
        return beyond_margin(spread, self._safety_margin_m) if zone.closed else spread

    def _clearance_m(self, margin: _Margin, growth_m: float, pose: Pose2) -> float:
        """Return the clearance of a zone in metres: the whole, or what a robot that is nearer
        leaves of it."""
        config, gate = self._config, self._gate
        kept_m = margin.clearance_m
        if growth_m <= gate.largest_growth_m / (1 + config.slack if kept_m else 1):
            return 0.0
        body = shapely.polygons(pose.to_parent(self._footprint))
        base = shapely.points(pose.x_m, pose.y_m)
        body_m, base_m = distance_m(margin.grown, np.array([body, base]))
        room_m = float(min(base_m - self._inflation_m, body_m - config.body_gap_m))
        room_m = min(max(room_m, 0.0), gate.uncertain_clearance_m)
        step_m = config.clearance_step_m
        free_m = step_m * math.floor(room_m / step_m + 1e-6)
        gives_way = body_m < kept_m + config.within_m
        return free_m if gives_way else max(free_m, kept_m)

    def _anchor(self, zone: Zone) -> Matrix:
        """Return the covariances that the robot had where it came nearest to a new zone."""
        if self._frozen or not self._trail:
            return _EXACT
        middle = np.mean(np.asarray(zone.polygon), axis=0)
        _, _, covariances = min(
            self._trail.values(), key=lambda then: math.dist(then[:2], (middle[0], middle[1]))
        )
        return covariances

    def _note(self, place: LocalisationEstimate) -> None:
        if self._frozen:
            return
        here, cell_m = place.T_map_base, self._config.trail_spacing_m
        cell = math.floor(here.x_m / cell_m), math.floor(here.y_m / cell_m)
        covariances = np.stack([place.positions[0], self._by_motion(place)])
        self._trail[cell] = here.x_m, here.y_m, covariances
