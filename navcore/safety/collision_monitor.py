"""How soon a motion would end in contact, by the newest depth pictures alone: no map, no planner.

Only what is higher than 10 cm above the ground and lies in what the footprint sweeps along the
commanded arc counts, plus a little room, and only where several pixels agree; and the edge beyond
which the ground drops. The camera does not see what is right before the robot's corners, or low
before its front: what has just gone out of sight there is remembered for a while. Of what was never
seen this knows nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.geometry.arrays import FloatImage
from navcore.geometry.kinematics import arc_position
from navcore.geometry.transform import Pose2, Twist, invert
from navcore.perception.ground import FARTHEST_M, ground_heights
from navcore.robot.frame import Frame
from navcore.robot.profile import RobotProfile

NearPoints = npt.NDArray[np.float32]

LOWEST_M, HIGHEST_M = 0.10, 1.5
"""Of what can be run into; the same as the navigator's defaults, but none of its settings."""
DROP_M, SLOPE = 0.15, 0.2
"""And of what can be fallen into, and of ground that goes on."""
REACH_M = 2.5
"""Farther from the robot's middle than this nothing is imminent."""
AHEAD_M, ASIDE_M = 0.03, 0.01
"""Room kept before and behind the footprint, and beside it; less beside, or narrow doors would be
shut."""
STRIDE = 2
"""Every so manieth row and column is looked at."""
PIXELS = 4
"""So many of them must be hit before it is a thing and no speckle."""
HORIZON_S = 1.0
"""Contact later than this is not imminent: at full speed the robot stops within 0.5 s, seen late
within 0.9 s."""
STEP_M = 0.02
"""No point of the body moves further than this between two looks."""
REACTION_S = 0.25
"""From the moment a thing is there to the moment the wheels brake: next picture, next command, and
the link."""
AFTER_FRAME_S = 0.15
"""The same from the capture of a picture that is late."""
REMEMBERED_NS = 5_000_000_000
"""What went out of sight is taken to be where it was for so long."""
CREEP_MPS = 0.03
"""If it may move no faster than this, the robot stands."""
NO_POINTS: NearPoints = np.empty((0, 2), dtype=np.float32)


def near_points(frame: Frame) -> NearPoints:
    """(N, 2) x and y in the base frame of the pixels that show something to run into, of a frame
    that passes `check_frame`."""
    lens, mount = frame.intrinsics, frame.T_base_camera.astype(np.float32)
    return np.asarray(
        _near(
            frame.depth_m, ground_heights(frame, SLOPE), mount, lens.fx, lens.fy, lens.cx, lens.cy
        )
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecentObstacles:
    """What there is to run into; a value with its transition, one for each picture."""

    points: NearPoints = field(default_factory=lambda: NO_POINTS)
    """(N, 2) x and y in the base frame: what the newest picture shows, and what went out of sight
    before it …"""
    seen_ns: npt.NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    """… and (N,) stamps of the pictures that showed it."""
    pose: Pose2 | None = None
    """T_map_base of the newest picture, by odometry."""

    def after(self, frame: Frame) -> RecentObstacles:
        """With one more picture, one that passes `check_frame`: what it looks at no more stays for
        `REMEMBERED_NS`."""
        shown = near_points(frame)
        stamps = np.full(len(shown), frame.stamp_ns)
        if self.pose is None or not len(self.points):
            return RecentObstacles(points=shown, seen_ns=stamps, pose=frame.pose)
        moved = frame.pose.from_parent(self.pose.to_parent(self.points.astype(np.float64)))
        age_ns = frame.stamp_ns - self.seen_ns
        kept = (
            ~_in_sight(moved, frame)
            & (np.hypot(*moved.T) < REACH_M)
            & (age_ns >= 0)
            & (age_ns < REMEMBERED_NS)
        )
        return RecentObstacles(
            points=np.vstack([shown, moved[kept].astype(np.float32)]),
            seen_ns=np.concatenate([stamps, self.seen_ns[kept]]),
            pose=frame.pose,
        )


def _in_sight(points: npt.NDArray[np.float64], frame: Frame) -> npt.NDArray[np.bool_]:
    """(N,) whether the picture shows the lowest thing that counts at each of (N, 2) places, base
    frame."""
    lens, T_camera_base = frame.intrinsics, invert(frame.T_base_camera)
    x, y, z = (
        T_camera_base[:3, :3] @ np.vstack([points.T, np.full(len(points), LOWEST_M)])
        + T_camera_base[:3, 3:]
    )
    ahead = np.maximum(z, 1e-6)
    u, v = lens.fx * x / ahead + lens.cx, lens.fy * y / ahead + lens.cy
    return np.asarray(
        (z > 0) & (u >= 0) & (u <= lens.width - 1) & (v >= 0) & (v <= lens.height - 1)
    )


def time_to_contact(points: NearPoints, twist: Twist, profile: RobotProfile) -> float:
    """Seconds after which the footprint, driving this arc, meets the points; infinite when it does
    not within `HORIZON_S`.

    `points` is (N, 2), base frame. A point inside the body at the start is noise; one within the
    room kept around it counts only when the body itself would go over it, so that the robot can
    turn away from what it stands close to.
    """
    speed = abs(twist.v_mps) + abs(twist.w_radps) * profile.circumscribed_radius_m
    if len(points) == 0 or speed == 0.0:
        return math.inf
    return float(
        _meeting(
            points,
            twist.v_mps,
            twist.w_radps,
            profile.length_m / 2,
            profile.width_m / 2,
            STEP_M / speed,
        )
    )


def braking_s(twist: Twist, profile: RobotProfile) -> float:
    """How long the platform takes to brake from a velocity."""
    return max(
        abs(twist.v_mps) / profile.max_accel_mps2, abs(twist.w_radps) / profile.max_yaw_accel_radps2
    )


def allowed_share(
    contact_s: float, twist: Twist, *, frame_age_s: float, profile: RobotProfile
) -> float:
    """The largest share of a velocity from which the robot still stops before contact, 0 to 1.

    At the share f the way to contact lasts `contact_s` / f, and stopping takes a reaction and f ·
    braking time / 2 of it: v·t + v²/2a ≤ distance, with both sides divided by v, and the same for
    turning.
    """
    late_s, half_braking_s = (
        max(REACTION_S, frame_age_s + AFTER_FRAME_S),
        braking_s(twist, profile) / 2,
    )
    if contact_s >= late_s + half_braking_s:
        return 1.0
    # f² · half_braking_s + f · late_s = contact_s
    return 2 * contact_s / (late_s + math.sqrt(late_s**2 + 4 * half_braking_s * contact_s))


@compiled
def _near(
    depth_m: npt.NDArray[np.float32],
    ground_m: FloatImage,
    t: npt.NDArray[np.float32],
    fx: float,
    fy: float,
    cx: float,
    cy: float,
) -> NearPoints:
    """Column by column, upward in the picture: where the ground drops, the last that was seen of it
    is the edge."""
    height, width = depth_m.shape
    found, count = (
        np.empty(((height // STRIDE + 1) * (width // STRIDE + 1), 2), dtype=np.float32),
        0,
    )
    for j in range(0, width, STRIDE):
        a, edge_x, edge_y, dropped = (
            np.float32((j - cx) / fx),
            np.float32(np.inf),
            np.float32(np.inf),
            False,
        )
        for i in range(height - 1, -1, -STRIDE):
            depth = depth_m[i, j]
            if not 0 < depth <= FARTHEST_M:
                continue
            b = np.float32((i - cy) / fy)
            x = (t[0, 0] * a + t[0, 1] * b + t[0, 2]) * depth + t[0, 3]
            y = (t[1, 0] * a + t[1, 1] * b + t[1, 2]) * depth + t[1, 3]
            z = (t[2, 0] * a + t[2, 1] * b + t[2, 2]) * depth + t[2, 3] - ground_m[i, j]
            if LOWEST_M < z < HIGHEST_M and depth < REACH_M:
                found[count, 0], found[count, 1] = x, y
                count += 1
            elif z < -DROP_M and not dropped and min(edge_x, x) < REACH_M:
                found[count, 0], found[count, 1] = (edge_x, edge_y) if edge_x < np.inf else (x, y)
                count, dropped = count + 1, True
            elif abs(z) <= LOWEST_M:
                edge_x, edge_y = x, y
    return found[:count].copy()


@compiled
def _meeting(
    points: NearPoints,
    v_mps: float,
    w_radps: float,
    half_length: float,
    half_width: float,
    step_s: float,
) -> float:
    reach = half_length + half_width + abs(v_mps) * HORIZON_S + AHEAD_M
    near, wide, count = np.empty_like(points), np.empty(len(points), dtype=np.bool_), 0
    for n in range(len(points)):
        x, y = points[n, 0], points[n, 1]
        if not (abs(x) < reach and abs(y) < reach) or (
            abs(x) <= half_length and abs(y) <= half_width
        ):
            continue
        near[count, 0], near[count, 1] = x, y
        wide[count] = abs(x) > half_length + AHEAD_M or abs(y) > half_width + ASIDE_M
        count += 1
    if count < PIXELS:
        return np.inf
    steps = math.ceil(HORIZON_S / step_s)
    for step in range(1, steps + 1):
        t = min(step * step_s, HORIZON_S)
        turn = w_radps * t
        sin, cos = math.sin(turn), math.cos(turn)
        at_x, at_y = arc_position(v_mps, w_radps, t)
        hit = 0
        for n in range(count):
            dx, dy = near[n, 0] - at_x, near[n, 1] - at_y
            x, y = abs(cos * dx + sin * dy), abs(cos * dy - sin * dx)
            if wide[n]:
                x, y = x - AHEAD_M, y - ASIDE_M
            hit += x <= half_length and y <= half_width
        if hit >= PIXELS:
            return (step - 1) * step_s
    return np.inf
