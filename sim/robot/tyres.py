"""Tyre forces of a skid-steered robot.

The friction of the engine is dry: a wheel that slips at all pulls with its full force, in a
direction that the solver picks among contacts that come and go, and the robot creeps and jerks in
every turn. Rubber grips in proportion to its slip, up to a limit. So the wheels are frictionless to
the engine, and these forces hold the robot instead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

Force = tuple[float, float]
"""Forces forward and to the left, N."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tyres:
    """Tyre parameters of one platform."""

    stiffness_nspm: float
    """Force of the two tyres of one side per slip speed, along and across, N·s/m."""
    side_grip_n: float
    """Largest force of one side: friction 0.8 on half the weight of the robot, N."""
    scrub_nms: float
    """Torque per yaw rate that drags the tyres sideways in a turn, N·m·s."""
    scrub_nm: float
    """Largest such torque, N·m."""


def tyre_forces(
    motion: tuple[float, float, float],
    left_mps: float,
    right_mps: float,
    track_m: float,
    tyres: Tyres,
    uphill: Force = (0.0, 0.0),
) -> tuple[Force, Force]:
    """Return the floor forces on the (left, right) tyres.

    `motion` is the speed of the body forward and to the left, and its yaw rate; the rims of the
    wheels move at `left_mps` and `right_mps`. `uphill` is the part of the weight that each side
    bears on a slope: rubber holds it without slip.
    """
    along, across, yaw_rate = motion
    ahead, beside = uphill
    scrub = max(-tyres.scrub_nm, min(tyres.scrub_nm, tyres.scrub_nms * yaw_rate)) / track_m
    sideways, stiffness = beside - tyres.stiffness_nspm * across / 2, tyres.stiffness_nspm
    return (
        _limited(
            stiffness * (left_mps - along + yaw_rate * track_m / 2) + scrub + ahead,
            sideways,
            tyres.side_grip_n,
        ),
        _limited(
            stiffness * (right_mps - along - yaw_rate * track_m / 2) - scrub + ahead,
            sideways,
            tyres.side_grip_n,
        ),
    )


def _limited(forward: float, left: float, most: float) -> Force:
    share = min(1.0, most / max(math.hypot(forward, left), 1e-9))
    return (share * forward, share * left)
