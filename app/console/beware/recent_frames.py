"""Camera frames of the last minutes, on which an edit of the beware list is tried and which show
what the map would have held under it."""

from __future__ import annotations

import dataclasses
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from navcore.errors import Refused
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.robot.frame import Frame

MAX_FRAMES = 60
"""Largest number of frames."""
MAX_PIXELS = MAX_FRAMES * 424 * 240
"""Largest number of pixels of all frames, 7 bytes each; of finer images fewer frames are kept."""
MAX_AGE_S = 300.0
"""Age from which a frame is forgotten, seconds."""
STEP_M = 0.2
"""Distance from the frame before that makes one worth keeping, metres."""
STEP_RAD = 0.2
"""Turn from the frame before that makes one worth keeping, radians."""
STANDING_S = 10.0
"""Time after which a frame is kept in any case, seconds: the world may have changed."""
SHOWN_S = 3.0
"""Age up to which every frame is held, seconds: it may be on a screen, where it is clicked."""
SHOWN_PIXELS = MAX_PIXELS // 3
"""Largest number of pixels of these frames."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecentFrame:
    """Frame of the last minutes."""

    frame: Frame
    """The frame, placed in the map as of its capture."""
    pose_id: int
    """Pose ID of its points."""
    T_id_base: Pose2
    """Pose of the robot in the frame of the pose ID's pose, so that a correction moves it along."""
    erasures: int
    """Number of the newest erasure of the map before the frame."""

    @property
    def T_map_id(self) -> Pose2:
        """Pose of the pose ID at the capture."""
        return self.frame.pose @ self.T_id_base.inverse()

    @property
    def name(self) -> str:
        """Name of the frame, by which a click refers to it: its stamp in nanoseconds."""
        return str(self.frame.stamp_ns)

    def placed(self, poses: Sequence[Pose2]) -> Frame:
        """Return the frame at the present pose of its ID."""
        pose = poses[self.pose_id] @ self.T_id_base
        return dataclasses.replace(self.frame, pose=pose)


class RecentFrames:
    """Noted by the think thread; forgotten and read by any."""

    def __init__(self) -> None:
        self._kept: deque[RecentFrame] = deque(maxlen=MAX_FRAMES)
        self._shown: deque[RecentFrame] = deque()
        self._lock = threading.Lock()

    def note(self, frame: Frame, pose_id: int, T_map_id: Pose2, erasures: int = 0) -> None:
        """Note a frame that is placed in the map, with the pose ID of its points and the number of
        the newest erasure of the map."""
        one = RecentFrame(
            frame=frame,
            pose_id=pose_id,
            T_id_base=T_map_id.inverse() @ frame.pose,
            erasures=erasures,
        )
        with self._lock:
            self._shown.append(one)
            while len(self._shown) > max(1, SHOWN_PIXELS // frame.depth_m.size) or (
                self._age_s(self._shown[0], one) > SHOWN_S
            ):
                self._shown.popleft()
            while self._kept and self._age_s(self._kept[0], one) > MAX_AGE_S:
                self._kept.popleft()
            if not self._kept or self._is_new(self._kept[-1], one):
                self._kept.append(one)
                while len(self._kept) > max(1, MAX_PIXELS // frame.depth_m.size):
                    self._kept.popleft()

    def forget(self) -> None:
        """Forget all frames: the robot is at another site now."""
        with self._lock:
            self._kept.clear()
            self._shown.clear()

    @property
    def newest(self) -> RecentFrame | None:
        """Newest frame; None before the first."""
        with self._lock:
            return self._shown[-1] if self._shown else None

    def named(self, name: str | None) -> RecentFrame:
        """Return the frame with a name, the newest one for None. Raises `Refused` where it is no
        longer held, and before the first."""
        with self._lock:
            shown, kept = tuple(self._shown)[::-1], tuple(self._kept)[::-1]
        if not shown:
            raise Refused("the camera has delivered no image yet; wait for one")
        if name is None:
            return shown[0]
        for one in (*shown, *kept):
            if one.name == name:
                return one
        raise Refused("that image is no longer kept: the picture has moved on; click again")

    @property
    def all(self) -> tuple[RecentFrame, ...]:
        """All frames, newest first."""
        with self._lock:
            newest, kept = tuple(self._shown)[-1:], tuple(self._kept)[::-1]
        return kept if newest == kept[:1] else newest + kept

    @property
    def kept(self) -> tuple[RecentFrame, ...]:
        """Frames that are kept for minutes, newest first."""
        with self._lock:
            return tuple(self._kept)[::-1]

    @staticmethod
    def _age_s(older: RecentFrame, newer: RecentFrame) -> float:
        return (newer.frame.stamp_ns - older.frame.stamp_ns) / 1e9

    def _is_new(self, last: RecentFrame, one: RecentFrame) -> bool:
        before, now = last.frame.pose, one.frame.pose
        return (
            before.distance_to(now.x_m, now.y_m) >= STEP_M
            or abs(wrap_angle(now.yaw_rad - before.yaw_rad)) >= STEP_RAD
            or self._age_s(last, one) >= STANDING_S
        )
