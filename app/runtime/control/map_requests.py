"""What is asked of map and place between two ticks: only the think thread changes these, before the
next tick."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from navcore.geometry.transform import Matrix, Pose2
from navcore.mapping.point_map import PointMap
from navcore.navigator import Navigator
from navcore.robot.frame import Frame


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
    place: tuple[Pose2, Matrix] | None = None
    """T_map_base at the next frame with its (3, 3) covariance; None to keep the estimate."""

    def apply(self, navigator: Navigator, frame: Frame) -> None:
        """Do what was asked, before the tick of a frame."""
        if self.replace_map is not None:
            self.replace_map()
        if self.poses:
            navigator.map.correct(self.poses)
        for edit in self.edits:
            edit(navigator.map)
        if self.replace_map is not None or self.trust_pose:
            navigator.reset_pose()
        if self.search:
            navigator.localisation.search(frame.stamp_ns)
        if self.place is not None:
            navigator.place_robot(*self.place, frame)
