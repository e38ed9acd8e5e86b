"""Zones and beware cells, checked against the motion that is about to be commanded.

The check is independent of map, planner and local planner: it takes the operator's zones and the
known beware cells as they are, predicts where the footprint sweeps until the robot stands, and
gives the largest share of the velocity from which it comes too near to no area.

How far an area is kept grows with the uncertainty of the position, also while the robot stands
beside it. A robot that is nearer than that may drive where it comes no nearer: away, along, back.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import shapely

from navcore.config.safety import DEFAULT_SAFETY, KeepOutMonitorConfig
from navcore.geometry.arrays import Floats, Indices, Points
from navcore.geometry.kinematics import arc_position
from navcore.geometry.transform import Matrix, Pose2, Twist
from navcore.mission.zone import Zone
from navcore.mission.zone_growth import (
    covering,
    distance_m,
    grow,
    kept_distances,
    largest_axis_m,
    most_growth_m,
    polygon_of,
    relative_distance,
    spread_of,
)
from navcore.robot.profile import RobotProfile
from navcore.safety.collision_monitor import braking_s

NO_CELLS: Points = np.empty((0, 2))
_DEFAULT = DEFAULT_SAFETY.keep_out
_NEGLIGIBLE_M = 1e-3
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class _Area:
    """What a zone forbids, grown by the uncertainty of the position."""

    drawn: Zone
    """The zone of the operator."""
    spread: Matrix
    """(2, 2) ellipse by which it is grown."""
    growth_m: float = 0.0
    """Largest growth in metres."""
    clearance_m: float = 0.0
    """Distance in metres from the grown zone within which the side of the robot moves slowly."""

    @property
    def grown(self) -> Zone:
        """The grown zone."""
        return grow(self.drawn, self.spread)

    def title(self, *, uncertain: bool) -> str:
        """What the zone is called in reasons, with how uncertain the position is."""
        name = self.drawn.name
        if uncertain:
            return f"zone {name!r} (the position is uncertain by {self.growth_m:.1f} m)"
        return f"zone {name!r}"

    def is_near(self, pose: Pose2, reach_m: float) -> bool:
        """Whether what is forbidden, or the clearance, may be within reach of a pose."""
        return _is_near(self.drawn, pose, reach_m + self.growth_m + self.clearance_m)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KeepOuts:
    """The areas that the footprint must not enter, and where the robot is."""

    pose: Pose2 | None = None
    """T_map_base at present; None before the first frame, and then nothing is checked."""
    zones: tuple[Zone, ...] = ()
    """Zones of the operator; only closed ones count."""
    cells: Points = field(default_factory=lambda: NO_CELLS)
    """(N, 2) centres of known beware cells near the robot, map frame."""
    cell_growth_m: Floats | None = None
    """(N,) growth of each cell in metres by the uncertainty of the position; None for none."""
    cell_objects: Indices | None = None
    """(N,) number of the object that each cell is a part of; None for each one of its own."""
    leaving: bool = False
    """Whether the robot was told to leave the area it stands in. What the footprint touches then
    does not count; what only its growth brings near counts as it is, without the growth."""
    covariance: Matrix = field(default_factory=lambda: np.zeros((2, 2)))
    """(2, 2) covariance of the robot's position in the map, square metres."""
    covariances: Mapping[str, Matrix] = field(default_factory=dict)
    """(2, 2) covariance of the robot's position relative to a zone, by the zone's id; `covariance`
    counts for zones that are not named."""


def permitted_share(
    keep_outs: KeepOuts,
    twist: Twist,
    profile: RobotProfile,
    *,
    frame_age_s: float,
    config: KeepOutMonitorConfig = _DEFAULT,
) -> tuple[float, str]:
    """Return the largest share of a velocity, 0 to 1, that enters no area, and what is in the way.

    An area that is nearer already than the uncertainty asks for may not come nearer, and one that
    the footprint overlaps may not be covered any further; both may be left. The name is empty where
    the whole velocity is permitted. Beside a zone relative to which the position is too uncertain,
    the robot is slowed down.
    """
    start = keep_outs.pose
    if start is None or profile.fastest_mps(twist) < config.standing_mps:
        return 1.0, ""
    late_s = max(config.reaction_s - frame_age_s, config.reaction_after_frame_s)
    travelled_m = abs(twist.v_mps) * (late_s + braking_s(twist, profile)) + config.stop_margin_m
    reach_m = profile.circumscribed_radius_m + travelled_m
    areas = _near_areas(keep_outs, start, reach_m, config)
    keep_outs = _near_cells(keep_outs, start, reach_m)
    if not areas and not len(keep_outs.cells):
        return 1.0, ""
    blocking, slow = "", config.uncertain_mps / profile.fastest_mps(twist)
    shares = config.shares if slow >= min(config.shares) else (*config.shares, slow)
    for share in shares:
        part = Twist(v_mps=share * twist.v_mps, w_radps=share * twist.w_radps)
        poses = list(_stopping_poses(start, part, profile, late_s, config))
        entered = _entered(areas, keep_outs, start, poses, profile, config.spacing_m)
        if share > slow:
            entered = entered or _slowed(areas, [start, *poses], profile)
        if entered is None:
            return share, blocking
        blocking = blocking or entered
    return 0.0, blocking


def _near_areas(
    keep_outs: KeepOuts, pose: Pose2, reach_m: float, config: KeepOutMonitorConfig
) -> list[_Area]:
    """Return what the closed zones within reach forbid by the uncertainty of the position; only
    those that may be near are grown, which takes time."""
    found = []
    for zone in keep_outs.zones:
        covariance = keep_outs.covariances.get(zone.id, keep_outs.covariance)
        most_m = most_growth_m(covariance, config.sigmas) + config.uncertain_clearance_m
        if zone.closed and _is_near(zone, pose, reach_m + most_m):
            area = _area(zone, covariance, config)
            if area.is_near(pose, reach_m):
                found.append(area)
    return found


def _is_near(zone: Zone, pose: Pose2, within_m: float) -> bool:
    """Return whether what a zone forbids may be within a distance in metres of a pose."""
    if zone.forbids_outside:
        return True
    left, bottom, right, top = zone.bounds
    beside_m = max(left - pose.x_m, pose.x_m - right, bottom - pose.y_m, pose.y_m - top)
    return not beside_m > within_m  # one that is no number counts as near


def _area(zone: Zone, covariance: Matrix, config: KeepOutMonitorConfig) -> _Area:
    growth_m = largest_axis_m(spread_of(covariance, config.sigmas))
    if growth_m < _NEGLIGIBLE_M:
        return _Area(zone, spread_of(np.zeros((2, 2)), config.sigmas))
    spread = spread_of(covering(covariance), config.sigmas)
    if growth_m <= config.largest_growth_m:
        return _Area(zone, spread, largest_axis_m(spread))
    return _Area(zone, spread, largest_axis_m(spread), config.uncertain_clearance_m)


def _near_cells(keep_outs: KeepOuts, pose: Pose2, reach_m: float) -> KeepOuts:
    """Return the areas with the cells that the robot may reach until it stands."""
    cells, growth_m, objects = keep_outs.cells, _growth_of(keep_outs), keep_outs.cell_objects
    objects = np.arange(len(cells)) if objects is None else objects
    if len(cells):
        away_m = np.hypot(cells[:, 0] - pose.x_m, cells[:, 1] - pose.y_m)
        near = away_m <= reach_m + growth_m
        cells, growth_m, objects = cells[near], growth_m[near], objects[near]
    return dataclasses.replace(keep_outs, cells=cells, cell_growth_m=growth_m, cell_objects=objects)


def _stopping_poses(
    start: Pose2, twist: Twist, profile: RobotProfile, late_s: float, config: KeepOutMonitorConfig
) -> Iterator[Pose2]:
    """Yield the poses at which the robot may be until it stands, and a margin beyond."""
    speed_mps = profile.fastest_mps(twist)
    until_s = late_s + braking_s(twist, profile) / 2 + config.stop_margin_m / speed_mps
    steps = max(1, math.ceil(until_s * speed_mps / config.step_m))
    for step in range(1, steps + 1):
        time_s = until_s * step / steps
        x_m, y_m = arc_position(float(twist.v_mps), float(twist.w_radps), time_s)
        yield start @ Pose2(x_m=x_m, y_m=y_m, yaw_rad=twist.w_radps * time_s)


def _entered(
    areas: list[_Area],
    keep_outs: KeepOuts,
    start: Pose2,
    poses: list[Pose2],
    profile: RobotProfile,
    spacing_m: float,
) -> str | None:
    """Return the name of the first area that the footprint enters, or comes too near to, at any of
    the poses."""
    corners = profile.footprint()
    outlines = np.stack([pose.to_parent(corners) for pose in (start, *poses)])
    for area in areas:
        now, *later = relative_distance(area.drawn, area.spread, outlines).tolist()
        if min(later) >= min(now, 1.0) - _ROUNDING and now > 0:
            continue
        if keep_outs.leaving and (now == 0 or (now < 1 and min(later) > 0)):
            continue
        if now > 0 or _goes_in(area.drawn, start, poses, profile, spacing_m):
            return area.title(uncertain=now < 1 or area.clearance_m > 0)
    return _cell_entered(keep_outs, start, poses, profile)


def _goes_in(
    zone: Zone, start: Pose2, poses: list[Pose2], profile: RobotProfile, spacing_m: float
) -> bool:
    """Return whether the footprint, which touches a zone, covers more of it at any of the poses, or
    its middle lies deeper in the zone."""
    body = _body_points(profile.length_m, profile.width_m, spacing_m)
    covered = _forbidden(zone, np.stack([pose.to_parent(body) for pose in (start, *poses)]))
    counts = covered.sum(axis=1)
    if (counts[1:] > counts[0]).any():
        return True
    middles = np.array([(pose.x_m, pose.y_m) for pose in (start, *poses)])
    edge = polygon_of(zone.polygon).exterior
    depths = np.where(
        _forbidden(zone, middles), shapely.distance(edge, shapely.points(middles)), 0.0
    )
    return bool((depths[1:] > depths[0] + _ROUNDING).any())


def _cell_entered(
    keep_outs: KeepOuts, start: Pose2, poses: list[Pose2], profile: RobotProfile
) -> str | None:
    """Return what the beware cells are called, where the footprint comes too near to any of them at
    any of the poses.

    What is nearer already than its growth asks for may not come nearer as a whole, so that the
    robot may drive along it; what is under the robot may come no nearer to its middle, unless it is
    there already.
    """
    cells, growth_m, objects = keep_outs.cells, _growth_of(keep_outs), keep_outs.cell_objects
    if not len(cells) or objects is None:
        return None
    now_m = profile.distances_m(start.from_parent(cells))
    if keep_outs.leaving:
        growth_m = np.where(np.isin(objects, objects[now_m < growth_m]), 0.0, growth_m)
        others = ~np.isin(objects, objects[now_m < 0.0])
        cells, growth_m, objects = cells[others], growth_m[others], objects[others]
        now_m = now_m[others]
    kept_m = kept_distances(now_m, growth_m, objects) - _ROUNDING
    under_m = _least_under_m(cells, start, now_m)
    for pose in poses:
        later_m = profile.distances_m(pose.from_parent(cells))
        deeper = _least_under_m(cells, pose, later_m) < under_m - _ROUNDING
        if (later_m < kept_m).any() or (deeper and under_m > profile.width_m / 2):
            return "an object of the beware list"
    return None


def _least_under_m(cells: Points, pose: Pose2, away_m: Floats) -> float:
    """Return the distance in metres of the nearest cell under the body from its middle, infinite
    without one; (N,) distances of the cells from the body."""
    under = cells[away_m < 0.0]
    return float(np.hypot(*(under - (pose.x_m, pose.y_m)).T).min(initial=np.inf))


def _slowed(areas: list[_Area], poses: list[Pose2], profile: RobotProfile) -> str | None:
    """Return the name of the first area whose clearance the robot does not keep at one of the
    poses."""
    points = shapely.points([(pose.x_m, pose.y_m) for pose in poses])
    for area in areas:
        if area.clearance_m:
            least_m = profile.width_m / 2 + area.clearance_m
            if distance_m(area.grown, points).min() < least_m:
                return area.title(uncertain=True)
    return None


def _forbidden(zone: Zone, points: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Return (...) whether (..., 2) points of the map frame are in the area that a zone forbids."""
    inside = shapely.contains_xy(polygon_of(zone.polygon), points[..., 0], points[..., 1])
    return np.asarray(inside ^ zone.forbids_outside)


def _growth_of(keep_outs: KeepOuts) -> Floats:
    growth_m = keep_outs.cell_growth_m
    return np.zeros(len(keep_outs.cells)) if growth_m is None else growth_m


@lru_cache(maxsize=4)
def _body_points(length_m: float, width_m: float, spacing_m: float) -> npt.NDArray[np.float64]:
    """Return (N, 2) points all over the footprint in metres of the base frame."""
    x = np.linspace(-length_m / 2, length_m / 2, math.ceil(length_m / spacing_m) + 1)
    y = np.linspace(-width_m / 2, width_m / 2, math.ceil(width_m / spacing_m) + 1)
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    points.flags.writeable = False
    return points
