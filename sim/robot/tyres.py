"""How the tyres of a skid-steered robot hold the floor.

The engine's own friction is dry: a wheel that slips at all pulls with its full force, in a
direction that the solver picks among contacts that come and go, and the robot creeps and jerks in
every turn. Rubber grips in proportion to how it slips, up to a limit. So the wheels are
frictionless to the engine, and these forces hold the robot instead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

Force = tuple[float, float]
"""Forward and to the left, N."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tyres:
    """Of one platform."""

    stiffness_nspm: float
    """Force per slip speed of the two tyres of one side, along and across."""
    side_grip_n: float
    """Largest force of one side: friction 0.8 on half the robot's weight."""
    scrub_nms: float
    """Torque per yaw rate that it takes to drag the tyres sideways in a turn."""
    scrub_nm: float
    """Largest such torque."""


def grip(
    motion: tuple[float, float, float],
    left_mps: float,
    right_mps: float,
    track_m: float,
    tyres: Tyres,
    uphill: Force = (0.0, 0.0),
) -> tuple[Force, Force]:
    """What the floor does to the (left, right) tyres.

    `motion` is the body's speed forward and to the left and its yaw rate; the wheels' rims move at
    `left_mps`, `right_mps`. `uphill` is what each side bears of the weight on a slope: rubber holds
    that without slipping.
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
