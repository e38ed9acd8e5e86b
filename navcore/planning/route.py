"""The way to the goal as everybody else takes it from a path of cells: in metres, its waypoints,
and the track to drive."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from navcore.config.navigator import NavigatorConfig
from navcore.geometry.arrays import Points
from navcore.geometry.polyline import length_m, resample
from navcore.grid.bitplane import BitPlane
from navcore.grid.grid import GridSpec
from navcore.planning.elastic_band import relax
from navcore.planning.path import NoPath, Path, Reason
from navcore.planning.string_pulling import shortcut
from navcore.planning.waypoints import choose_waypoints
from navcore.robot.profile import RobotProfile

NO_POINTS: Points = np.empty((0, 2))
BAND_M = 0.1
"""Beside what it turns round the track keeps this much more than the circle in which the robot
turns, where it can."""
TAUT_M = 8.0
"""As far ahead as this the path is pulled taut; the local planner looks no further."""
Array = TypeVar("Array", bound=npt.NDArray[np.generic])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Route:
    """The way to the goal, from the robot's place."""

    outcome: Path | NoPath
    """The shortest path, or why there is none."""
    points: Points
    """(N, 2) the path in metres of the map frame; without one the way to go nearer to where it is
    closed, or (0, 2)."""
    waypoints: Points
    """(M, 2) its corners and its end."""
    track: Points
    """(K, 2) what the local planner follows: the path, pulled taut where the robot is next."""

    @property
    def length_m(self) -> float | None:
        """Of the path; None without one."""
        return (
            None
            if isinstance(self.outcome, NoPath)
            else length_m(self.points)
        )


def build_route(
    outcome: Path | NoPath,
    goal: tuple[float, float],
    free: BitPlane,
    spec: GridSpec,
    profile: RobotProfile,
    config: NavigatorConfig,
) -> Route:
    """The route along a path; it ends at the goal, (x, y) in the map frame. `free`: plane of cells
    that the path may use."""
    if isinstance(outcome, NoPath):
        return no_route(outcome.reason)
    corners = choose_waypoints(
        outcome, spec, max_vertex_angle_rad=math.radians(config.max_vertex_angle_deg)
    )
    taut = shortcut(outcome.cells, free, stretch=math.ceil(TAUT_M / spec.resolution_m))
    # The goal is a point, not a cell: the last centre gives way to it.
    points, track = (np.vstack([spec.centres(cells[:-1]), goal]) for cells in (outcome.cells, taut))
    kept_m = profile.width_m / 2 + config.safety_margin_m
    wanted_m = profile.circumscribed_radius_m + BAND_M - kept_m
    track = relax(
        resample(track, spec.resolution_m), free, spec, stretch_m=TAUT_M, wanted_m=wanted_m
    )
    return Route(
        outcome=outcome,
        points=read_only(points),
        waypoints=read_only(np.vstack([corners[:-1], goal])),
        track=read_only(resample(track, spec.resolution_m)),
    )


def no_route(reason: Reason) -> Route:
    """That there is none, and why."""
    return Route(
        outcome=NoPath(reason=reason), points=NO_POINTS, waypoints=NO_POINTS, track=NO_POINTS
    )


def read_only(array: Array) -> Array:
    """The same array, frozen, so that it can cross threads."""
    array.flags.writeable = False
    return array
