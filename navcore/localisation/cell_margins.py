"""Margins of beware cells that follow the robot's uncertainty since each cell was in view.

What the camera sees now is where it is seen. What it saw before is as uncertain, relative to the
robot, as odometry has become since, and no more than the position has by its motion: the difference
of two covariances in the map holds errors, as of the heading far behind, that moved robot and cell
alike. Nor is it more uncertain than cell and robot are in the map, together. What was in view stays
known when the robot leaves it: on its way back a cell is as uncertain as the drive in between has
made it, and not as the whole map. What has moved the estimate otherwise than odometry, a fix or a
push, adds to that.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from navcore.config.localisation.localisation import OdometryConfig
from navcore.config.safety import KeepOutMonitorConfig
from navcore.geometry.arrays import Bools, Floats, Indices, Points
from navcore.geometry.camera import project
from navcore.geometry.transform import Pose2
from navcore.localisation.estimate import LocalisationEstimate
from navcore.localisation.tracking.odometry_model import OdometryStep, travel_of, travel_variance
from navcore.mission.zone_growth import kept_distances
from navcore.robot.frame import Frame
from navcore.robot.profile import RobotProfile


@dataclass(frozen=True, slots=True, eq=False)
class GrownCells:
    """Beware cells near the robot, and how far each is kept besides."""

    cells: Points = field(default_factory=lambda: np.empty((0, 2)))
    """(N, 2) centres, map frame."""
    growth_m: Floats = field(default_factory=lambda: np.zeros(0))
    """(N,) growth in metres by the uncertainty of the position relative to each cell."""
    objects: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """(N,) number of the object that each cell is of: connected cells of one class."""

    def kept_by(self, profile: RobotProfile, pose: Pose2, besides_m: float) -> GrownCells:
        """Return the cells with the growth that a robot at a pose keeps, and a distance in metres
        besides. It may stay as near to an object as it is, and move along there."""
        now_m = np.maximum(profile.distances_m(pose.from_parent(self.cells)) - besides_m, 0.0)
        objects = self.objects if len(self.objects) else np.arange(len(self.cells))
        return GrownCells(
            self.cells, kept_distances(now_m, self.growth_m + besides_m, objects), objects
        )


NO_CELLS = GrownCells()
"""No beware cell is near."""


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """When cells were last in view."""

    cells: Points
    """(N, 2) centres, map frame."""
    covariances: Floats
    """(N, 3, 2, 2) covariances of the robot's position then, square metres: in the map, by motion,
    and of what has moved it besides odometry."""
    travels: Floats
    """(N, 3) travel by odometry until then; NaN for cells that were never in view."""

    @staticmethod
    def never(cells: Points) -> _Seen:
        """Return what is known of (N, 2) cells that were never in view."""
        return _Seen(cells, np.zeros((len(cells), 3, 2, 2)), np.full((len(cells), 3), np.nan))

    def only(self, which: Bools) -> _Seen:
        """Return some of the cells, (N,) true for those."""
        return _Seen(self.cells[which], self.covariances[which], self.travels[which])

    def of(self, cells: Points, within_m: float) -> _Seen:
        """Return when (N, 2) other cells were in view: when the nearest of these was, within a
        distance."""
        known = np.append(self.covariances, np.zeros((1, 3, 2, 2)), axis=0)
        travels = np.append(self.travels, np.full((1, 3), np.nan), axis=0)
        # Most cells are here themselves, and need no search for a neighbour. Without one the index
        # is that of the row that was added.
        nearest = _index_of(cells, self.cells)
        others = nearest == len(self.cells)
        if others.any():
            tree = cKDTree(self.cells)
            _, nearest[others] = tree.query(cells[others], distance_upper_bound=within_m)
        return _Seen(cells, known[nearest], travels[nearest])

    def beside(self, others: _Seen, within_m: float) -> _Seen:
        """Return the same cells; one that was never in view has the view of the nearest of `others`
        that was, if it is within a distance in metres."""
        never, known = np.isnan(self.travels[:, 0]), others.only(~np.isnan(others.travels[:, 0]))
        if not never.any() or not len(known.cells):
            return self
        found = known.of(self.cells[never], within_m)
        covariances, travels = self.covariances.copy(), self.travels.copy()
        covariances[never], travels[never] = found.covariances, found.travels
        return _Seen(self.cells, covariances, travels)

    def joined(self, other: _Seen) -> _Seen:
        """Return the cells of both."""
        return _Seen(
            np.concatenate([self.cells, other.cells]),
            np.concatenate([self.covariances, other.covariances]),
            np.concatenate([self.travels, other.travels]),
        )


class CellMargins:
    """Remembers when each beware cell was last in view."""

    def __init__(self, *, keep_out: KeepOutMonitorConfig, odometry: OdometryConfig) -> None:
        self._keep_out, self._odometry = keep_out, odometry
        self._travel = np.zeros(3)
        self.forget()
        self._last: tuple[Pose2, int] | None = None

    def forget(self) -> None:
        """Forget what was in view: the map is another one, or the robot was moved by other means
        than its wheels."""
        self._seen = _Seen.never(np.empty((0, 2)))

    def follow(
        self,
        cells: Points,
        frame: Frame,
        place: LocalisationEstimate,
        objects: Indices | None = None,
    ) -> GrownCells:
        """Return those of (N, 2) centres of beware cells, map frame, that are near the robot, and
        their growth; of what the camera may see all have to be given. `objects` are the (N,)
        numbers of what each cell is a part of, without them each is one of its own.

        The frame is placed in the map. Cells that are no longer there are forgotten. One that was
        never in view counts as seen with the nearest that was, since both are where the map has
        them; without one it is as uncertain as the robot's place in the map.
        """
        rules = self._keep_out
        self._advance(place.T_map_odom.inverse() @ frame.pose, frame.stamp_ns)
        if not len(cells) and not len(self._seen.cells):
            return GrownCells()
        objects = np.arange(len(cells)) if objects is None else objects
        is_given = _away_m(cells, frame) <= rules.seen_within_m
        cells, objects = cells[is_given], objects[is_given]
        far = _away_m(self._seen.cells, frame) > rules.seen_within_m
        seen = self._seen.only(~far).of(cells, rules.neighbour_m)
        in_view = self._in_view(cells, frame) & place.is_known
        covariances = np.stack([place.positions[0], place.relative, place.moved])
        seen.covariances[in_view], seen.travels[in_view] = covariances, self._travel
        self._seen = self._seen.only(far).joined(seen)
        is_near = _away_m(cells, frame) <= rules.cells_within_m
        near = seen.only(is_near)
        near = near.beside(seen, rules.neighbour_m)
        variance = self._variance(near, place, _away_m(near.cells, frame))
        return GrownCells(near.cells, rules.sigmas * np.sqrt(variance), objects[is_near])

    def _advance(self, odom: Pose2, stamp_ns: int) -> None:
        if self._last is not None:
            before, then_ns = self._last
            step = OdometryStep.between(before, odom, (stamp_ns - then_ns) / 1e9)
            self._travel = self._travel + travel_of(step, self._odometry)
        self._last = odom, stamp_ns

    def _variance(self, seen: _Seen, place: LocalisationEstimate, away_m: Floats) -> Floats:
        """Return the (N,) largest variances of cells relative to the robot, square metres."""
        together = np.linalg.eigvalsh(place.positions[0] + seen.covariances[:, 0])[:, -1]
        since_then = np.linalg.eigvalsh(place.relative - seen.covariances[:, 1])[:, -1]
        moved = np.linalg.eigvalsh(place.moved - seen.covariances[:, 2])[:, -1]
        in_map = np.minimum(together, np.maximum(since_then, 0.0))
        by_odometry = travel_variance(self._travel - seen.travels, away_m, self._odometry)
        return np.asarray(np.fmin(in_map, by_odometry + np.maximum(moved, 0.0)))

    def _in_view(self, cells: Points, frame: Frame) -> Bools:
        """Return (N,) whether the camera shows the floor at cells, and nothing before it."""
        floor = np.column_stack([cells, np.zeros(len(cells))])
        in_view = frame.shows(floor)
        camera = frame.T_map_camera
        ahead = (floor[in_view] - camera[:3, 3]) @ camera[:3, :3]
        cols, rows = np.rint(project(ahead, frame.intrinsics)).astype(int).T
        in_view[in_view] &= frame.depth_m[rows, cols] > ahead[:, 2] - self._keep_out.hidden_m
        return in_view


def _index_of(cells: Points, among: Points) -> Indices:
    """Return the (N,) indices of (N, 2) cells among (M, 2) ones, M for those that are not there."""
    # As complex numbers, which are ordered by y and then x: so most of the cells come.
    own, all_ = (
        np.ascontiguousarray(xy[:, ::-1]).view(np.complex128)[:, 0] for xy in (cells, among)
    )
    order = np.append(np.argsort(all_, kind="stable"), len(all_))
    index: Indices = order[np.searchsorted(all_, own, sorter=order[:-1])]
    return np.where(np.append(all_, np.nan)[index] == own, index, len(all_))


def _away_m(cells: Points, frame: Frame) -> Floats:
    """Return the (N,) distances in metres of cells from the middle of the robot."""
    return np.asarray(np.hypot(*(cells - (frame.pose.x_m, frame.pose.y_m)).T))
