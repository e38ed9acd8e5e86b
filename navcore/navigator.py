"""The whole loop, once per frame: read `Navigator.tick` and know the system (the paper's Algorithms 1 and 2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from navcore.beware import BewareList
from navcore.cloud_map import CloudMap
from navcore.config import NavigatorConfig
from navcore.frame import Frame, check_frame
from navcore.grid import BoolGrid, Cell, GridSpec, OccupancyGrid, inflate_layers
from navcore.local_planner import IDLE, Motion, Outcome, Points, hard_cells, nearby, plan_motion, rim_of_unseen, stands_in
from navcore.path import NoPath, Path, Reason, plan
from navcore.points import observe
from navcore.robot import STANDSTILL, RobotProfile
from navcore.segment import Labels, Segmenter
from navcore.transform import Pose2
from navcore.waypoints import choose_waypoints
from navcore.zones import Zone

NO_POINTS: Points = np.empty((0, 2))
Array = TypeVar("Array", bound=npt.NDArray[np.generic])


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """What the operator wants at the moment of a tick."""

    goal: tuple[float, float] | None
    """(x, y) in the map frame to drive to; None to stand and look."""
    beware: BewareList
    """What must not be touched."""
    zones: tuple[Zone, ...]
    """Where the robot must not be."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Occupancy:
    """The map as the planners see it under one order."""

    grid: OccupancyGrid
    """Occupied cells by layer."""
    blocked: BoolGrid
    """(rows, cols) where the robot's centre may not be."""
    geometric: BoolGrid
    """(rows, cols) cells no part of the robot may touch because something stands there."""
    ruled: BoolGrid
    """(rows, cols) cells no part of the robot may touch because the operator says so."""
    version: int
    """Grows with every change."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Route:
    """The way to the goal, from the robot's place."""

    outcome: Path | NoPath
    """The shortest path, or why there is none."""
    points: Points
    """(N, 2) the path in metres of the map frame; (0, 2) without one."""
    waypoints: Points
    """(M, 2) its corners and its end."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Decision:
    """What one tick made of a frame."""

    frame: Frame
    """The frame it was made of."""
    labels: Labels
    """What its pixels show."""
    occupancy: Occupancy
    """The map after the frame."""
    route: Route | None
    """The way to the goal; None without a goal."""
    motion: Motion
    """What to do until the next frame."""


class Navigator:
    """The map and the present path. It has no clock, no thread and no means to stop the robot: that is the gate's work."""

    def __init__(self, *, spec: GridSpec, profile: RobotProfile, segmenter: Segmenter, config: NavigatorConfig) -> None:
        self.map = CloudMap(spec, config.map)
        self._profile = profile
        self._segmenter = segmenter
        self._config = config
        self._occupancy: tuple[tuple[object, ...], Occupancy] | None = None
        self._route: tuple[tuple[object, ...], Route] | None = None
        self._motion = IDLE
        self._placed = False

    def tick(self, frame: Frame, order: Order) -> Decision:
        """From a frame to a motion. Raises `BadFrame`, and then has changed nothing."""
        check_frame(frame)
        labels = self.label(frame, order)
        self.remember(frame, labels, order)
        occupancy = self.occupancy(order)
        route = self.route(occupancy, frame.pose, order)
        motion = self.move(occupancy, frame.pose, route)
        return Decision(frame=frame, labels=labels, occupancy=occupancy, route=route, motion=motion)

    def label(self, frame: Frame, order: Order) -> Labels:
        """Which pixels show something on the beware list."""
        return self._segmenter.segment(frame, order.beware)

    def remember(self, frame: Frame, labels: Labels, order: Order) -> None:
        """Put the frame's points on the map, under its pose ID, and note the ground the robot stands on."""
        self._tread(frame.pose)
        self.map.insert(observe(frame, labels, order.beware, self.map.spec, self._config.points), frame)

    def occupancy(self, order: Order) -> Occupancy:
        """The occupied and the blocked cells; made anew only when the map, the list or the zones have changed."""
        key = (self.map.version, order.beware, order.zones)
        if self._occupancy is None or self._occupancy[0] != key:
            grid = self.map.grid(order.beware, order.zones)
            geometric, ruled = hard_cells(grid)
            version = 0 if self._occupancy is None else self._occupancy[1].version + 1
            made = Occupancy(
                grid=grid,
                blocked=read_only(self.blocked(grid)),
                geometric=read_only(geometric),
                ruled=read_only(ruled),
                version=version,
            )
            self._occupancy = (key, made)
        return self._occupancy[1]

    def route(self, occupancy: Occupancy, pose: Pose2, order: Order) -> Route | None:
        """The shortest path from here, searched in full whenever the map, the goal or the robot's cell has changed."""
        if order.goal is None:
            return None
        key = (occupancy.version, order.goal, self.map.spec.cell(pose.x_m, pose.y_m))
        if self._route is None or self._route[0] != key:
            self._route = (key, self.plan(occupancy.blocked, pose, order.goal))
        return self._route[1]

    def plan(self, blocked: BoolGrid, pose: Pose2, goal: tuple[float, float]) -> Route:
        """The shortest path from a pose to a goal over a given grid; changes nothing."""
        spec = self.map.spec
        start = nearest_free(blocked, spec.cell(pose.x_m, pose.y_m), self._config.start_relief_m / spec.resolution_m)
        outcome = NoPath(reason=Reason.START_BLOCKED) if start is None else plan(blocked, start, spec.cell(*goal))
        if isinstance(outcome, NoPath):
            return Route(outcome=outcome, points=NO_POINTS, waypoints=NO_POINTS)
        corners = choose_waypoints(outcome, spec, max_vertex_angle_rad=math.radians(self._config.max_vertex_angle_deg))
        # The goal is a point, not a cell: the last centre gives way to it.
        points = np.vstack([spec.centres(outcome.cells[:-1]), goal])
        return Route(outcome=outcome, points=read_only(points), waypoints=read_only(np.vstack([corners[:-1], goal])))

    def move(self, occupancy: Occupancy, pose: Pose2, route: Route | None) -> Motion:
        """The velocity that follows the route and touches nothing; standing without a route."""
        grid, reach = occupancy.grid, _REACH_M + self._profile.circumscribed_radius_m
        ruled = nearby(occupancy.ruled, grid, pose, reach)
        if route is None or len(route.points) == 0:
            trapped = route is not None and stands_in(ruled, self._profile, grid.spec.resolution_m)
            self._motion = Motion(twist=STANDSTILL, outcome=Outcome.IN_ZONE) if trapped else IDLE
            return self._motion
        self._motion = plan_motion(
            geometric=nearby(occupancy.geometric, grid, pose, reach),
            ruled=ruled,
            unseen=nearby(rim_of_unseen(self.map.known()), grid, pose, reach),
            path_map=route.points,
            pose=pose,
            previous=self._motion,
            profile=self._profile,
            rules=self._config.local,
            cell_m=grid.spec.resolution_m,
        )
        return self._motion

    def _tread(self, pose: Pose2) -> None:
        outline = self._profile.footprint()
        if not self._placed:
            # Where it is put down it has been given room; the camera cannot see the floor at its own feet.
            angles = np.linspace(0.0, 2 * math.pi, 24, endpoint=False)
            outline = self._config.start_clear_m * np.column_stack([np.cos(angles), np.sin(angles)])
            self._placed = True
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        self.map.tread(outline @ np.array([[cos, sin], [-sin, cos]]) + np.array([pose.x_m, pose.y_m]))

    def blocked(self, grid: OccupancyGrid) -> BoolGrid:
        """(rows, cols) where this robot's centre may not be on the given grid."""
        return inflate_layers(grid, vehicle_width_m=self._profile.width_m, safety_margin_m=self._config.safety_margin_m)


_REACH_M = 2.0


def nearest_free(blocked: BoolGrid, cell: Cell, within: float) -> Cell | None:
    """The free cell nearest to `cell`, itself if free; None when all within that many cells are blocked or it is outside."""
    rows, cols = blocked.shape
    if not (0 <= cell[0] < rows and 0 <= cell[1] < cols):
        return cell
    if not blocked[cell]:
        return cell
    reach = math.floor(within)
    top, left = max(cell[0] - reach, 0), max(cell[1] - reach, 0)
    free = np.argwhere(~blocked[top : cell[0] + reach + 1, left : cell[1] + reach + 1]) + np.array([top, left])
    distance = np.hypot(*(free - np.array(cell)).T)
    if len(free) == 0 or distance.min() > within:
        return None
    row, col = free[int(np.argmin(distance))]
    return int(row), int(col)


def read_only(array: Array) -> Array:
    """The same array, frozen, so that it can cross threads."""
    array.flags.writeable = False
    return array
