"""What is asked of map and place between two ticks: only the think thread changes these, before the
next tick."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

from navcore.errors import BadFrame
from navcore.geometry.transform import Matrix, Pose2
from navcore.mapping.point_map import PointMap
from navcore.navigator import Navigator
from navcore.robot.frame import Frame, check_frame

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShownPlace:
    """Where an operator has put the robot."""

    T_map_base: Pose2
    """The place."""
    covariance: Matrix
    """Its (3, 3) covariance."""
    is_sure: bool = True
    """Whether the scans confirm it: else it has to prove itself."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MapRequests:
    """Requests since the last tick."""

    replace_map: Callable[[], None] | None = None
    """Replaces the map, as for another site; None to keep it."""
    poses: Mapping[int, Pose2] = field(default_factory=dict)
    """Corrected past poses by pose ID."""
    edits: tuple[Callable[[PointMap], None], ...] = ()
    """Edits of the map, in order."""
    trust_pose: bool = False
    """Whether the pose of the next frame counts, whatever came before."""
    search: bool = False
    """Whether to forget the place and look for it in the whole map."""
    place: ShownPlace | None = None
    """Place at the next frame; None to keep the estimate."""

    @property
    def concerns_place(self) -> bool:
        """Whether the robot is somewhere else on the map, or on another one, from the next tick
        on."""
        is_map = self.replace_map is not None or bool(self.poses)
        return is_map or self.trust_pose or self.search or self.place is not None

    def before(self, newer: MapRequests) -> MapRequests:
        """Return newer requests after these: of two places the newer one counts, and of what is
        meant for a map none on another one."""
        if newer.replace_map is not None:
            return dataclasses.replace(newer, trust_pose=newer.trust_pose or self.trust_pose)
        return MapRequests(
            replace_map=self.replace_map,
            poses={**self.poses, **newer.poses},
            edits=(*self.edits, *newer.edits),
            trust_pose=newer.trust_pose or self.trust_pose,
            search=newer.search or (self.search and newer.place is None),
            place=newer.place or (None if newer.search else self.place),
        )

    def apply(self, navigator: Navigator, frame: Frame | None) -> MapRequests:
        """Do what was asked, before the tick of a frame; return what has to wait for another one.

        Whatever places the robot by its odometry waits without a frame that can be believed (None),
        and with one that is malformed. A request that fails keeps no other from being done, but for
        another map, which all others wait for: raises what that raises, and has done nothing else.
        """
        if self.replace_map is not None:
            self.replace_map()
            navigator.reset_pose()
        if self.poses:  # of a map that was replaced since, perhaps
            attempt(lambda: navigator.correct_poses(self.poses))
        for edit in self.edits:  # of two at once the first may have left no room
            attempt(partial(edit, navigator.map))
        later = dataclasses.replace(self, replace_map=None, poses={}, edits=())
        if frame is None or not (self.trust_pose or self.search or self.place):
            return later
        try:
            check_frame(frame)
        except BadFrame:
            return later
        if self.trust_pose:
            attempt(lambda: navigator.accept_jump(frame))
        if self.search:
            attempt(lambda: navigator.localisation.search(frame.stamp_ns))
        if self.place is not None:
            shown = self.place
            attempt(
                lambda: navigator.place_robot(
                    shown.T_map_base, shown.covariance, frame, is_sure=shown.is_sure
                )
            )
        return MapRequests()


def attempt(act: Callable[[], object]) -> None:
    """Do one thing of several: whatever it raises is logged, so that the others are done."""
    try:
        act()
    except Exception:
        log.exception("a request about map or place failed; the others are done")
