"""Gathered scans: what a robot that looks for its place has seen over its last metres."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from navcore.config.localisation.relocalisation import RelocalisationConfig
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.localisation.relocalisation.submap import View
from navcore.localisation.scans.scan import Scan

SUBMAP_RAD = 6.0 * math.pi
"""Turns in radians after which a scan is forgotten: odometry has drifted since, and a robot that
turns on the spot would keep more and more of them."""


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
class _Kept:
    """A kept scan and how far the robot had come."""

    view: View
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
    _kept: list[_Kept] = field(default_factory=list)
    _last: Pose2 | None = None

    def copy(self) -> GatheredScans:
        """Return the same scans, to go on with."""
        return replace(self, _kept=list(self._kept))

    def add(self, scan: Scan, T_odom_base: Pose2) -> None:
        """Take one more scan with the odometry of its moment; without a point it is no view."""
        if self._last is not None:
            self.travel = self.travel.after(self._last.inverse() @ T_odom_base)
        self._last = T_odom_base
        while self._kept and self._is_past(self._kept[0].travel):
            del self._kept[0]
        is_again = self._kept and self._is_near(T_odom_base, self._kept[-1].view[0])
        if is_again or not len(scan):
            return
        self._kept.append(_Kept(view=(T_odom_base, scan), travel=self.travel))
        self.count += 1

    def _is_past(self, before: Travel) -> bool:
        """Return whether odometry has drifted too far since a scan was kept."""
        driven_m = self.travel.driven_m - before.driven_m
        turned_rad = self.travel.turned_rad - before.turned_rad
        return driven_m > self.config.submap_m or turned_rad > SUBMAP_RAD

    def _is_near(self, one: Pose2, other: Pose2) -> bool:
        turn = abs(wrap_angle(one.yaw_rad - other.yaw_rad))
        return one.distance_to(other.x_m, other.y_m) < self.config.scan_spacing_m and (
            turn < math.radians(self.config.scan_spacing_deg)
        )

    @property
    def is_empty(self) -> bool:
        """Whether there is no scan."""
        return not self._kept

    @property
    def everything(self) -> tuple[View, ...]:
        """All scans, oldest first."""
        return tuple(one.view for one in self._kept)

    @property
    def recent(self) -> tuple[View, ...]:
        """Scans of the last metres, over which odometry has hardly drifted, of at least one."""
        least_m = self._kept[-1].travel.driven_m - self.config.recent_m
        return tuple(one.view for one in self._kept if one.travel.driven_m >= least_m)

    @property
    def has_looked_round(self) -> bool:
        """Whether the scans show everything around the robot."""
        headings = [one.travel.heading_rad for one in self._kept]
        return max(headings) - min(headings) >= math.radians(self.config.round_deg)

    def newest(self, count: int) -> tuple[tuple[View, ...], bool]:
        """Return the scans that were kept since `count` had been kept, none while these are too few
        to confirm a place, and whether the robot has hardly left one position meanwhile: turning
        in short strokes adds metres, but shows one room."""
        forgotten = self.count - len(self._kept)
        kept = self._kept[max(count - forgotten, 0) :]
        if not kept:
            return (), False
        views = tuple(one.view for one in kept)
        start = views[0][0]
        away_m = max(start.distance_to(pose.x_m, pose.y_m) for pose, _ in views)
        has_only_turned = away_m < self.config.confirm_m
        turned_rad = kept[-1].travel.turned_rad - kept[0].travel.turned_rad
        if has_only_turned and turned_rad < math.radians(self.config.confirm_turn_deg):
            return (), True
        return views, has_only_turned
