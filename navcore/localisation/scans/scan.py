"""Virtual laser scans: what a depth image shows between two heights, seen from above.

A direction of the scan is as wide as a few columns of the image. Going up, consecutive pixels of a
direction at about the same distance are one upright surface, and one point: the mean, weighted by
the inverse of depth. A direction may show several surfaces one behind the other, such as a box
before a wall. Directions and distances are horizontal: in the image of a camera that looks down,
an upright wall runs across columns, and its depth changes along them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, inlined
from navcore.config.localisation.localisation import ScanConfig, ScanRules
from navcore.geometry.arrays import Bools, FloatImage, Floats, Points
from navcore.geometry.camera import Pinhole, column_slope, point_on_ray, row_slope
from navcore.geometry.transform import Matrix, Pose2
from navcore.perception.ground import flat_ground
from navcore.robot.frame import Frame
from navcore.robot.profile import DepthSensor

_DEFAULT = ScanConfig()
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

    def may_be_a_person(self, config: ScanConfig = _DEFAULT) -> bool:
        """Return whether all that is seen is one thing, with a gap on both sides, that is no larger
        than a person: it need not stay where it is."""
        if not len(self):
            return False
        size_m = float(np.hypot(*np.ptp(self.points_base, axis=0)))
        nearest_m = float(np.hypot(*(self.points_base - self.origin).T).min())
        return size_m < min(config.person_m, config.person_view_rad * nearest_m)

    def part(self, chosen: Bools) -> Scan:
        """Return the points of which an (N,) mask is true."""
        return Scan(
            points_base=self.points_base[chosen],
            variance_m2=self.variance_m2[chosen],
            normals=self.normals[chosen],
            origin=self.origin.copy(),
        )

    def emptied(self) -> Scan:
        """Return the scan without points."""
        return self.part(np.zeros(len(self), dtype=np.bool_))

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
    covariance: Matrix = field(default_factory=lambda: np.zeros((3, 3)))
    """(3, 3) covariance of x, y and yaw of the robot's pose at the scan, but for the scale of
    lengths, in map axes; zero where the pose is a constant, as in a saved map."""


def scan_of(
    frame: Frame,
    sensor: DepthSensor,
    excluded: Bools | None = None,
    ground_m: FloatImage | None = None,
    config: ScanConfig = _DEFAULT,
) -> Scan:
    """Return the scan of a frame.

    `excluded`: (H, W) pixels of what does not stay: people and beware objects. `ground_m`: that
    of `ground_heights`; None for level ground.
    """
    ground = flat_ground(frame.intrinsics.width) if ground_m is None else ground_m
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


def scan_of_points(
    points_base: Points, origin: Matrix, *, sigma_m: float, neighbours_m: float
) -> Scan:
    """Return the scan of (N, 2) points of a laser scanner at an (2,) origin, in metres of the base
    frame, from left to right; each errs by `sigma_m`, and its normal is that of the points within
    `neighbours_m`."""
    return Scan(
        points_base=points_base,
        variance_m2=np.full(len(points_base), sigma_m**2),
        normals=_normals(points_base, origin, neighbours_m),
        origin=origin,
    )


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
    closed, found = np.empty((directions, _MOST_SURFACES, 3)), np.zeros(directions, dtype=np.int32)
    # The present surface of each direction: weighted sums, and the extent of its pixels.
    weight, x, y, far = (
        np.zeros(directions),
        np.zeros(directions),
        np.zeros(directions),
        np.zeros(directions),
    )
    pixels = np.zeros(directions, dtype=np.int32)
    low = np.full(directions, np.float32(np.inf))
    high = np.full(directions, np.float32(-np.inf))
    across, heights = np.empty(cols), np.empty(cols, dtype=np.float32)
    direction = np.empty(cols, dtype=np.int32)
    # Unsigned, as numba asks of each signed index whether it counts from the end.
    numbers = direction.view(np.uint32)
    upright = np.zeros((cols + 7) // 8 * 8, dtype=np.uint8)
    eights = upright.view(np.uint64)
    for j in range(cols):
        across[j] = column_slope(j, lens)
    narrow = across.astype(np.float32)
    # A ray (across, b, 1) leads to (ahead, aside) along the horizontal axes of the camera.
    heading = np.array([[level[0, 2], level[1, 2]], [level[1, 2], -level[0, 2]]])
    heading /= max(math.hypot(level[0, 2], level[1, 2]), 1e-6)
    horizontal = heading @ np.ascontiguousarray(level[:2, :3])
    for i in range(rows - 1, -1, -1):  # from below upwards
        b = row_slope(i, lens)
        ground = ground_m[i if len(ground_m) > 1 else 0]
        _upright(depth_m[i], ground, narrow, b, t, rules, heights, upright)
        _directions(narrow, b, horizontal, lens, rules, directions, direction, upright)
        for eight in range(len(eights)):
            if eights[eight] == 0:
                continue
            for j in range(8 * eight, min(8 * eight + 8, cols)):
                if not upright[j] or (excluded.shape[0] > 0 and excluded[i, j]):
                    continue
                d, depth, height = numbers[j], float(depth_m[i, j]), heights[j]
                ahead = depth * (
                    horizontal[0, 0] * across[j] + horizontal[0, 1] * b + horizontal[0, 2]
                )
                # The steeper the line of sight, the less of an error of depth is horizontal.
                error = error_1pm * depth * depth
                if abs(ahead * weight[d] - far[d]) > (3.0 * error + 0.02) * weight[d]:
                    _close(d, weight, x, y, pixels, low, high, error_1pm, rules, closed, found)
                    weight[d], x[d], y[d], far[d], pixels[d] = 0.0, 0.0, 0.0, 0.0, 0
                    low[d], high[d] = np.inf, -np.inf
                px, py, _ = point_on_ray(level, across[j], b, depth)
                # So the inverse depths are averaged, whose errors are symmetric. Weights by the
                # variance of each measured depth would prefer the pixels that err towards near.
                share = 1.0 / depth
                weight[d] += share
                x[d] += share * px
                y[d] += share * py
                far[d] += share * ahead
                low[d] = min(low[d], height)
                high[d] = max(high[d], height)
                pixels[d] += 1
    most = directions * _MOST_SURFACES
    points, variance, count = np.empty((most, 2)), np.empty(most), 0
    for d in range(directions):
        _close(d, weight, x, y, pixels, low, high, error_1pm, rules, closed, found)
        for n in range(found[d]):
            points[count, 0], points[count, 1] = closed[d, n, 0], closed[d, n, 1]
            variance[count] = closed[d, n, 2]
            count += 1
    return points[:count].copy(), variance[:count].copy()


@inlined
def _upright(
    depth_m: FloatImage,
    ground_m: FloatImage,
    across: FloatImage,
    b: float,
    t: Matrix,
    rules: ScanRules,
    heights: FloatImage,
    upright: npt.NDArray[np.uint8],
) -> None:
    """Write the height above the ground of each pixel of a row, and whether it may show an upright
    surface; free of branches, so that the compiler vectorises it."""
    nearest, farthest = np.float32(rules.min_range_m), np.float32(rules.max_range_m)
    lowest, highest = np.float32(rules.low_m), np.float32(rules.high_m)
    on_slopes, level_m = np.float32(rules.high_on_slopes_m), np.float32(_LEVEL_M)
    z0, z1, z3 = np.float32(t[2, 0]), np.float32(t[2, 1] * b + t[2, 2]), np.float32(t[2, 3])
    for j in range(len(across)):
        depth, ground = depth_m[j], ground_m[j]
        height = (z0 * across[j] + z1) * depth + z3 - ground
        most = highest if abs(ground) < level_m else on_slopes
        heights[j] = height
        upright[j] = (
            (depth >= nearest) & (depth <= farthest) & (height >= lowest) & (height <= most)
        )


@inlined
def _directions(
    across: FloatImage,
    b: float,
    horizontal: Floats,
    lens: Pinhole,
    rules: ScanRules,
    directions: int,
    direction: npt.NDArray[np.int32],
    upright: npt.NDArray[np.uint8],
) -> None:
    """Write the direction of each pixel of a row, and that those beside the first and the last
    direction show nothing; free of branches as well."""
    ahead0, aside0 = np.float32(horizontal[0, 0]), np.float32(horizontal[1, 0])
    ahead1 = np.float32(horizontal[0, 1] * b + horizontal[0, 2])
    aside1 = np.float32(horizontal[1, 1] * b + horizontal[1, 2])
    step = 1.0 / rules.column_step
    per_slope, middle = np.float32(lens.fx * step), np.float32((lens.cx + 0.5) * step)
    most = np.float32(directions)
    for j in range(len(across)):
        ahead = ahead0 * across[j] + ahead1
        column = (aside0 * across[j] + aside1) / ahead * per_slope + middle
        direction[j] = np.int32(column)
        upright[j] &= (column >= np.float32(0.0)) & (column < most) & (ahead > np.float32(0.0))


@inlined
def _close(
    d: int,
    weight: Floats,
    x: Floats,
    y: Floats,
    pixels: npt.NDArray[np.int32],
    low: FloatImage,
    high: FloatImage,
    error_1pm: float,
    rules: ScanRules,
    closed: Floats,
    found: npt.NDArray[np.int32],
) -> None:
    """Write x, y and variance of the present surface of a direction, if it is one."""
    is_surface = pixels[d] >= rules.min_pixels and high[d] - low[d] >= rules.min_height_m
    if is_surface and found[d] < _MOST_SURFACES:
        n = found[d]
        closed[d, n, 0], closed[d, n, 1] = x[d] / weight[d], y[d] / weight[d]
        depth = pixels[d] / weight[d]
        correlated = min(rules.correlated_px / pixels[d], 1.0)
        closed[d, n, 2] = max(correlated * (error_1pm * depth * depth) ** 2, rules.floor_m**2)
        found[d] += 1


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
