"""What the local planner chooses its next motion from: arcs, or what comes of pursuing Falco's
paths."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.control.primitives.arcs import ALONG_M, arcs
from navcore.control.primitives.falco import (
    GROUPS,
    HEADINGS_RAD,
    IN_GROUP,
    RADII_M,
    SCALES,
    TRIES,
    Table,
    ends_rad,
    fan,
    pursuits,
    scores,
)

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Primitives:
    """Motions from the robot's place on, base frame."""

    bends_1pm: Floats
    """(A,) curvature that each begins with."""
    poses: Floats
    """(A, S, 3) x, y and heading at each of `ALONG_M` on the way."""
    pursued: bool = False
    """Whether these are Falco's paths, along which the curvature changes."""


def all_arcs() -> Primitives:
    """Whatever stands near, the arcs are the same."""
    bends, poses = arcs()
    return Primitives(bends_1pm=bends, poses=poses)


def likeliest(
    points: Floats,
    may_turn_to: npt.NDArray[np.bool_],
    path: Floats,
    *,
    body_m: tuple[float, float],
    room_m: float,
    speed: float,
) -> Primitives:
    """Of Falco's paths, as they would be driven, the best seven of each of the seven groups that
    most probably lead on.

    None where none is free. `points` are (N, 2) obstacles in the base frame, `body_m` half the
    length and width, to be kept `room_m` away from them; `may_turn_to` says of each of the 36
    headings whether the robot can turn to it in place. The paths are the longer, and things count
    from the farther away, the faster it is: `speed` is the share of its full one. Which of them is
    driven is decided by what the body does on the way along them.
    """
    tables = [
        Table.of(*body_m, room_m, scale) for scale in SCALES
    ]  # all at first, while the robot stands
    away, path_away = np.hypot(*points.T), np.hypot(*path.T)
    for scale_at, range_m in TRIES[first_try(speed) :]:
        scale, table = SCALES[scale_at], tables[scale_at]
        aim = path[int(np.argmax(path_away > range_m)) if path_away.max() > range_m else -1]
        # What stands beyond the goal is in nobody's way.
        counts = points[away < min(range_m, path_away[-1] + math.hypot(*body_m))]
        towards = math.atan2(aim[1], aim[0])
        found = scores(
            counts, HEADINGS_RAD, may_turn_to, table.blocks, table.low_m, ends_rad(), towards
        )
        found = found.reshape(-1, IN_GROUP)
        groups = np.argsort(-found.sum(axis=1), kind="stable")[:GROUPS, None]
        paths = np.argsort(-found[groups[:, 0]], axis=1, kind="stable")[:, :GROUPS]
        free = found[groups, paths] > 0
        if free.any():
            return _pursued((groups + 0 * paths)[free], paths[free], scale)
    return NOTHING


def first_try(speed: float) -> int:
    """Index of the largest scale that a share of the full speed is enough for, or else of the last."""
    return sum(speed * SCALES[0] < scale for scale in SCALES[:-1])


def _pursued(
    groups: npt.NDArray[np.int64], paths: npt.NDArray[np.int64], scale: float
) -> Primitives:
    """What comes of pursuing the paths of so many groups, 7 for each heading, and numbers within
    them."""
    turned = _turned(
        fan()[groups % GROUPS * IN_GROUP + paths, ::5, :2] * scale, HEADINGS_RAD[groups // GROUPS]
    )
    bends, poses = pursuits(turned, scale * float(RADII_M[5]), ALONG_M, LOOKAHEAD_M)
    return Primitives(bends_1pm=bends, poses=poses, pursued=True)


def _turned(points: Floats, angles_rad: Floats) -> Floats:
    """(A, M, 2) points, each row turned about the origin by its angle."""
    cos, sin = np.cos(angles_rad)[:, None], np.sin(angles_rad)[:, None]
    x, y = points[..., 0], points[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=2)


LOOKAHEAD_M = 0.5
"""So far ahead on it a path is pursued."""
NOTHING = Primitives(bends_1pm=np.empty(0), poses=np.empty((0, len(ALONG_M), 3)), pursued=True)
