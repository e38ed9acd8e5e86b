"""Time to contact by the newest depth images and laser scan alone: no map, no planner.

Only measurements higher than 10 cm above the ground in the area that the footprint sweeps along the
commanded arc count, with a small clearance, and only where several points agree; and the edge
beyond which the ground drops. The camera does not see what is right before the robot's corners, or
low before its front: what has just gone out of sight there is remembered for a while, unless what
stood upright on it is seen to have gone: the legs of a person have then gone with the body. A
laser scan shows all round what is as high as the scanner. Obstacles that were never seen are
unknown here.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, inlined
from navcore.config.safety import DEFAULT_SAFETY, CollisionMonitorConfig
from navcore.geometry.arrays import Bools, FloatImage, Floats, Indices
from navcore.geometry.camera import NEAREST_M, Pinhole, column_slope, point_on_ray, row_slope
from navcore.geometry.kinematics import arc_position
from navcore.geometry.transform import IDENTITY, Pose2, Twist, invert
from navcore.perception.ground import ground_heights
from navcore.robot.frame import Frame
from navcore.robot.profile import RobotProfile

NearPoints = npt.NDArray[np.float32]
"""(N, 2) x and y in metres of the base frame."""
Tops = npt.NDArray[np.float32]
"""(N,) heights in metres above the ground."""
NO_POINTS: NearPoints = np.empty((0, 2), dtype=np.float32)
_COLUMN_M = 0.1
"""Side in metres of the cells, and height of the slices, in which points stand upright on each
other."""
_SLICES = 32
"""Number of these slices, one bit each."""
_BEHIND_M = 0.15
"""Distance in metres behind a point from which a measurement tells that the point has gone."""
_DEFAULT = DEFAULT_SAFETY.collision


class _Limits(NamedTuple):
    """Heights and distances in metres, as compiled kernels take them."""

    obstacle_height_m: float
    ceiling_m: float
    drop_m: float
    range_m: float
    max_depth_m: float


class _Sweep(NamedTuple):
    """Footprint and horizon of a collision check, as compiled kernels take them."""

    half_length_m: float
    half_width_m: float
    ahead_m: float
    aside_m: float
    horizon_s: float
    step_s: float
    min_points: int


def _heights(frame: Frame, profile: RobotProfile, config: CollisionMonitorConfig) -> NearPoints:
    """Return the (N, 3) x, y in metres of the base frame and height above the ground of the
    obstacle pixels of a frame that passes `check_frame`; the edge of a drop has the height 0."""
    limits = _Limits(
        obstacle_height_m=config.obstacle_height_m,
        ceiling_m=profile.ceiling_m,
        drop_m=config.drop_m,
        range_m=config.range_m,
        max_depth_m=config.max_depth_m,
    )
    return np.asarray(
        _obstacle_points(
            frame.depth_m,
            ground_heights(frame, config.max_slope),
            frame.T_base_camera.astype(np.float32),
            frame.intrinsics.pinhole,
            limits,
            frame.intrinsics.length_px(config.stride_px),
        )
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecentObstacles:
    """Obstacle points of the newest frames: a value with its transition, one for each frame."""

    points: NearPoints = field(default_factory=lambda: NO_POINTS)
    """(N, 2) x and y in metres of the base frame: those of the newest frame, and those that went
    out of sight before it."""
    seen_ns: Indices = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    """(N,) stamps in nanoseconds of the frames that showed the points."""
    tops_m: Tops = field(default_factory=lambda: np.empty(0, dtype=np.float32))
    """(N,) heights in metres up to which something stood upright on the points then."""
    scanned: NearPoints = field(default_factory=lambda: NO_POINTS)
    """(M, 2) x and y in metres of the base frame of what the newest laser scan shows."""
    pose: Pose2 | None = None
    """T_map_base of the newest frame by odometry; None before the first."""

    def after(
        self, frame: Frame, profile: RobotProfile, config: CollisionMonitorConfig = _DEFAULT
    ) -> RecentObstacles:
        """Return the obstacles after one more frame, one that passes `check_frame`: points that it
        no longer looks at stay for `memory_s`."""
        heights, scanned = _heights(frame, profile, config), _scanned(frame, config)
        shown, tops_m = heights[:, :2].copy(), _tops(heights, config.range_m)
        stamps = np.full(len(shown), frame.stamp_ns)
        if self.pose is None or not len(self.points):
            return RecentObstacles(
                points=shown, seen_ns=stamps, tops_m=tops_m, scanned=scanned, pose=frame.pose
            )
        moved = frame.pose.from_parent(self.pose.to_parent(self.points.astype(np.float64)))
        kept = _remembered(
            moved,
            frame.stamp_ns - self.seen_ns,
            self.tops_m,
            shown,
            invert(frame.T_base_camera),
            frame.intrinsics.pinhole,
            frame.depth_m,
            (config.obstacle_height_m, config.range_m),
            config.memory_ns,
            (config.memory_cell_m, config.min_points),
        )
        return RecentObstacles(
            points=np.vstack([shown, moved[kept].astype(np.float32)]),
            seen_ns=np.concatenate([stamps, self.seen_ns[kept]]),
            tops_m=np.concatenate([tops_m, self.tops_m[kept]]),
            scanned=scanned,
            pose=frame.pose,
        )

    def carried(self, frame: Frame, config: CollisionMonitorConfig = _DEFAULT) -> RecentObstacles:
        """Return the obstacles after a frame that repeats the image of the one before: by odometry
        they stay where they were seen, while the robot drives on towards them."""
        if self.pose is None:
            return self
        moved = frame.pose.from_parent(self.pose.to_parent(self.points.astype(np.float64)))
        return dataclasses.replace(
            self,
            points=moved.astype(np.float32),
            scanned=_scanned(frame, config),
            pose=frame.pose,
        )

    @property
    def all_points(self) -> NearPoints:
        """(N + M, 2) x and y in metres of the base frame of all obstacles."""
        return np.vstack([self.points, self.scanned]) if len(self.scanned) else self.points


def _scanned(frame: Frame, config: CollisionMonitorConfig) -> NearPoints:
    """Return the (M, 2) x and y in metres of the base frame of a frame's scan within range.

    A scan is coarser than the image: two rays that agree are an obstacle, one may be noise.
    """
    if frame.scan is None:
        return NO_POINTS
    hits = frame.scan.hits()
    near = hits[np.hypot(*hits.T) < config.range_m].astype(np.float32)
    return np.repeat(near, math.ceil(config.min_points / 2), axis=0)


def time_to_contact(
    points: NearPoints,
    twist: Twist,
    profile: RobotProfile,
    config: CollisionMonitorConfig = _DEFAULT,
    *,
    start: Pose2 = IDENTITY,
) -> float:
    """Return the time in seconds after which the footprint, driving this arc, meets the points;
    infinite when it does not within `horizon_s`.

    `points` is (N, 2) in metres of the base frame in which they were measured, and `start` the pose
    in it from which the robot drives the arc. A point inside the body where it was measured is
    noise; one within the clearance around the start counts only when the body itself would touch
    it, so that the robot can turn away from what it stands close to.
    """
    speed = profile.fastest_mps(twist)
    if len(points) == 0 or speed == 0.0:
        return math.inf
    sweep = _Sweep(
        half_length_m=profile.length_m / 2,
        half_width_m=profile.width_m / 2,
        ahead_m=config.padding_ahead_m,
        aside_m=config.padding_aside_m,
        horizon_s=config.horizon_s,
        step_s=config.step_m / speed,
        min_points=config.min_points,
    )
    begin = float(start.x_m), float(start.y_m), float(start.yaw_rad)
    return float(_contact_time(points, begin, float(twist.v_mps), float(twist.w_radps), sweep))


def braking_s(twist: Twist, profile: RobotProfile) -> float:
    """Return the time in seconds that the platform takes to brake from a velocity."""
    return max(
        abs(twist.v_mps) / profile.max_accel_mps2, abs(twist.w_radps) / profile.max_yaw_accel_radps2
    )


def allowed_share(
    contact_s: float,
    twist: Twist,
    *,
    frame_age_s: float,
    profile: RobotProfile,
    config: CollisionMonitorConfig = _DEFAULT,
) -> float:
    """Return the largest share of a velocity, 0 to 1, from which the robot still stops before
    contact.

    At the share f the distance to contact lasts `contact_s` / f, and stopping takes a reaction and
    f · braking time / 2 of it: v·t + v²/2a ≤ distance, with both sides divided by v, and the same
    for turning. Of the reaction, what the image is old has passed: contact is counted from now.
    """
    late_s = max(config.reaction_s - frame_age_s, config.reaction_after_frame_s)
    half_braking_s = braking_s(twist, profile) / 2
    if contact_s >= late_s + half_braking_s:
        return 1.0
    # f² · half_braking_s + f · late_s = contact_s
    return 2 * contact_s / (late_s + math.sqrt(late_s**2 + 4 * half_braking_s * contact_s))


@compiled
def _remembered(
    points: Floats,
    age_ns: Indices,
    tops_m: Tops,
    shown: NearPoints,
    t: Floats,
    lens: Pinhole,
    depth_m: FloatImage,
    limits_m: tuple[float, float],
    memory_ns: int,
    thinning: tuple[float, int],
) -> Bools:
    """Return (N,) which of (N, 2) points in metres of the base frame, the newest first, stay known:
    those that are near and not too old, and out of sight at the height of an obstacle, unless the
    image looks past what stood upright on them; of each cell of the floor the newest ones only.

    `tops_m` is (N,) the heights up to which it stood, `shown` (M, 2) the points of the image, `t`
    T_camera_base, `limits_m` the height and the range, and `thinning` the side of a cell in metres
    and the number of its points.
    """
    (height, width), (height_m, range_m), (cell_m, most) = depth_m.shape, limits_m, thinning
    columns = int(range_m / _COLUMN_M) + 2
    stands = np.zeros((2 * columns, 2 * columns), dtype=np.bool_)
    for n in range(len(shown)):
        i, j = _column(shown[n, 0], columns), _column(shown[n, 1], columns)
        stands[i - 1 : i + 2, j - 1 : j + 2] = True
    side = 2 * (int(range_m / cell_m) + 1)
    counts = np.zeros((side, side), dtype=np.uint8)
    kept = np.empty(len(points), dtype=np.bool_)
    for n in range(len(points)):
        x, y = points[n, 0], points[n, 1]
        kept[n] = 0 <= age_ns[n] < memory_ns and math.hypot(x, y) < range_m
        if not kept[n]:
            continue
        depth, col, row = _pixel(x, y, height_m, t, lens)
        if depth > 0:
            kept[n] = not (0 <= col <= width - 1 and 0 <= row <= height - 1)
        z = np.float64(tops_m[n])
        while kept[n] and z > height_m:  # the highest part of it that is measured past
            depth, col, row = _pixel(x, y, z, t, lens)
            if depth <= NEAREST_M:
                break
            if 0 <= col <= width - 1 and 0 <= row <= height - 1:
                measured = depth_m[round(row), round(col)]
                if 0.0 < measured < np.inf:
                    looks_past = measured > depth + _BEHIND_M
                    kept[n] = not looks_past or stands[_column(x, columns), _column(y, columns)]
                    break
            z -= _COLUMN_M / 2
        if kept[n]:
            i, j = int(x / cell_m + side / 2), int(y / cell_m + side / 2)
            kept[n] = counts[i, j] < most
            counts[i, j] += kept[n]
    return kept


@inlined
def _pixel(x: float, y: float, z: float, t: Floats, lens: Pinhole) -> tuple[float, float, float]:
    """Return the depth in metres, the column and the row of a point in metres of the base frame;
    what is nearer than `NEAREST_M` is seen in the direction of a point at that depth."""
    depth = t[2, 0] * x + t[2, 1] * y + t[2, 2] * z + t[2, 3]
    right = t[0, 0] * x + t[0, 1] * y + t[0, 2] * z + t[0, 3]
    down = t[1, 0] * x + t[1, 1] * y + t[1, 2] * z + t[1, 3]
    away = max(depth, NEAREST_M)
    return depth, lens.fx * right / away + lens.cx, lens.fy * down / away + lens.cy


@inlined
def _column(at_m: float, columns: int) -> int:
    """Return the number of the column of cells about a coordinate in metres, of `2 * columns`; what
    lies farther is in the last but one, so that each has neighbours."""
    return min(max(math.floor(at_m / _COLUMN_M) + columns, 1), 2 * columns - 2)


@compiled
def _tops(points: NearPoints, range_m: float) -> Tops:
    """Return (N,) the height up to which points stand upright on each of (N, 3) points, those of
    the same cell of the floor, with no more than one slice of height missing in between; 0 for the
    edge of a drop, on which nothing stands.

    It is the lower end of the highest slice: above it there may be nothing to be looked for.
    """
    columns = int(range_m / _COLUMN_M) + 2
    slices = np.zeros((2 * columns, 2 * columns), dtype=np.uint32)
    for n in range(len(points)):
        if points[n, 2] > 0.0:
            k = min(int(points[n, 2] / _COLUMN_M), _SLICES - 1)
            i, j = _column(points[n, 0], columns), _column(points[n, 1], columns)
            slices[i, j] |= np.uint32(1) << np.uint32(k)
    tops = np.zeros(len(points), dtype=np.float32)
    for n in range(len(points)):
        if points[n, 2] <= 0.0:
            continue
        held = slices[_column(points[n, 0], columns), _column(points[n, 1], columns)]
        top = min(int(points[n, 2] / _COLUMN_M), _SLICES - 1)
        for k in range(top + 1, _SLICES):
            if held >> np.uint32(k) & np.uint32(1):
                top = k
            elif k > top + 1:
                break
        tops[n] = top * _COLUMN_M
    return tops


@compiled
def _obstacle_points(
    depth_m: FloatImage,
    ground_m: FloatImage,
    t: npt.NDArray[np.float32],
    lens: Pinhole,
    limits: _Limits,
    stride: int,
) -> NearPoints:
    """Return (N, 3) the obstacle points and their heights, column by column and upward in the
    image: where the ground drops, the last of it that was seen is the edge, of height 0."""
    height, width = depth_m.shape
    most = (height // stride + 1) * (width // stride + 1)
    found, count = np.empty((most, 3), dtype=np.float32), 0
    for j in range(0, width, stride):
        a = np.float32(column_slope(j, lens))
        edge_x, edge_y, dropped = np.inf, np.inf, False
        for i in range(height - 1, -1, -stride):
            depth = depth_m[i, j]
            if not 0 < depth <= limits.max_depth_m:
                continue
            x, y, z_m = point_on_ray(t, a, np.float32(row_slope(i, lens)), depth)
            z = z_m - ground_m[i if len(ground_m) > 1 else 0, j]
            if limits.obstacle_height_m < z < limits.ceiling_m and depth < limits.range_m:
                found[count, 0], found[count, 1], found[count, 2] = x, y, z
                count += 1
            elif z < -limits.drop_m and not dropped and min(edge_x, x) < limits.range_m:
                found[count, 0], found[count, 1] = (edge_x, edge_y) if edge_x < np.inf else (x, y)
                found[count, 2] = 0.0
                count, dropped = count + 1, True
            elif abs(z) <= limits.obstacle_height_m:
                edge_x, edge_y = x, y
    return found[:count].copy()


@compiled
def _contact_time(
    points: NearPoints,
    start: tuple[float, float, float],
    v_mps: float,
    w_radps: float,
    sweep: _Sweep,
) -> float:
    """Return the time in seconds before the first step at which enough points are inside the
    footprint; infinite when they never are. `start` is x, y in metres and yaw in radians."""
    start_x, start_y, start_yaw = start
    start_sin, start_cos = math.sin(start_yaw), math.cos(start_yaw)
    half_length, half_width = sweep.half_length_m, sweep.half_width_m
    reach = half_length + half_width + abs(v_mps) * sweep.horizon_s + sweep.ahead_m
    near, padded, count = np.empty_like(points), np.empty(len(points), dtype=np.bool_), 0
    for n in range(len(points)):
        x, y = points[n, 0], points[n, 1]
        if abs(x) <= half_length and abs(y) <= half_width:
            continue
        dx, dy = x - start_x, y - start_y
        x, y = start_cos * dx + start_sin * dy, start_cos * dy - start_sin * dx
        if not (abs(x) < reach and abs(y) < reach):
            continue
        near[count, 0], near[count, 1] = x, y
        padded[count] = abs(x) > half_length + sweep.ahead_m or abs(y) > half_width + sweep.aside_m
        count += 1
    if count < sweep.min_points:
        return np.inf
    steps = math.ceil(sweep.horizon_s / sweep.step_s)
    for step in range(1, steps + 1):
        t = min(step * sweep.step_s, sweep.horizon_s)
        turn = w_radps * t
        sin, cos = math.sin(turn), math.cos(turn)
        at_x, at_y = arc_position(v_mps, w_radps, t)
        hit = 0
        for n in range(count):
            dx, dy = near[n, 0] - at_x, near[n, 1] - at_y
            x, y = abs(cos * dx + sin * dy), abs(cos * dy - sin * dx)
            if padded[n]:
                x, y = x - sweep.ahead_m, y - sweep.aside_m
            hit += x <= half_length and y <= half_width
        if hit >= sweep.min_points:
            return (step - 1) * sweep.step_s
    return np.inf
