"""Virtual laser scans: what a depth image shows between two heights, seen from above.

A direction of the scan is a few neighbouring columns of the image. Going up a column, consecutive
pixels at about the same distance are one upright surface, and one point: the mean, weighted by the
variance of stereo depth, which grows with the fourth power of depth. A direction may show several
surfaces one behind the other, such as a box before a wall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navcore.compiled import compiled
from navcore.config.localisation import ScanConfig, ScanRules
from navcore.geometry.arrays import Bools, FloatImage, Floats, Points
from navcore.geometry.camera import Pinhole, column_slope, row_slope
from navcore.geometry.transform import Matrix, Pose2
from navcore.perception.ground import flat_ground
from navcore.robot.frame import Frame
from navcore.robot.profile import DepthSensor

_DEFAULT = ScanConfig()
_D455 = DepthSensor()
_MOST_SURFACES = 3
"""Largest number of surfaces in one direction."""
_LEVEL_M = 0.03
"""Height of the ground in metres below which it counts as level."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scan:
    """Surface points of one view, in the levelled base frame; the arrays are read-only."""

    points_base: Points
    """(N, 2) x forward and y left in metres, by columns of the image from left to right."""
    variance_m2: Matrix
    """(N,) variance of each point along the line of sight in square metres."""
    normals: Points
    """(N, 2) unit normals of the surfaces, towards the viewer; (0, 0) where the neighbours form no
    line: legs, posts, corners."""
    origin: Matrix
    """(2,) x and y of the camera in metres of the base frame."""

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.points_base)

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for array in (self.points_base, self.variance_m2, self.normals, self.origin):
            array.flags.writeable = False

    def part(self, chosen: Bools) -> Scan:
        """Return the points of which an (N,) mask is true."""
        return Scan(
            points_base=self.points_base[chosen],
            variance_m2=self.variance_m2[chosen],
            normals=self.normals[chosen],
            origin=self.origin.copy(),
        )

    def seen_from(self, T_other_base: Pose2) -> Scan:
        """Return the scan in another frame, in which the robot has a pose."""
        cos, sin = math.cos(T_other_base.yaw_rad), math.sin(T_other_base.yaw_rad)
        return Scan(
            points_base=T_other_base.to_parent(self.points_base),
            variance_m2=self.variance_m2.copy(),
            normals=self.normals @ np.array([[cos, sin], [-sin, cos]]),
            origin=T_other_base.to_parent(self.origin),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Keyframe:
    """The scan that is kept for a pose ID of the map."""

    pose_id: int
    """Number of the pose in the map's `PoseIds`."""
    T_map_base: Pose2
    """Pose of the ID in the map, as corrected last."""
    scan: Scan
    """The scan in the frame of that pose, which the robot's own differed from a little."""
    stamp_ns: int = 0
    """Time of the scan in nanoseconds."""


def scan_of(
    frame: Frame,
    excluded: Bools | None = None,
    ground_m: FloatImage | None = None,
    config: ScanConfig = _DEFAULT,
    sensor: DepthSensor = _D455,
) -> Scan:
    """Return the scan of a frame.

    `excluded`: (H, W) pixels of what does not stay: people and beware objects. `ground_m`: (H, W)
    height in metres of the ground below each pixel, as `ground_heights` returns it; None for level
    ground.
    """
    shape = frame.depth_m.shape
    ground = flat_ground(shape) if ground_m is None else ground_m
    none = np.zeros((0, 0), dtype=np.bool_)
    # What one metre of distance to the square adds to the standard error of depth.
    error_1pm = sensor.depth_error_m(1.0, frame.intrinsics.fx)
    points, variance = _surfaces(
        frame.depth_m,
        none if excluded is None else excluded,
        ground,
        frame.T_base_camera,
        frame.T_level_camera,
        frame.intrinsics.pinhole,
        error_1pm,
        config.rules,
    )
    origin = frame.T_level_camera[:2, 3].copy()
    normals = _normals(points, origin, config.line_m)
    return Scan(points_base=points, variance_m2=variance, normals=normals, origin=origin)


@compiled
def _surfaces(
    depth_m: FloatImage,
    excluded: Bools,
    ground_m: FloatImage,
    t: Matrix,
    level: Matrix,
    lens: Pinhole,
    error_1pm: float,
    rules: ScanRules,
) -> tuple[Floats, Floats]:
    """Return (N, 2) points and (N,) variances of the upright surfaces, by direction.

    `t` and `level` are the poses of the camera in the base frame, for heights above the ground, and
    in the levelled one.
    """
    rows, cols = depth_m.shape
    directions = cols // rules.column_step
    points = np.empty((directions * _MOST_SURFACES, 2))
    variance = np.empty(directions * _MOST_SURFACES)
    count = 0
    across, down = np.empty(cols), np.empty(rows)
    for j in range(cols):
        across[j] = column_slope(j, lens)
    for i in range(rows):
        down[i] = row_slope(i, lens)
    for direction in range(directions):
        first = direction * rules.column_step
        found = 0
        weight, pixels = 0.0, 0
        x, y, z, low, high = 0.0, 0.0, 0.0, 0.0, 0.0
        for step in range(rows + 1):
            i = rows - 1 - step  # from below upwards; the row above the image ends the last surface
            for j in range(first, first + rules.column_step if i >= 0 else first + 1):
                depth = 0.0
                if i >= 0:
                    depth = float(depth_m[i, j])
                    if depth < rules.min_range_m or depth > rules.max_range_m:
                        continue
                    a, b = across[j], down[i]
                    ground = ground_m[i, j]
                    height = (t[2, 0] * a + t[2, 1] * b + t[2, 2]) * depth + t[2, 3] - ground
                    most = rules.high_m if abs(ground) < _LEVEL_M else rules.high_on_slopes_m
                    if height < rules.low_m or height > most:
                        continue
                    if excluded.shape[0] > 0 and excluded[i, j]:
                        continue
                    px = (level[0, 0] * a + level[0, 1] * b + level[0, 2]) * depth + level[0, 3]
                    py = (level[1, 0] * a + level[1, 1] * b + level[1, 2]) * depth + level[1, 3]
                    # The steeper the line of sight, the less of an error of depth is horizontal.
                    error = max(error_1pm * depth * depth, 1e-4)
                    share = 1.0 / (error * error)
                    if pixels > 0:
                        mean = z / weight
                        if abs(depth - mean) <= 3.0 * error + 0.02:
                            weight += share
                            x += share * px
                            y += share * py
                            z += share * depth
                            pixels += 1
                            high = max(high, height)
                            low = min(low, height)
                            continue
                # Another surface, or the end of the column: close the present one.
                if (
                    pixels >= rules.min_pixels
                    and high - low >= rules.min_height_m
                    and found < _MOST_SURFACES
                ):
                    points[count, 0], points[count, 1] = x / weight, y / weight
                    variance[count] = max(
                        min(rules.correlated_px, float(pixels)) / weight, rules.floor_m**2
                    )
                    count += 1
                    found += 1
                if i < 0:
                    break
                weight, pixels = share, 1
                x, y, z = share * px, share * py, share * depth
                low = high = height
    return points[:count].copy(), variance[:count].copy()


_NEIGHBOURS = 10
"""Number of points to each side among which the neighbours of a point are looked for."""


@compiled
def _normals(points: Floats, origin: Floats, reach_m: float) -> Floats:
    """Return (N, 2) unit normals towards the origin, (0, 0) where the neighbours form no line."""
    count = len(points)
    normals = np.zeros((count, 2))
    for i in range(count):
        n, sx, sy = 0, 0.0, 0.0
        sxx, sxy, syy = 0.0, 0.0, 0.0
        for k in range(max(0, i - _NEIGHBOURS), min(count, i + _NEIGHBOURS + 1)):
            dx, dy = points[k, 0] - points[i, 0], points[k, 1] - points[i, 1]
            if dx * dx + dy * dy > reach_m * reach_m:
                continue
            n += 1
            sx += dx
            sy += dy
            sxx += dx * dx
            sxy += dx * dy
            syy += dy * dy
        if n < 4:
            continue
        mx, my = sx / n, sy / n
        cxx, cxy, cyy = sxx / n - mx * mx, sxy / n - mx * my, syy / n - my * my
        half = (cxx + cyy) / 2
        root = math.sqrt(((cxx - cyy) / 2) ** 2 + cxy * cxy)
        small, large = half - root, half + root
        # A line is longer than it is thick, and the point is on it and not at its end.
        if large < 0.03**2 or small > 0.1 * large:
            continue
        nx, ny = cxy, small - cxx
        if abs(nx) + abs(ny) < 1e-12:
            nx, ny = (1.0, 0.0) if cxx < cyy else (0.0, 1.0)
        length = math.hypot(nx, ny)
        nx, ny = nx / length, ny / length
        if nx * (origin[0] - points[i, 0]) + ny * (origin[1] - points[i, 1]) < 0:
            nx, ny = -nx, -ny
        normals[i, 0], normals[i, 1] = nx, ny
    return normals
