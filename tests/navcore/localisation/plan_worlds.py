"""Worlds seen from above: walls and furniture as rectangles, scans of a depth camera by ray
casting, and drives through them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from navcore.geometry.arrays import Floats, Points
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.localisation.scans.scan import Scan

WALL_M = 0.12
FIELD_OF_VIEW_RAD = math.radians(87.0)
RANGE_M = 5.0
COLUMNS = 176
CAMERA_X_M = 0.2
Drive = list[Pose2]


@dataclass
class PlanWorld:
    """Rectangles (x0, y0, x1, y1) that block the view."""

    boxes: list[tuple[float, float, float, float]] = field(default_factory=list)

    def box(self, x0: float, y0: float, x1: float, y1: float) -> None:
        """Add a rectangle."""
        self.boxes.append((min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1)))

    def wall(
        self,
        start: tuple[float, float],
        end: tuple[float, float],
        doors: Sequence[tuple[float, float]] = (),
    ) -> None:
        """Add a wall along an axis, with doors as (middle along the wall, width)."""
        along = 0 if abs(end[0] - start[0]) > abs(end[1] - start[1]) else 1
        low, high = sorted((start[along], end[along]))
        across, half = start[1 - along], WALL_M / 2
        at = low - half
        for middle, width in [*sorted(doors), (high + half + 1e-6, 0.0)]:
            stop = min(middle - width / 2, high + half)
            if stop > at:
                corners = (
                    (at, across - half, stop, across + half)
                    if along == 0
                    else (across - half, at, across + half, stop)
                )
                self.box(*corners)
            at = middle + width / 2

    def mirrored(self) -> PlanWorld:
        """The world mirrored along x."""
        return PlanWorld([(-x1, y0, -x0, y1) for x0, y0, x1, y1 in self.boxes])

    def edges(self) -> tuple[Points, Points]:
        """(M, 2) starts and ends of all sides."""
        b = np.array(self.boxes)
        corners = np.stack([b[:, [0, 1]], b[:, [2, 1]], b[:, [2, 3]], b[:, [0, 3]]], axis=1)
        return corners.reshape(-1, 2), np.roll(corners, -1, axis=1).reshape(-1, 2)

    def scan(self, pose: Pose2, rng: np.random.Generator) -> Scan:
        """What the camera sees from a pose of the robot."""
        angles = np.linspace(FIELD_OF_VIEW_RAD / 2, -FIELD_OF_VIEW_RAD / 2, COLUMNS)
        directions = np.column_stack([np.cos(angles), np.sin(angles)])
        origin = np.array([CAMERA_X_M, 0.0])
        turn = Pose2(x_m=0.0, y_m=0.0, yaw_rad=pose.yaw_rad)
        ranges = self.ranges(pose.to_parent(origin), turn.to_parent(directions))
        depth = ranges * directions[:, 0]
        sigma = 0.004 + 0.003 * np.square(depth)
        seen = np.isfinite(ranges) & (depth < RANGE_M)
        sigma = np.where(seen, sigma, 0.0)
        ranges = np.where(seen, ranges, 0.0) + sigma * rng.normal(size=len(ranges))
        points = np.where(seen[:, None], origin + ranges[:, None] * directions, np.nan)
        normals = normals_of(points, origin)
        return Scan(
            points_base=points[seen],
            variance_m2=np.square(sigma[seen]),
            normals=normals[seen],
            origin=origin,
        )

    def ranges(self, origin: Points, directions: Points) -> Floats:
        """Distances from a place along (N, 2) directions; infinite where nothing is met."""
        starts, ends = self.edges()
        near = (np.minimum(starts, ends) < origin + RANGE_M * 1.3).all(axis=1) & (
            np.maximum(starts, ends) > origin - RANGE_M * 1.3
        ).all(axis=1)
        starts, ends = starts[near], ends[near]
        along, gap = ends - starts, starts - origin
        cross = directions[:, 0, None] * along[:, 1] - directions[:, 1, None] * along[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (gap[:, 0] * along[:, 1] - gap[:, 1] * along[:, 0])[None, :] / cross
            u = (
                gap[None, :, 0] * directions[:, 1, None] - gap[None, :, 1] * directions[:, 0, None]
            ) / cross
        hit = np.where((t > 0.05) & (u >= 0.0) & (u <= 1.0), t, np.inf)
        return np.asarray(hit.min(axis=1, initial=np.inf))


def normals_of(points: Points, origin: Points, reach: int = 3) -> Points:
    """Normals of the lines through the neighbours of each point, (0, 0) where they form none."""
    padded = np.pad(points, ((reach, reach), (0, 0)), constant_values=np.nan)
    near = np.stack([padded[k : k + len(points)] for k in range(2 * reach + 1)])
    is_near = np.hypot(*np.moveaxis(near - points, 2, 0)) < 0.3  # False where not a number
    count = is_near.sum(axis=0)
    near = np.where(is_near[..., None], near, 0.0)
    middle = near.sum(axis=0) / np.maximum(count, 1)[:, None]
    x, y = np.moveaxis(np.where(is_near[..., None], near - middle, 0.0), 2, 0)
    xx, yy, xy = (
        (a * b).sum(axis=0) / np.maximum(count - 1, 1) for a, b in ((x, x), (y, y), (x, y))
    )
    spread = np.sqrt(np.square(0.5 * (xx - yy)) + np.square(xy))
    small, large = 0.5 * (xx + yy) - spread, 0.5 * (xx + yy) + spread
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy) + 0.5 * math.pi
    normals = np.column_stack([np.cos(angle), np.sin(angle)])
    normals *= np.where(np.einsum("ni,ni->n", normals, origin - points) < 0.0, -1.0, 1.0)[:, None]
    is_line = (count >= 5) & (small < 0.0025) & (large > 9.0 * small)
    return np.where(is_line[:, None], normals, 0.0)


def office(seed: int, *, rooms: int = 5, furniture: bool = True) -> PlanWorld:
    """Rooms of different widths and depths on both sides of a corridor 2 m wide."""
    rng = np.random.default_rng(seed)
    world = PlanWorld()
    length = 0.0
    for side in (1.0, -1.0):
        x, doors = 0.0, []
        depth = float(rng.uniform(4.0, 6.0))
        widths = rng.uniform(3.0, 6.5, rooms)
        widths *= rooms * 4.75 / widths.sum()
        for width in map(float, widths):
            doors.append((x + float(rng.uniform(0.8, width - 0.8)), 1.0))
            world.wall((x, side), (x, side * (1.0 + depth)))
            if furniture:
                _furnish(world, rng, x, x + width, side, depth)
            x += width
        world.wall((x, side), (x, side * (1.0 + depth)))
        world.wall((0.0, side * (1.0 + depth)), (x, side * (1.0 + depth)))
        world.wall((0.0, side), (x, side), doors)
        length = max(length, x)
    world.wall((0.0, -1.0), (0.0, 1.0))
    world.wall((length, -1.0), (length, 1.0))
    return world


def _furnish(
    world: PlanWorld, rng: np.random.Generator, x0: float, x1: float, side: float, depth: float
) -> None:
    """A table or cupboard at the far wall, one at a side wall, and a few legs."""
    for _ in range(2):
        width = float(rng.uniform(0.6, min(1.8, x1 - x0 - 0.4)))
        left = float(rng.uniform(x0 + 0.1, x1 - width - 0.1))
        back = side * (1.0 + depth - WALL_M)
        world.box(left, back, left + width, back - side * float(rng.uniform(0.4, 0.9)))
    for _ in range(4):
        x = float(rng.uniform(x0 + 0.4, x1 - 0.4))
        y = side * float(rng.uniform(1.0 + depth * 0.6, 1.0 + depth - 0.4))
        world.box(x, y, x + 0.06, y + 0.06)


def room_doors(world_seed: int, *, rooms: int = 5) -> list[tuple[float, float, float]]:
    """(door x, side, depth) of the rooms of `office` with that seed."""
    rng = np.random.default_rng(world_seed)
    found = []
    for side in (1.0, -1.0):
        depth = float(rng.uniform(4.0, 6.0))
        widths = rng.uniform(3.0, 6.5, rooms)
        widths *= rooms * 4.75 / widths.sum()
        x = 0.0
        for width in map(float, widths):
            found.append((x + float(rng.uniform(0.8, width - 0.8)), side, depth))
            _furnish(PlanWorld(), rng, x, x + width, side, depth)
            x += width
    return found


def drive(corners: Sequence[tuple[float, float]], *, step_m: float = 0.1) -> Drive:
    """Poses along straight lines with turns on the spot."""
    poses: Drive = []
    heading = math.atan2(corners[1][1] - corners[0][1], corners[1][0] - corners[0][0])
    for (x0, y0), (x1, y1) in itertools.pairwise(corners):
        length, towards = math.hypot(x1 - x0, y1 - y0), math.atan2(y1 - y0, x1 - x0)
        poses += turn_on_spot((x0, y0), heading, wrap_angle(towards - heading))
        for along in np.arange(0.0, length, step_m).tolist():
            share = along / length
            poses.append(
                Pose2(x_m=x0 + share * (x1 - x0), y_m=y0 + share * (y1 - y0), yaw_rad=towards)
            )
        heading = towards
    return poses


def turn_on_spot(
    position: tuple[float, float], heading: float, turn: float, *, step_rad: float = 0.14
) -> Drive:
    """Poses of a turn, its end included."""
    count = max(1, math.ceil(abs(turn) / step_rad)) if turn else 0
    return [
        Pose2(
            x_m=position[0], y_m=position[1], yaw_rad=wrap_angle(heading + turn * (k + 1) / count)
        )
        for k in range(count)
    ]


def tour(seed: int, *, rooms: int = 5) -> Drive:
    """A drive through the corridor and into every room of an office, with a full turn in each."""
    doors = sorted(room_doors(seed, rooms=rooms))
    corners: list[tuple[float, float]] = [(1.0, 0.0)]
    poses: Drive = []
    for x, side, depth in doors:
        inside = (x, side * (1.0 + 0.4 * depth))
        part = drive(
            [corners[-1], (x, 0.0), inside] if corners[-1] != (x, 0.0) else [(x, 0.0), inside]
        )
        poses += part
        poses += turn_on_spot(inside, part[-1].yaw_rad, 2.0 * math.pi)
        back = drive([inside, (x, 0.0)])
        poses += turn_on_spot(inside, part[-1].yaw_rad, math.pi) + back
        corners.append((x, 0.0))
    poses += drive([corners[-1], (doors[-1][0] + 0.5, 0.0), (1.0, 0.0)])
    poses += turn_on_spot((1.0, 0.0), math.pi, 2.0 * math.pi)
    return poses


def odometry_of(true: Drive, rng: np.random.Generator, *, grade: str = "typical") -> Drive:
    """Drifting poses of a drive, beginning at the first true pose."""
    length, gyro, bias, slip = {
        "ideal": (0.0015, 0.0, 4.0, 0.0),
        "typical": (0.01, 0.003, 18.0, 0.03),
        "poor": (0.02, 0.01, 108.0, 0.05),
    }[grade]
    scale, turn_scale = 1.0 + length * rng.normal(), 1.0 + gyro * rng.normal()
    bias_rad = math.radians(bias / 3600.0 * 0.2) * rng.normal()
    poses = [true[0]]
    for one, two in itertools.pairwise(true):
        move = one.inverse() @ two
        slipped = scale * (1.0 + slip * rng.normal())
        poses.append(
            poses[-1]
            @ Pose2(
                x_m=move.x_m * slipped,
                y_m=move.y_m * slipped,
                yaw_rad=move.yaw_rad * turn_scale + bias_rad,
            )
        )
    return poses


def surfaces_of(
    views: Sequence[tuple[Pose2, Scan]], *, cell_m: float = 0.1
) -> tuple[Points, Points]:
    """Means and normals of the surfaces of scans at their poses, for each cell and direction."""
    points, normals = [], []
    for pose, scan in views:
        points.append(pose.to_parent(scan.points_base))
        normals.append(Pose2(x_m=0.0, y_m=0.0, yaw_rad=pose.yaw_rad).to_parent(scan.normals))
    p, n = np.vstack(points), np.vstack(normals)
    direction = np.round(np.arctan2(n[:, 1], n[:, 0]) / (math.pi / 4)).astype(np.int64) % 8
    direction[~n.any(axis=1)] = 8
    keys = np.column_stack([np.floor(p / cell_m).astype(np.int64), direction])
    _, index, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    sums = np.zeros((len(count), 4))
    np.add.at(sums, index.ravel(), np.hstack([p, n]))
    means = sums / count[:, None]
    length = np.hypot(means[:, 2], means[:, 3])
    unit = np.where(length[:, None] > 0.5, means[:, 2:] / np.maximum(length, 1e-9)[:, None], 0.0)
    kept = count >= 3
    return means[kept, :2], unit[kept]


def colonnade() -> PlanWorld:
    """Return a corridor from x = −8 to 16 m with a pillar at one wall every 0.25 m."""
    world = PlanWorld()
    world.wall((-8.0, -1.0), (16.0, -1.0))
    world.wall((16.0, 1.2), (-8.0, 1.2))
    for x in np.arange(-8.0, 16.0, 0.25):
        world.box(x, -1.0, x + 0.1, -0.85)
    return world


def equal_rooms(count: int = 20, *, width: float = 4.0, depth: float = 4.0) -> PlanWorld:
    """Equal rooms on both sides of an equal corridor, each with its door and a cupboard."""
    world = PlanWorld()
    per_side = count // 2
    length = per_side * width
    for side in (1.0, -1.0):
        doors = []
        for k in range(per_side):
            # Those on the other side are turned by half a turn, not mirrored.
            x = k * width if side > 0 else length - k * width
            doors.append((x + side * 1.2, 1.0))
            world.wall((x, side), (x, side * (1.0 + depth)))
            world.box(
                x + side * 2.2,
                side * (1.0 + depth - WALL_M),
                x + side * 3.6,
                side * (1.0 + depth - 0.7),
            )
        world.wall((0.0, side), (length, side), doors)
        world.wall((0.0, side * (1.0 + depth)), (length, side * (1.0 + depth)))
        end = length if side > 0 else 0.0
        world.wall((end, side), (end, side * (1.0 + depth)))
    return world


def equal_rooms_tour(count: int = 20, *, width: float = 4.0, depth: float = 4.0) -> Drive:
    """A drive through the corridor and into every room of `equal_rooms`."""
    per_side = count // 2
    poses: Drive = []
    for k in range(per_side):
        for side in (1.0, -1.0):
            x = k * width + (1.2 if side > 0 else width - 1.2)
            inside = (x, side * (1.0 + 0.45 * depth))
            poses += drive([(x, 0.0), inside])
            poses += turn_on_spot(inside, side * math.pi / 2, 2.0 * math.pi)
    ends = [(0.6, 0.0), (per_side * width - 0.6, 0.0)]
    return poses + drive(ends) + drive(ends[::-1])
