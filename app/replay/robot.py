"""A recording as a robot driver without wheels: it plays its frames by a clock.

The recorded camera need not have been on a robot. The base of each frame is the floor position
below the camera, heading along its view; the rest of the camera pose is the mount of that frame.
So the map is built from the camera's full pose.
"""

from __future__ import annotations

import bisect
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from app.replay.recording import Recording
from navcore.errors import BadConfiguration
from navcore.geometry.transform import STANDSTILL, Matrix, Pose2, Twist, invert, wrap_angle
from navcore.grid.bitplane import LONGEST_SIDE, MOST_CELLS
from navcore.grid.grid import GridSpec
from navcore.grid.growth import is_possible
from navcore.robot.frame import Frame

POLL_S = 0.01
"""Period at which a waiting thread reads the clock."""


class ReplayRobot:
    """A robot driver whose frames were recorded; it ignores commands."""

    def __init__(
        self,
        recording: Recording,
        T_map_world: Matrix,
        *,
        clock: Callable[[], int] = time.monotonic_ns,
        back_and_forth: bool = False,
    ) -> None:
        """Start the recording now; `T_map_world` levels its world frame (`find_floor`).

        At its end the recording stays at the last frame or, `back_and_forth`, plays backwards and
        forwards for ever, without a jump.
        """
        self._recording, self._T_map_world, self._clock = recording, T_map_world, clock
        self._began_ns = clock()
        self._length_ns = recording.stamp_ns(len(recording) - 1)
        self._turns = back_and_forth and self._length_ns > 0
        self._newest: Frame | None = None
        self._read: _Due | None = None

    def now_ns(self) -> int:
        """Return the time of the clock that plays the recording."""
        return self._clock()

    def newest_frame(self) -> Frame | None:
        """Return the last frame that `wait_frame` read: the command thread must not read files."""
        return self._newest

    def wait_frame(self, after: Frame | None, timeout_s: float) -> Frame | None:
        """Wait for a frame other than `after` and return it, or None after the time-out.

        Raises `BadConfiguration` for a damaged image. For one thread only.
        """
        until_s = time.monotonic() + timeout_s
        while True:
            due = self._due()
            if due != self._read:
                self._newest, self._read = self._frame(due), due
            if self._newest is not after:
                return self._newest
            if time.monotonic() >= until_s:
                return None
            time.sleep(POLL_S)

    def send(self, twist: Twist) -> None:
        """Ignore the command: the trajectory was recorded."""

    def close(self) -> None:
        """Do nothing: there is nothing to stop."""

    def _due(self) -> _Due:
        leg, since_ns = 0, self._clock() - self._began_ns
        if self._turns:
            leg, since_ns = divmod(since_ns, self._length_ns)
        last, stamp_ns = len(self._recording) - 1, self._recording.stamp_ns
        if leg % 2 == 0:
            later = bisect.bisect_right(range(last + 1), since_ns, key=stamp_ns)
            return _Due(
                leg=leg,
                index=max(later - 1, 0),
                stamp_ns=leg * self._length_ns + stamp_ns(max(later - 1, 0)),
            )
        index = bisect.bisect_left(range(last + 1), self._length_ns - since_ns, key=stamp_ns)
        return _Due(leg=leg, index=index, stamp_ns=(leg + 1) * self._length_ns - stamp_ns(index))

    def _frame(self, due: _Due) -> Frame:
        T_map_camera = self._T_map_world @ self._recording.T_world_camera[due.index]
        pose = base_below(T_map_camera)
        return Frame(
            stamp_ns=self._began_ns + due.stamp_ns,
            rgb=self._recording.rgb(due.index),
            depth_m=self._recording.depth_m(due.index),
            uncoloured=self._recording.uncoloured(due.index),
            intrinsics=self._recording.intrinsics,
            T_base_camera=invert(pose.matrix()) @ T_map_camera,
            pose=pose,
            twist=self._twist(due, pose),
        )

    def _twist(self, due: _Due, pose: Pose2) -> Twist:
        """Return the velocity since the previous frame, as odometry would measure it:
        along the heading."""
        other = due.index - 1 if due.leg % 2 == 0 else due.index + 1
        if not 0 <= other < len(self._recording):
            if due.leg == 0:
                return STANDSTILL
            # The playback has just turned: the previous frame is the following one.
            other = 2 * due.index - other
        gap_s = abs(self._recording.stamp_ns(due.index) - self._recording.stamp_ns(other)) / 1e9
        before = base_below(self._T_map_world @ self._recording.T_world_camera[other])
        return Twist(
            v_mps=(before.inverse() @ pose).x_m / gap_s,
            w_radps=wrap_angle(pose.yaw_rad - before.yaw_rad) / gap_s,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Due:
    """The frame that is due."""

    leg: int
    """Number of times the playback has turned; odd legs play backwards."""
    index: int
    """Index of the frame in the recording."""
    stamp_ns: int
    """Due time since the first frame."""


def frames_of(recording: Recording, T_map_world: Matrix) -> Iterator[Frame]:
    """Yield every frame once, as the robot gives it when the clock steps from one to the next."""
    now_ns = 0
    robot = ReplayRobot(recording, T_map_world, clock=lambda: now_ns)
    for index in range(len(recording)):
        now_ns = recording.stamp_ns(index)
        if (frame := robot.wait_frame(None, 0.0)) is not None:
            yield frame


def base_below(T_map_camera: Matrix) -> Pose2:
    """Return the pose of a base below the camera, heading along the view."""
    ahead = T_map_camera[:3, 2]
    if math.hypot(ahead[0], ahead[1]) < 1e-6:  # vertical view: take the image's up axis
        ahead = -T_map_camera[:3, 1]
    return Pose2(
        x_m=float(T_map_camera[0, 3]),
        y_m=float(T_map_camera[1, 3]),
        yaw_rad=math.atan2(ahead[1], ahead[0]),
    )


def map_around(
    recording: Recording, T_map_world: Matrix, *, reach_m: float, resolution_m: float
) -> GridSpec:
    """Return the grid of everything within `reach_m` of the camera positions; raises
    `BadConfiguration` where they lie too far apart for one map."""
    positions = recording.T_world_camera[:, :3, 3] @ T_map_world[:2, :3].T + T_map_world[:2, 3]
    low = np.floor((positions.min(axis=0) - reach_m) / resolution_m)
    cols, rows = (
        (np.ceil((positions.max(axis=0) + reach_m) / resolution_m) - low).astype(int).tolist()
    )
    spec = GridSpec(
        resolution_m=resolution_m,
        rows=rows,
        cols=cols,
        origin_x_m=float(low[0]) * resolution_m,
        origin_y_m=float(low[1]) * resolution_m,
    )
    if not is_possible(spec):
        raise BadConfiguration(
            f"{recording.folder}: its map would be {rows} × {cols} cells, possible are "
            f"{MOST_CELLS} in all and {LONGEST_SIDE} a side; use a part of the recording"
        )
    return spec
