"""How the tyres of a skid-steered robot hold the floor.

The engine's own friction is dry: a wheel that slips at all pulls with its full force, in a direction that the solver picks
among contacts that come and go, and the robot creeps and jerks in every turn. Rubber grips in proportion to how it slips, up
to a limit. So the wheels are frictionless to the engine, and these forces hold the robot instead.
"""

from __future__ import annotations

import math

STIFFNESS_NSPM = 3000.0
"""Force per slip speed of the two tyres of one side, along and across."""
SIDE_GRIP_N = 200.0
"""Largest force of one side: friction 0.8 on half the robot's weight."""
SCRUB_NMS = 200.0
"""Torque per yaw rate that it takes to drag the tyres sideways in a turn."""
SCRUB_NM = 60.0
"""Largest such torque."""

Force = tuple[float, float]
"""Forward and to the left, N."""


def grip(motion: tuple[float, float, float], left_mps: float, right_mps: float, track_m: float) -> tuple[Force, Force]:
    """What the floor does to the (left, right) tyres.

    `motion` is the body's speed forward and to the left and its yaw rate; the wheels' rims move at `left_mps`, `right_mps`.
    """
    along, across, yaw_rate = motion
    scrub = max(-SCRUB_NM, min(SCRUB_NM, SCRUB_NMS * yaw_rate)) / track_m
    sideways = -STIFFNESS_NSPM * across / 2
    return (
        _limited(STIFFNESS_NSPM * (left_mps - along + yaw_rate * track_m / 2) + scrub, sideways),
        _limited(STIFFNESS_NSPM * (right_mps - along - yaw_rate * track_m / 2) - scrub, sideways),
    )


def _limited(forward: float, left: float) -> Force:
    share = min(1.0, SIDE_GRIP_N / max(math.hypot(forward, left), 1e-9))
    return (share * forward, share * left)
