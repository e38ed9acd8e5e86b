"""A recording as a robot: it plays its frames by a clock, and its wheels are nowhere.

The recorded camera need not have sat on a robot. Each frame's base is the place on the floor beneath the camera, heading where
it looks; what is left of the camera's pose is that frame's mount. So the map is built from the camera's full pose.
"""

from __future__ import annotations

import bisect
import math
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np

from app.recording import Recording
from navcore.frame import Frame
from navcore.grid import GridSpec
from navcore.robot import STANDSTILL, Twist
from navcore.transform import Matrix, Pose2, invert, wrap_angle

POLL_S = 0.01


class ReplayRobot:
    """A `Robot` whose senses were recorded. Velocities sent to it go nowhere."""

    def __init__(self, recording: Recording, T_map_world: Matrix, *, clock: Callable[[], int] = time.monotonic_ns) -> None:
        """The first frame is due now; `T_map_world` levels the recording's world (`floor.find_floor`)."""
        self._recording, self._T_map_world, self._clock = recording, T_map_world, clock
        self._began_ns = clock()
        self._newest: tuple[int, Frame] | None = None
        self._reading = threading.Lock()

    def now_ns(self) -> int:
        """The clock it is played by."""
        return self._clock()

    def newest_frame(self) -> Frame:
        """The last frame that is due; after the recording's end, its last. Raises `BadConfiguration` for a damaged picture."""
        with self._reading:
            index = self._due()
            if self._newest is None or self._newest[0] != index:
                self._newest = (index, self._frame(index))
            return self._newest[1]

    def wait_frame(self, after: Frame | None, timeout_s: float) -> Frame | None:
        """The newest picture if it is another than `after`, waiting for it; None when none comes in time."""
        until_s = time.monotonic() + timeout_s
        while (frame := self.newest_frame()) is after:
            if time.monotonic() >= until_s:
                return None
            time.sleep(POLL_S)
        return frame

    def send(self, twist: Twist) -> None:
        """What was driven is past."""

    def close(self) -> None:
        """Nothing moves."""

    def _due(self) -> int:
        since_ns = self._clock() - self._began_ns
        later = bisect.bisect_right(range(len(self._recording)), since_ns, key=self._recording.stamp_ns)
        return max(later - 1, 0)

    def _frame(self, index: int) -> Frame:
        T_map_camera = self._T_map_world @ self._recording.T_world_camera[index]
        pose = base_beneath(T_map_camera)
        return Frame(
            stamp_ns=self._began_ns + self._recording.stamp_ns(index),
            rgb=self._recording.rgb(index),
            depth_m=self._recording.depth_m(index),
            intrinsics=self._recording.intrinsics,
            T_base_camera=invert(pose.matrix()) @ T_map_camera,
            pose=pose,
            twist=self._twist(index, pose),
        )

    def _twist(self, index: int, pose: Pose2) -> Twist:
        """Since the frame before, as wheels would tell it."""
        if index == 0:
            return STANDSTILL
        gap_s = (self._recording.stamp_ns(index) - self._recording.stamp_ns(index - 1)) / 1e9
        before = base_beneath(self._T_map_world @ self._recording.T_world_camera[index - 1])
        return Twist(
            v_mps=before.distance_to(pose.x_m, pose.y_m) / gap_s,
            w_radps=wrap_angle(pose.yaw_rad - before.yaw_rad) / gap_s,
        )


def frames_of(recording: Recording, T_map_world: Matrix) -> Iterator[Frame]:
    """Every frame once, as the robot gives it when the clock goes from one to the next."""
    now_ns = 0
    robot = ReplayRobot(recording, T_map_world, clock=lambda: now_ns)
    for index in range(len(recording)):
        now_ns = recording.stamp_ns(index)
        yield robot.newest_frame()


def base_beneath(T_map_camera: Matrix) -> Pose2:
    """Where a robot would stand that has this camera above the middle of its base, heading where it looks."""
    ahead = T_map_camera[:3, 2]
    if math.hypot(ahead[0], ahead[1]) < 1e-6:  # it looks straight down or up: along the picture's upper edge then
        ahead = -T_map_camera[:3, 1]
    return Pose2(x_m=float(T_map_camera[0, 3]), y_m=float(T_map_camera[1, 3]), yaw_rad=math.atan2(ahead[1], ahead[0]))


def map_around(recording: Recording, T_map_world: Matrix, *, reach_m: float, resolution_m: float) -> GridSpec:
    """The grid of all that the camera can have measured from where it was."""
    places = recording.T_world_camera[:, :3, 3] @ T_map_world[:2, :3].T + T_map_world[:2, 3]
    low = np.floor((places.min(axis=0) - reach_m) / resolution_m)
    cols, rows = (np.ceil((places.max(axis=0) + reach_m) / resolution_m) - low).astype(int).tolist()
    return GridSpec(
        resolution_m=resolution_m,
        rows=rows,
        cols=cols,
        origin_x_m=float(low[0]) * resolution_m,
        origin_y_m=float(low[1]) * resolution_m,
    )
