"""A route: a path of cells in metres, with its waypoints and the smoothed path through them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from navcore.config.navigator import NavigatorConfig
from navcore.geometry.arrays import Points
from navcore.geometry.polyline import length_m, resample, subdivided
from navcore.grid.bitplane import BitPlane
from navcore.grid.grid import GridSpec
from navcore.planning.elastic_band import relax
from navcore.planning.path import NoPath, Path, Reason
from navcore.planning.string_pulling import taut_corners
from navcore.robot.profile import RobotProfile

NO_POINTS: Points = np.empty((0, 2))
Array = TypeVar("Array", bound=npt.NDArray[np.generic])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Route:
    """A route from the robot to the goal."""

    outcome: Path | NoPath
    """The shortest path, or the reason why none exists."""
    points: Points
    """(N, 2) the path in metres of the map frame; without one the path to a viewpoint before the
    blockage, or (0, 2)."""
    waypoints: Points
    """(M, 2) the corners of the taut path, where the elastic band holds them, and its end."""
    track: Points
    """(K, 2) the smoothed path through the waypoints, which the local planner follows."""
    round_m: float | None = None
    """Length of the path in metres where the points do not follow it, but lead to a viewpoint
    before a gap: the path is much longer than one through the gap, which is looked at first. None
    otherwise."""

    @property
    def is_look(self) -> bool:
        """Whether the points lead to such a viewpoint."""
        return self.round_m is not None

    @property
    def reaches_goal(self) -> bool:
        """Whether the points lead to the end of the path."""
        return isinstance(self.outcome, Path) and not self.is_look

    @property
    def length_m(self) -> float | None:
        """Length of the path in metres; None without one."""
        if isinstance(self.outcome, NoPath):
            return None
        return length_m(self.points) if self.round_m is None else self.round_m


def build_route(
    outcome: Path | NoPath,
    goal: tuple[float, float],
    free: BitPlane,
    spec: GridSpec,
    profile: RobotProfile,
    config: NavigatorConfig,
) -> Route:
    """Build the route along a path; it ends at the goal, (x, y) in the map frame. `free` is the
    plane of the free cells."""
    if isinstance(outcome, NoPath):
        return no_route(outcome.reason)
    band, taut = config.planning.elastic_band, taut_corners(outcome.cells, free)
    # The goal is a point, not a cell: the last centre gives way to it.
    points, line = (np.vstack([spec.centres(cells[:-1]), goal]) for cells in (outcome.cells, taut))
    track, corners = subdivided(line, spec.resolution_m)
    kept_m = profile.width_m / 2 + config.safety_margin_m
    wanted_m = profile.circumscribed_radius_m + band.extra_clearance_m - kept_m
    track = relax(track, free, spec, wanted_m=wanted_m, config=band)
    return Route(
        outcome=outcome,
        points=read_only(points),
        waypoints=read_only(track[[*corners[1:-1], -1]]),
        track=read_only(resample(track, spec.resolution_m)),
    )


def no_route(reason: Reason) -> Route:
    """Return the route without a path, for a reason."""
    return Route(
        outcome=NoPath(reason=reason), points=NO_POINTS, waypoints=NO_POINTS, track=NO_POINTS
    )


def read_only(array: Array) -> Array:
    """Make an array read-only, so that it can cross threads."""
    array.flags.writeable = False
    return array
