"""Manoeuvres where no single arc leads on: turning, reversing and driving forward by turns, with
the footprint free at every pose."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navcore.config.control import CONTROL_CONFIG, ManoeuvreConfig, StateLatticeConfig
from navcore.control.manoeuvre.state_lattice import FORWARD, TURNING, Ends, cells, cheapest
from navcore.control.motion_primitives import STATIONS
from navcore.geometry.arrays import Floats, Indices, Points
from navcore.geometry.kinematics import chord_lengths
from navcore.geometry.polyline import metres_along, points_at
from navcore.geometry.transform import Pose2
from navcore.robot.profile import RobotProfile

TURN_GEAR = 2
"""Gear of a turn in place to the left; negative to the right."""
_SIGHT_LINE = np.linspace(0.0, 0.95, 24)
"""Points of a line of sight that are checked, as shares of its length; the cell itself is not."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Manoeuvre:
    """The rest of a manoeuvre."""

    poses: Points
    """(K, 3) x, y, heading in the map frame, close together."""
    gears: Indices
    """(K,) motion that leads to each pose: 1 forward, -1 reverse, 2 turn left and -2 turn right in
    place."""
    clearance_m: float
    """Clearance in metres that the manoeuvre was searched with."""
    target: tuple[float, float]
    """(x, y) in the map frame of the point on the path that the manoeuvre leads to, or that is
    nearest to the cell viewed from its end."""

    def in_base(self, pose: Pose2) -> Points:
        """(K, 3) the poses in the base frame of a robot at a pose."""
        return np.column_stack(
            [pose.from_parent(self.poses[:, :2]), self.poses[:, 2] - pose.yaw_rad]
        )

    def arrival_times_s(
        self, pose: Pose2, config: ManoeuvreConfig = CONTROL_CONFIG.manoeuvre
    ) -> Floats:
        """(K,) estimated seconds until a robot at `pose` reaches each pose."""
        steps = np.diff(np.vstack([[pose.x_m, pose.y_m, pose.yaw_rad], self.poses]), axis=0)
        speeds = np.where(self.gears == FORWARD, config.forward_mps, config.reverse_mps)
        turns = np.abs((steps[:, 2] + math.pi) % (2 * math.pi) - math.pi) / config.turn_radps
        drives = np.hypot(steps[:, 0], steps[:, 1]) / speeds
        return np.asarray(np.cumsum(np.where(np.abs(self.gears) == TURN_GEAR, turns, drives)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ManoeuvreProblem:
    """The surroundings of a robot that no single arc leads out of, base frame."""

    obstacles: Points
    """(M, 2) centres of the cells that no part of the body may touch."""
    cell_radius_m: float
    """Distance in metres from the centre of a cell to its corners."""
    unseen: Points
    """(U, 2) centres of the unobserved cells next to observed ones; no part of the body is swept
    over them."""
    unseen_clearance_m: float
    """Clearance in metres to keep to the centres of unobserved cells."""
    profile: RobotProfile
    """Footprint of the robot."""
    clearance_m: float
    """Clearance in metres to keep around the footprint."""
    config: ManoeuvreConfig = CONTROL_CONFIG.manoeuvre
    """Ends of a manoeuvre."""
    lattice: StateLatticeConfig = CONTROL_CONFIG.lattice
    """The search."""


def manoeuvre_along(path: Points, problem: ManoeuvreProblem, pose: Pose2) -> Manoeuvre | None:
    """Find the cheapest manoeuvre that leads on along the (N, 2) path, base frame; None without
    one."""
    return _found(_ends_along(path, problem), None, problem, pose)


def manoeuvre_to_see(path: Points, problem: ManoeuvreProblem, pose: Pose2) -> Manoeuvre | None:
    """Find the cheapest manoeuvre to a viewpoint of how the (N, 2) path, base frame, goes on; None
    without one, or if the path is observed."""
    if len(problem.unseen) == 0:
        return None
    # The nearest of the cells that the body would sweep first: with that one in view, so is what
    # lies behind it.
    ahead = path[metres_along(path) <= problem.config.advance_m]
    apart = np.hypot(*(problem.unseen[:, None] - ahead).transpose(2, 0, 1))
    swept = np.flatnonzero(apart.min(axis=1) < problem.profile.circumscribed_radius_m)
    if len(swept) == 0:
        return None
    nearest = swept[np.hypot(*problem.unseen[swept].T).argmin()]
    ends = _viewpoints(problem.unseen[nearest], problem)
    return _found(ends, ahead[apart[nearest].argmin()], problem, pose)


def visible_by_turning(path: Points, problem: ManoeuvreProblem, *, beyond_rad: float) -> Points:
    """Return the (K, 2) unobserved cells, base frame, that a body which follows the (N, 2) path
    soon sweeps, and that the camera sees when the robot turns to them in place by more than an
    angle."""
    config, unseen = problem.config, problem.unseen
    away, bearing = np.hypot(*unseen.T), np.arctan2(unseen[:, 1], unseen[:, 0])
    in_range = (away >= config.view_from_m) & (away <= config.view_to_m)
    cells = unseen[in_range & (np.abs(bearing) > beyond_rad)]
    ahead = path[metres_along(path) <= config.advance_m]
    apart = np.hypot(*(cells[:, None] - ahead).transpose(2, 0, 1)).min(axis=1)
    swept = cells[apart < problem.profile.circumscribed_radius_m]
    hidden = np.array([_is_hidden(cell, problem) for cell in swept], dtype=np.bool_)
    return np.asarray(swept[~hidden])


def _is_hidden(cell: Points, problem: ManoeuvreProblem) -> bool:
    """Whether an obstacle lies between a (2,) cell and the camera of a robot that faces it."""
    away_m, radius_m = math.hypot(*cell), problem.cell_radius_m
    ahead = cell / away_m
    along = problem.obstacles @ ahead
    across = problem.obstacles @ np.array([-ahead[1], ahead[0]])
    between = (along > problem.profile.camera.x_m) & (along < away_m - radius_m)
    return bool((between & (np.abs(across) < radius_m)).any())


def _found(
    ends: Ends, target: Points | None, problem: ManoeuvreProblem, pose: Pose2
) -> Manoeuvre | None:
    """The cheapest manoeuvre to one of the ends; its target is (2,) in the base frame, or its own
    end."""
    unseen_m = problem.unseen_clearance_m + problem.config.unseen_tolerance_m
    poses, kinds = cheapest(
        np.vstack([problem.obstacles, problem.unseen]),
        np.concatenate(
            [
                np.full(len(problem.obstacles), problem.cell_radius_m + problem.clearance_m),
                np.full(len(problem.unseen), unseen_m),
            ]
        ),
        ends,
        footprint_m=(problem.profile.length_m / 2, problem.profile.width_m / 2),
        config=problem.lattice,
    )
    if len(poses) == 0:
        return None
    found, gears = _divided(poses, kinds, problem)
    end = found[-1:, :2] if target is None else target[None]
    on_map = pose.to_parent(np.vstack([found[:, :2], end]))
    return Manoeuvre(
        poses=np.column_stack([on_map[:-1], found[:, 2] + pose.yaw_rad]),
        gears=gears,
        clearance_m=problem.clearance_m,
        target=(float(on_map[-1, 0]), float(on_map[-1, 1])),
    )


def _divided(poses: Points, kinds: Indices, problem: ManoeuvreProblem) -> tuple[Points, Indices]:
    """(K, 3) poses close together along the steps of the search, and (K,) gears."""
    substeps = problem.config.substeps
    parts, gears = list[Points](), list[int]()
    for before, after, kind in zip(
        np.vstack([np.zeros(3), poses])[:-1], poses, kinds.tolist(), strict=True
    ):
        parts.append(_substeps(before, after, kind, problem))
        turn = TURN_GEAR * round(math.copysign(1, after[2] - before[2]))
        gears += [turn if kind == TURNING else kind] * substeps
    return np.vstack(parts), np.array(gears)


def _substeps(before: Points, after: Points, kind: int, problem: ManoeuvreProblem) -> Points:
    """(substeps, 3) poses along one step, the last of them its end."""
    substeps = problem.config.substeps
    share = np.linspace(0.0, 1.0, substeps + 1)[1:]
    turn = after[2] - before[2]
    heading = before[2] + share * turn
    if kind == TURNING:
        return np.column_stack([np.tile(before[:2], (substeps, 1)), heading])
    chord = chord_lengths(kind * problem.lattice.step_m * share, share * turn)
    bearing = before[2] + share * turn / 2
    return np.column_stack(
        [before[0] + chord * np.cos(bearing), before[1] + chord * np.sin(bearing), heading]
    )


def _ends_along(path: Points, problem: ManoeuvreProblem) -> Ends:
    """Ends beside the path in its direction; the further along it, the better."""
    config = problem.config
    metres = metres_along(path)
    stations = np.linspace(0.0, min(metres[-1], config.advance_m), STATIONS)
    last = max(metres[-1] - config.tangent_m, 0.0)
    marks = points_at(path, metres, stations)
    ahead = points_at(path, metres, np.minimum(stations, last) + config.tangent_m) - marks
    headings = np.arctan2(ahead[:, 1], ahead[:, 0])
    moving = ahead.any(axis=1)
    headings[~moving] = headings[moving][-1] if moving.any() else 0.0
    x, y = cells(problem.lattice)
    away = np.hypot(x[..., None] - marks[:, 0], y[..., None] - marks[:, 1])
    nearest = away.argmin(axis=2)
    lateral = away.min(axis=2)
    cost = config.shortfall_cost * (stations[-1] - stations[nearest]) + lateral
    least = min(config.min_advance_m, 0.9 * stations[-1])
    cost[(lateral > config.lateral_m) | (stations[nearest] < least)] = np.inf
    return Ends(cost=cost, heading_rad=headings[nearest])


def _viewpoints(point: Points, problem: ManoeuvreProblem) -> Ends:
    """Ends from which the camera sees a (2,) point: near it, facing it, with no obstacle in
    between."""
    config, lattice = problem.config, problem.lattice
    x, y = cells(lattice)
    occupied = np.zeros(x.shape, dtype=np.bool_)
    column, row = _cell_indices(problem.obstacles.T, lattice)
    inside = (column >= 0) & (column < len(x)) & (row >= 0) & (row < len(x))
    occupied[row[inside], column[inside]] = True
    hidden = np.zeros(x.shape, dtype=np.bool_)
    for share in _SIGHT_LINE:
        between = np.stack([x + share * (point[0] - x), y + share * (point[1] - y)])
        column, row = np.clip(_cell_indices(between, lattice), 0, len(x) - 1)
        hidden |= occupied[row, column]
    away = np.hypot(x - point[0], y - point[1])
    closed = hidden | (away < config.view_from_m) | (away > config.view_to_m)
    return Ends(
        cost=np.where(closed, np.inf, 0.0),
        heading_rad=np.arctan2(point[1] - y, point[0] - x),
        tolerance_rad=math.radians(config.view_deg),
    )


def _cell_indices(coordinates: Floats, lattice: StateLatticeConfig) -> Indices:
    """Columns and rows of the search's cells, which may lie outside, by x and y in metres."""
    return np.floor((coordinates + lattice.half_side_m) / lattice.cell_m).astype(np.int64)
