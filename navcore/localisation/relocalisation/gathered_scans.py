"""Gathered scans: what a robot that looks for its place has seen over its last metres."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from navcore.config.localisation.relocalisation import RelocalisationConfig
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.localisation.relocalisation.submap import Submap, submap_of
from navcore.localisation.scans.scan import Scan


@dataclass(frozen=True, slots=True, kw_only=True)
class Travel:
    """How far a robot has come by odometry since it began to gather."""

    driven_m: float = 0.0
    """Distance driven in metres."""
    turned_rad: float = 0.0
    """Turns in radians, those to either side added up."""
    heading_rad: float = 0.0
    """Heading in radians less that of the beginning; more than a turn counts as more."""

    def after(self, step: Pose2) -> Travel:
        """Return how far it has come after a motion."""
        return Travel(
            driven_m=self.driven_m + math.hypot(step.x_m, step.y_m),
            turned_rad=self.turned_rad + abs(step.yaw_rad),
            heading_rad=self.heading_rad + step.yaw_rad,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _View:
    """A kept scan and how far the robot had come."""

    T_odom_base: Pose2
    scan: Scan
    travel: Travel


@dataclass(slots=True, kw_only=True, eq=False)
class GatheredScans:
    """Scans of the last metres, which odometry still connects, with some way between them."""

    config: RelocalisationConfig
    """How far they lie apart, and how long each is kept."""
    count: int = 0
    """Number of scans that were kept so far, with those that are forgotten by now."""
    travel: Travel = Travel()
    """How far the robot has come."""
    _views: list[_View] = field(default_factory=list)
    _last: Pose2 | None = None

    def copy(self) -> GatheredScans:
        """Return the same scans, to go on with."""
        return replace(self, _views=list(self._views))

    def add(self, scan: Scan, T_odom_base: Pose2) -> None:
        """Take one more scan with the odometry of its moment; without a point it is no view."""
        if self._last is not None:
            self.travel = self.travel.after(self._last.inverse() @ T_odom_base)
        self._last = T_odom_base
        while self._views and self._is_past(self._views[0]):
            del self._views[0]
        is_again = self._views and self._is_near(T_odom_base, self._views[-1].T_odom_base)
        if is_again or not len(scan):
            return
        self._views.append(_View(T_odom_base=T_odom_base, scan=scan, travel=self.travel))
        self.count += 1

    def _is_past(self, view: _View) -> bool:
        """Return whether odometry has drifted too far since a view."""
        return self.travel.driven_m - view.travel.driven_m > self.config.submap_m

    def _is_near(self, one: Pose2, other: Pose2) -> bool:
        turn = abs(wrap_angle(one.yaw_rad - other.yaw_rad))
        return one.distance_to(other.x_m, other.y_m) < self.config.scan_spacing_m and (
            turn < math.radians(self.config.scan_spacing_deg)
        )

    @property
    def is_empty(self) -> bool:
        """Whether there is no scan."""
        return not self._views

    @property
    def everything(self) -> Submap:
        """All scans; raises `ValueError` without any."""
        return _submap(self._views)

    @property
    def recent(self) -> Submap:
        """Scans of the last metres, over which odometry has hardly drifted."""
        least_m = self._views[-1].travel.driven_m - self.config.recent_m
        return _submap([view for view in self._views if view.travel.driven_m >= least_m])

    @property
    def has_looked_round(self) -> bool:
        """Whether the scans show everything around the robot."""
        headings = [view.travel.heading_rad for view in self._views]
        return max(headings) - min(headings) >= math.radians(self.config.round_deg)

    def newest(self, count: int) -> tuple[Submap | None, bool]:
        """Return the scans that were kept since `count` had been kept, None while these are too few
        to confirm a place, and whether the robot has hardly left one position meanwhile: turning
        in short strokes adds metres, but shows one room."""
        forgotten = self.count - len(self._views)
        views = self._views[max(count - forgotten, 0) :]
        if not views:
            return None, False
        start = views[0].T_odom_base
        away_m = max(start.distance_to(one.T_odom_base.x_m, one.T_odom_base.y_m) for one in views)
        has_only_turned = away_m < self.config.confirm_m
        turned_rad = views[-1].travel.turned_rad - views[0].travel.turned_rad
        if has_only_turned and turned_rad < math.radians(self.config.confirm_turn_deg):
            return None, True
        submap = _submap(views)
        tells = len(submap) >= self.config.search.least_points
        return submap if tells else None, has_only_turned


def _submap(views: list[_View]) -> Submap:
    return submap_of([(view.T_odom_base, view.scan) for view in views])
