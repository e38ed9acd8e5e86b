"""Loop closures applied to the map and to the robot's pose in one step, between two ticks.

The long part runs beside the tick (`navcore.mapping.correction.prepare`). A correction that would
move the robot by more than a little waits until it stands.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from navcore.config.localisation.localisation import TrackingConfig
from navcore.geometry.transform import IDENTITY, Pose2, Twist
from navcore.localisation.localisation import Localisation, Outcome, Task
from navcore.localisation.loops.loop_closure import LoopClosures
from navcore.localisation.tasks import PrepareSearch, SearchPlaces, TaskFailed
from navcore.mapping.correction import MapSnapshot, PreparedCorrection, prepare
from navcore.mapping.point_map import PointMap

_STANDING_MPS, _STANDING_RADPS = 0.01, 0.05
"""Speed and yaw rate below which the robot stands; a gyroscope has a bias."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PrepareCorrection:
    """Compute the map at corrected poses."""

    snapshot: MapSnapshot
    """The map as it is."""
    poses: Mapping[int, Pose2]
    """Corrected T_map_base by pose ID."""

    def run(self, is_cancelled: Callable[[], bool]) -> PreparedCorrection:
        """Return the corrected map."""
        del is_cancelled
        return prepare(self.snapshot, self.poses)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AppliedCorrection:
    """A correction that was applied."""

    before: tuple[Pose2, ...]
    """T_map_base of every pose ID before."""
    after: tuple[Pose2, ...]
    """The same after it."""
    motion: Pose2 = IDENTITY
    """T_new_old of the robot."""
    loops: int = 0
    """Number of loops that were closed; none where another program has corrected poses."""

    def following(self, earlier: AppliedCorrection) -> AppliedCorrection:
        """Return an earlier correction and this one as one."""
        return AppliedCorrection(
            before=(*earlier.before, *self.before[len(earlier.before) :]),
            after=self.after,
            motion=self.motion @ earlier.motion,
            loops=earlier.loops + self.loops,
        )


class MapCorrection:
    """Carries loop closures from localisation to the map."""

    def __init__(
        self, point_map: PointMap, localisation: Localisation, config: TrackingConfig
    ) -> None:
        self._map, self._localisation, self._config = point_map, localisation, config
        self._prepared: PreparedCorrection | None = None
        self._prepared_for: LoopClosures | None = None
        self._waits = False

    def next_task(self) -> Task | PrepareCorrection | None:
        """Return what to compute now beside the tick; None for nothing."""
        closures = self._localisation.closures
        if closures is None:
            return self._localisation.next_task()
        if closures is self._prepared_for:
            return None
        poses, _ = self._localisation.corrected(closures)
        self._prepared, self._prepared_for = None, closures
        return PrepareCorrection(snapshot=self._map.snapshot(), poses=poses)

    def take(self, outcome: Outcome | PreparedCorrection | TaskFailed) -> None:
        """Receive the outcome of a task. Loops whose correction could not be computed are given up;
        the next ones come with the next keyframes. A search that has failed is tried again once the
        robot has moved."""
        if isinstance(outcome, PreparedCorrection):
            self._prepared = outcome
        elif isinstance(outcome, TaskFailed):
            if isinstance(outcome.task, PrepareCorrection):
                self._prepared_for = self._localisation.closures = None
            elif isinstance(outcome.task, PrepareSearch | SearchPlaces):
                self._localisation.put_off_search()
        else:
            self._localisation.take(outcome)

    @property
    def waits_for_standstill(self) -> bool:
        """Whether a correction is too large to be applied while the robot drives."""
        return self._waits or self._localisation.waits_for_standstill

    def apply(self, T_map_base: Pose2, twist: Twist) -> AppliedCorrection | None:
        """Apply a prepared correction if the robot's pose and velocity allow it now."""
        self._waits = False
        closures, prepared = self._localisation.closures, self._prepared
        if closures is None or prepared is None or closures is not self._prepared_for:
            return None
        poses, motion = self._localisation.corrected(closures)
        stands = abs(twist.v_mps) < _STANDING_MPS and abs(twist.w_radps) < _STANDING_RADPS
        if is_large(T_map_base, motion, self._config) and not stands:
            self._waits = True
            return None
        before, known = self._map.poses, len(prepared.pose_ids)
        self._prepared = self._prepared_for = None
        later = {pose_id: poses[pose_id] for pose_id in poses if pose_id >= known}
        if not self._map.apply(prepared, later):
            return None  # the map has changed otherwise: it is prepared again
        self._localisation.correct(closures, poses)
        return AppliedCorrection(
            before=before,
            after=self._map.poses,
            motion=motion,
            loops=len(closures.new_loops),
        )


def is_large(T_map_base: Pose2, motion: Pose2, config: TrackingConfig) -> bool:
    """Return whether a correction, T_new_old, moves a robot at a pose by more than flows in while
    it drives."""
    moved = motion @ T_map_base
    return moved.distance_to(T_map_base.x_m, T_map_base.y_m) > config.pending_m or abs(
        motion.yaw_rad
    ) > math.radians(config.pending_deg)
