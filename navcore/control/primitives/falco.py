"""Falco's motion primitives: 343 paths in 7 groups, turned to 36 headings, and a table of which of
them a point blocks.

Zhang, Hu, Chadha, Singh: Falco: Fast likelihood-based collision avoidance with extension to
human-guided navigation, 2020. What is different here: the table is made for the oriented footprint,
with its heading along the path, and not for a disc, once for each scale, so that the body stays as
large as it is where the paths shrink; and no path is driven backwards, over ground that the camera
does not see.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numba
import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Bits = npt.NDArray[np.uint64]

GROUPS = 7
"""First steps of a path; all that begin alike are a group …"""
IN_GROUP = GROUPS**2
"""… of so many."""
PATHS = GROUPS * IN_GROUP
SPREAD_RAD = math.radians(27.0)
"""The outermost group is so far off the heading."""
NARROWER = 0.65
"""Each of the later steps spreads so much less than the one before."""
HEADINGS_RAD = np.radians(np.arange(-180.0, 180.0, 10.0))
"""(36,) to which all paths are turned."""
RADII_M = np.linspace(0.0, 3.0, 301)
SCALES = (1.25, 1.0, 0.75)
"""By which the paths are stretched …"""
TRIES = ((0, 4.25), (1, 3.4), (2, 2.55), (2, 2.05), (2, 1.55), (2, 1.05))
"""… and as far as which things count: index of the scale, and metres; each is tried where nothing
is free with those before."""
WIDEST_RAD = math.radians(50.0)
"""A path that ends so far off the way asked for serves it no more."""
VOXEL_M = 0.025
"""Side of a cell of the table."""
WORDS = -(-PATHS // 64)
BENDS_1PM = 3.0
"""The sharpest bend that is driven; what is sharper is a turn in place."""


@cache
def fan() -> Floats:
    """(343, 301, 3) x, y and heading at each of `RADII_M` along the paths, at scale 1, in the frame
    that they start in.

    A path is a polar curve. Its angle grows linearly to one of seven at 1 m, which is the group;
    from there a cubic, which joins it without a kink, leads through one of seven angles at 2 m and
    of seven at 3 m.
    """
    spread = SPREAD_RAD * np.linspace(-1.0, 1.0, GROUPS)
    first = spread[:, None, None] + np.zeros((GROUPS, GROUPS, GROUPS))
    second = first + NARROWER * spread[None, :, None]
    third = second + NARROWER**2 * spread[None, None, :]
    first, second, third = (angles.reshape(PATHS, 1) for angles in (first, second, third))
    beyond = np.maximum(RADII_M - 1.0, 0.0)
    cubic = (third - 3 * first) / 4 - (second - 2 * first)
    square = second - 2 * first - cubic
    angle = first * RADII_M + beyond**2 * (square + cubic * beyond)
    slope = first + beyond * (2 * square + 3 * cubic * beyond)
    heading = angle + np.arctan(RADII_M * slope)
    return np.stack([RADII_M * np.cos(angle), RADII_M * np.sin(angle), heading], axis=2)


@cache
def ends_rad() -> Floats:
    """(343,) in which direction each path ends, seen from its start."""
    return np.arctan2(fan()[:, -1, 1], fan()[:, -1, 0])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Table:
    """Which paths bring the body onto a point: the correspondences."""

    blocks: Bits
    """(X, Y, 6) for each cell a bit for each path."""
    low_m: Floats
    """(2,) corner of the first cell."""

    @staticmethod
    @cache
    def of(half_length_m: float, half_width_m: float, room_m: float, scale: float) -> Table:
        """For a body and the room to be left around it; made in 0.3 s and kept."""
        poses = fan()[:, ::3] * np.array([scale, scale, 1.0])
        reach = math.hypot(half_length_m, half_width_m) + room_m + VOXEL_M
        low, high = poses[..., :2].min(axis=(0, 1)) - reach, poses[..., :2].max(axis=(0, 1)) + reach
        columns, rows = np.ceil((high - low) / VOXEL_M).astype(int).tolist()
        blocks = np.zeros((columns, rows, WORDS), dtype=np.uint64)
        _cover(blocks, low, poses, half_length_m, half_width_m, room_m)
        return Table(blocks=blocks, low_m=low)


@numba.njit(cache=True, nogil=True)
def _cover(
    blocks: Bits, low: Floats, poses: Floats, half_length: float, half_width: float, room: float
) -> None:
    """Set the bit of each path at each cell whose middle comes nearer than the room to the body at
    any of (P, S, 3) poses."""
    columns, rows = blocks.shape[0], blocks.shape[1]
    for p in range(poses.shape[0]):
        swept = np.zeros((columns, rows), dtype=np.bool_)
        for s in range(poses.shape[1]):
            x, y, cos, sin = (
                poses[p, s, 0] - low[0],
                poses[p, s, 1] - low[1],
                math.cos(poses[p, s, 2]),
                math.sin(poses[p, s, 2]),
            )
            reach_x = abs(cos) * half_length + abs(sin) * half_width + room
            reach_y = abs(sin) * half_length + abs(cos) * half_width + room
            for i in range(int((x - reach_x) / VOXEL_M), int((x + reach_x) / VOXEL_M) + 1):
                dx = (i + 0.5) * VOXEL_M - x
                for j in range(int((y - reach_y) / VOXEL_M), int((y + reach_y) / VOXEL_M) + 1):
                    if not swept[i, j]:  # most are, by the pose before
                        dy = (j + 0.5) * VOXEL_M - y
                        out_x = max(abs(cos * dx + sin * dy) - half_length, 0.0)
                        out_y = max(abs(cos * dy - sin * dx) - half_width, 0.0)
                        swept[i, j] = out_x * out_x + out_y * out_y < room * room
        bit = np.uint64(1) << np.uint64(p & 63)
        for i in range(columns):
            for j in range(rows):
                if swept[i, j]:
                    blocks[i, j, p >> 6] |= bit


@numba.njit(cache=True, nogil=True)
def blocked_paths(points: Floats, heading_rad: float, blocks: Bits, low: Floats) -> Bits:
    """(6,) a bit for each path, turned to a heading, that one of (N, 2) points blocks."""
    cos, sin, found = math.cos(heading_rad), math.sin(heading_rad), np.zeros(WORDS, dtype=np.uint64)
    for n in range(len(points)):
        i = math.floor((cos * points[n, 0] + sin * points[n, 1] - low[0]) / VOXEL_M)
        j = math.floor((cos * points[n, 1] - sin * points[n, 0] - low[1]) / VOXEL_M)
        if 0 <= i < blocks.shape[0] and 0 <= j < blocks.shape[1]:
            for w in range(WORDS):
                found[w] |= blocks[i, j, w]
    return found


@numba.njit(cache=True, nogil=True)
def scores(
    points: Floats,
    headings: Floats,
    allowed: npt.NDArray[np.bool_],
    blocks: Bits,
    low: Floats,
    ends: Floats,
    aim_rad: float,
) -> Floats:
    """(H, 343) how likely each path that no point blocks leads to where it is aimed at; 0 for all
    others.

    It counts less the farther off it ends, and the farther the robot would have to turn for it,
    from 10 to 1 at a right angle, to the fourth power.
    """
    found = np.zeros((len(headings), PATHS))
    for h in range(len(headings)):
        if not allowed[h]:
            continue
        blocked = blocked_paths(points, headings[h], blocks, low)
        weight = max(10.0 - 9.0 * abs(headings[h]) / (math.pi / 2), 1.0) ** 4
        for p in range(PATHS):
            if (blocked[p >> 6] >> np.uint64(p & 63)) & np.uint64(1) == 0:
                off = abs((headings[h] + ends[p] - aim_rad + math.pi) % (2 * math.pi) - math.pi)
                if off < WIDEST_RAD:
                    found[h, p] = (1.0 - math.sqrt(math.sqrt(off / WIDEST_RAD))) * weight
    return found


@numba.njit(cache=True, nogil=True)
def pursuits(
    paths: Floats, step_m: float, along: Floats, lookahead_m: float
) -> tuple[Floats, Floats]:
    """(A,) bend in 1/m that each of (A, M, 2) paths is followed with at first, and (A, S, 3) poses
    on the way along it.

    Pure pursuit from the origin, facing x, towards what lies `lookahead_m` further along a path
    whose points are `step_m` apart; the poses are so many metres `along` the way that is driven.
    """
    bends, poses = np.empty(len(paths)), np.empty((len(paths), len(along), 3))
    for a in range(len(paths)):
        x = y = heading = before = 0.0
        at, last = 0, paths.shape[1] - 1
        for s in range(len(along)):
            while at < last and math.hypot(
                paths[a, at + 1, 0] - x, paths[a, at + 1, 1] - y
            ) <= math.hypot(paths[a, at, 0] - x, paths[a, at, 1] - y):
                at += 1
            target = min(at + int(lookahead_m / step_m), last)
            dx, dy = paths[a, target, 0] - x, paths[a, target, 1] - y
            aside = math.cos(heading) * dy - math.sin(heading) * dx
            bend = min(max(2.0 * aside / max(dx * dx + dy * dy, 1e-6), -BENDS_1PM), BENDS_1PM)
            if s == 0:
                bends[a] = bend
            way, before = along[s] - before, along[s]
            turned = bend * way
            chord = way * (1.0 - turned * turned / 24.0)  # 2 sin(turned / 2) / bend
            x, y = (
                x + chord * math.cos(heading + turned / 2),
                y + chord * math.sin(heading + turned / 2),
            )
            heading += turned
            poses[a, s] = x, y, heading
    return bends, poses


def warm() -> None:
    """Compile what is compiled, before the robot moves."""
    blocks, low, one = (
        np.zeros((9, 9, WORDS), dtype=np.uint64),
        np.full(2, -4 * VOXEL_M),
        np.zeros(1),
    )
    _cover(blocks, low, np.zeros((1, 1, 3)), VOXEL_M, VOXEL_M, VOXEL_M)
    scores(np.zeros((1, 2)), one, np.ones(1, dtype=np.bool_), blocks, low, ends_rad(), 0.0)
    pursuits(np.zeros((1, 2, 2)), 1.0, one, 0.5)
