"""Manoeuvring where no single arc leads on: turning, backing and going forward by turns, the
footprint free at every pose."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.control.state_lattice import (
    CELL_M,
    FORWARD,
    REACH_M,
    STEP_M,
    TURNING,
    Ends,
    cells,
    cheapest,
)
from navcore.geometry.polyline import metres_along, points_at
from navcore.geometry.transform import Pose2, Twist, wrap_angle
from navcore.robot.profile import RobotProfile

Points = npt.NDArray[np.float64]

ON_M = 1.5
"""So far along the path a manoeuvre leads, where it can: then arcs may do again."""
LEAST_M = 0.3
"""One that gains less than this is none."""
ASIDE_M = 0.3
"""It ends this near to the path."""
LACKING_COST = 5.0
"""For each metre of the path that it does not gain: so much driving is worth it."""
SEEN_FROM_M, SEEN_TO_M, FACING_RAD = 1.2, 2.5, math.radians(25.0)
"""The camera sees the ground at such distances from the robot's middle, surely where it is so
little off its own."""
FORWARD_MPS, REVERSE_MPS, TURN_RADPS = 0.4, 0.2, 0.6
"""Its speeds; behind the robot the camera sees nothing."""
LOST_M = 0.12
"""Farther than this from where it should be the robot is no longer on its manoeuvre."""
PARTS = 3
"""Into so many parts a step is cut for steering."""
AIM_M = 0.35
"""How far ahead on its manoeuvre the robot aims."""
REACHED_RAD, REACHED_M = math.radians(2.0), 0.01


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Manoeuvre:
    """What is left of one."""

    poses: Points
    """(K, 3) x, y, heading in the map frame, close together."""
    ways: npt.NDArray[np.int64]
    """(K,) how each is come to: 1 forward, -1 in reverse, 2 turning left, -2 turning right in
    place."""
    room_m: float
    """It was found with so much room to everything."""
    serves: tuple[float, float]
    """(x, y) in the map frame of the place on the path that it leads to, or near to which one looks
    from its end."""

    def in_base(self, pose: Pose2) -> Points:
        """(K, 3) the poses in the base frame of a robot at a pose."""
        return np.column_stack(
            [pose.from_parent(self.poses[:, :2]), self.poses[:, 2] - pose.yaw_rad]
        )

    def takes_s(self, pose: Pose2) -> Points:
        """(K,) seconds until a robot at a pose comes to each of its own, about."""
        steps = np.diff(np.vstack([[pose.x_m, pose.y_m, pose.yaw_rad], self.poses]), axis=0)
        speeds = np.where(self.ways == FORWARD, FORWARD_MPS, REVERSE_MPS)
        turns = np.abs((steps[:, 2] + math.pi) % (2 * math.pi) - math.pi) / TURN_RADPS
        return np.asarray(
            np.cumsum(
                np.where(np.abs(self.ways) == 2, turns, np.hypot(steps[:, 0], steps[:, 1]) / speeds)
            )
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ManoeuvreProblem:
    """A tight place, in the base frame."""

    obstacles: Points
    """(M, 2) cells that no part of the body may touch …"""
    reach_m: float
    """… each as far as this around its middle."""
    unseen: Points
    """(U, 2) rim of what the camera has not seen: no part of the body is swept over it either …"""
    unseen_clearance_m: float
    """… nor comes nearer than this to its middle."""
    profile: RobotProfile
    room_m: float
    """Kept around the footprint."""


def manoeuvre_along(path: Points, tight: ManoeuvreProblem, pose: Pose2) -> Manoeuvre | None:
    """The cheapest manoeuvre that leads on along the (N, 2) path, base frame; None where there is
    none."""
    return _found(_ends(path), None, tight, pose)


def manoeuvre_to_see(path: Points, tight: ManoeuvreProblem, pose: Pose2) -> Manoeuvre | None:
    """The cheapest to where one sees how the (N, 2) path, base frame, goes on; None if there is
    none, or all of it is seen."""
    if len(tight.unseen) == 0:
        return None
    # Of what the body would be swept over first, the nearest: with that in the picture, so is what
    # lies behind it.
    metres = metres_along(path)
    ahead = path[metres <= ON_M]
    apart = np.hypot(*(tight.unseen[:, None] - ahead).transpose(2, 0, 1))
    beside = np.flatnonzero(apart.min(axis=1) < tight.profile.circumscribed_radius_m)
    if len(beside) == 0:
        return None
    nearest = beside[np.hypot(*tight.unseen[beside].T).argmin()]
    return _found(
        _views(tight.unseen[nearest], tight.obstacles), ahead[apart[nearest].argmin()], tight, pose
    )


def _found(
    ends: Ends, place: Points | None, tight: ManoeuvreProblem, pose: Pose2
) -> Manoeuvre | None:
    radii = np.concatenate(
        [
            np.full(len(tight.obstacles), tight.reach_m + tight.room_m),
            np.full(len(tight.unseen), tight.unseen_clearance_m + 0.002),
        ]
    )
    half_length_m, half_width_m = tight.profile.length_m / 2, tight.profile.width_m / 2
    near = np.vstack([tight.obstacles, tight.unseen])
    poses, kinds = cheapest(
        near, radii, ends, half_length_m=half_length_m, half_width_m=half_width_m
    )
    if len(poses) == 0:
        return None
    whole = np.vstack([np.zeros(3), poses])
    parts, ways = list[Points](), list[int]()
    for before, after, kind in zip(whole[:-1], poses, kinds.tolist(), strict=True):
        parts.append(_in_parts(before, after, kind))
        ways += [
            kind if kind != TURNING else 2 * round(math.copysign(1, after[2] - before[2]))
        ] * PARTS
    found = np.vstack(parts)
    on_map = pose.to_parent(
        np.vstack([found[:, :2], found[-1:, :2] if place is None else place[None]])
    )
    return Manoeuvre(
        poses=np.column_stack([on_map[:-1], found[:, 2] + pose.yaw_rad]),
        ways=np.array(ways),
        room_m=tight.room_m,
        serves=(float(on_map[-1, 0]), float(on_map[-1, 1])),
    )


def steer(
    manoeuvre: Manoeuvre, pose: Pose2, *, braking_mps2: float
) -> tuple[Twist, Manoeuvre] | None:
    """The velocity that carries a manoeuvre on from a pose, and what is left of it; None if it is
    done, or the robot off it."""
    poses, ways = manoeuvre.in_base(pose), manoeuvre.ways
    done = 0
    while done < len(ways) and _is_passed(poses[done], int(ways[done])):
        done += 1
    if done == len(ways):
        return None
    way = int(ways[done])
    changes = np.flatnonzero(ways[done:] != way)
    leg = poses[done : done + changes[0]] if len(changes) else poses[done:]
    if abs(way) == 2:
        if math.hypot(*leg[0, :2]) > LOST_M:
            return None
        left_rad = abs(wrap_angle(leg[0, 2])) + abs(leg[-1, 2] - leg[0, 2])
        twist = Twist(v_mps=0.0, w_radps=math.copysign(min(TURN_RADPS, 0.1 + 1.5 * left_rad), way))
    else:
        ahead = way * leg
        left_m = float(ahead[0, 0] + np.hypot(*np.diff(leg[:, :2], axis=0).T).sum())
        if abs(ahead[0, 1]) > LOST_M:
            return None
        speed = min(
            FORWARD_MPS if way == FORWARD else REVERSE_MPS,
            math.sqrt(2 * 0.5 * braking_mps2 * left_m) + 0.03,
        )
        bend = _bend(ahead[:, :2], leg[-1, 2])
        speed = min(speed, TURN_RADPS / max(abs(bend), 1e-6))
        twist = Twist(v_mps=way * speed, w_radps=speed * bend)
    return twist, dataclasses.replace(manoeuvre, poses=manoeuvre.poses[done:], ways=ways[done:])


def _ends(path: Points) -> Ends:
    """Beside the path, in its direction, the farther on the better."""
    metres = metres_along(path)
    stations = np.linspace(0.0, min(metres[-1], ON_M), 32)
    marks, on = (
        points_at(path, metres, at)
        for at in (stations, np.minimum(stations, max(metres[-1] - 0.3, 0.0)) + 0.3)
    )
    ahead = on - marks
    headings = np.arctan2(ahead[:, 1], ahead[:, 0])
    there = ahead.any(axis=1)
    headings[~there] = headings[there][-1] if there.any() else 0.0
    x, y = cells()
    away = np.hypot(x[..., None] - marks[:, 0], y[..., None] - marks[:, 1])
    nearest = away.argmin(axis=2)
    aside = away.min(axis=2)
    cost = LACKING_COST * (stations[-1] - stations[nearest]) + aside
    cost[(aside > ASIDE_M) | (stations[nearest] < min(LEAST_M, 0.9 * stations[-1]))] = np.inf
    return Ends(cost=cost, heading_rad=headings[nearest])


def _views(place: Points, obstacles: Points) -> Ends:
    """From where a (2,) place is seen: near it, facing it, with nothing in between."""
    x, y = cells()
    stands = np.zeros(x.shape, dtype=np.bool_)
    column, row = np.floor((obstacles + REACH_M) / CELL_M).astype(np.int64).T
    inside = (column >= 0) & (column < len(x)) & (row >= 0) & (row < len(x))
    stands[row[inside], column[inside]] = True
    hidden = np.zeros(x.shape, dtype=np.bool_)
    for share in np.linspace(0.0, 0.95, 24):
        between_x, between_y = x + share * (place[0] - x), y + share * (place[1] - y)
        column, row = (
            np.clip(np.floor((value + REACH_M) / CELL_M), 0, len(x) - 1).astype(np.int64)
            for value in (between_x, between_y)
        )
        hidden |= stands[row, column]
    away = np.hypot(x - place[0], y - place[1])
    cost = np.where(hidden | (away < SEEN_FROM_M) | (away > SEEN_TO_M), np.inf, 0.0)
    return Ends(cost=cost, heading_rad=np.arctan2(place[1] - y, place[0] - x), askew_rad=FACING_RAD)


def _in_parts(before: Points, after: Points, kind: int) -> Points:
    """(PARTS, 3) poses along one step, the last of them its end."""
    share = np.linspace(0.0, 1.0, PARTS + 1)[1:]
    turn = after[2] - before[2]
    heading = before[2] + share * turn
    if kind == TURNING:
        return np.column_stack([np.tile(before[:2], (PARTS, 1)), heading])
    chord = kind * STEP_M * share * np.sinc(share * turn / 2 / math.pi)
    bearing = before[2] + share * turn / 2
    return np.column_stack(
        [before[0] + chord * np.cos(bearing), before[1] + chord * np.sin(bearing), heading]
    )


def _is_passed(pose: Points, way: int) -> bool:
    if abs(way) == 2:
        left = wrap_angle(float(pose[2])) * math.copysign(1, way)
        return -math.pi / 2 < left <= REACHED_RAD
    return float(way * pose[0]) <= REACHED_M


def _bend(points: Points, end_heading_rad: float) -> float:
    """The curvature, in 1/m, of the arc to the point that lies `AIM_M` ahead on a leg; its end goes
    straight on."""
    metres = np.concatenate(
        [[math.hypot(*points[0])], np.hypot(*np.diff(points, axis=0).T)]
    ).cumsum()
    if metres[-1] >= AIM_M:
        x, y = points[int(np.searchsorted(metres, AIM_M))]
    else:
        beyond = AIM_M - metres[-1]
        x, y = points[-1] + beyond * np.array(
            [math.cos(end_heading_rad), math.sin(end_heading_rad)]
        )
    return float(np.clip(2 * y / max(x * x + y * y, 1e-6), -3.0, 3.0))
