"""Distance of the oriented footprint to people who walk, at poses along motions: compiled loops."""

from __future__ import annotations

import math

import numpy as np

from navcore.compiled import compiled, finite
from navcore.geometry.arrays import Bools, Floats

_ROUNDING_M = 1e-6
"""Distance in metres far above the rounding error of a bound."""


@compiled
def gaps(
    walking: Floats, poses: Floats, times_s: Floats, half: tuple[float, float], later_s: Floats
) -> Floats:
    """(A, S) least distance of the footprint at each pose to where any person is then, or arrives
    at the moments after it."""
    count, steps = times_s.shape
    found = np.full((count, steps), np.inf)
    for a in range(count):
        for s in range(steps):
            heading = math.cos(poses[a, s, 2]), math.sin(poses[a, s, 2])
            for p in range(len(walking)):
                x, y = walking[p, 0] - poses[a, s, 0], walking[p, 1] - poses[a, s, 1]
                person = x, y, walking[p, 2], walking[p, 3]
                squared = _least_squared_gap(person, heading, half, times_s[a, s], later_s)
                found[a, s] = min(found[a, s], math.sqrt(squared) - walking[p, 4])
    return found


@compiled
def are_clear(
    walking: Floats,
    poses: Floats,
    times_s: Floats,
    half: tuple[float, float],
    personal: tuple[float, float],
    later_s: Floats,
) -> Bools:
    """(A, S) whether the gap to every person is larger than `personal`, metres and metres per
    second of the time, up to each pose.

    A person who is too far off to come that near within the headway is not looked at, and nothing
    after the first pose that is not clear.
    """
    count, steps = times_s.shape
    clear = np.zeros((count, steps), dtype=np.bool_)
    reach_m = np.empty(len(walking))
    for p in range(len(walking)):
        walked_m = later_s[-1] * math.hypot(walking[p, 2], walking[p, 3])
        reach_m[p] = math.hypot(half[0], half[1]) + walking[p, 4] + walked_m + _ROUNDING_M
    for a in range(count):
        for s in range(steps):
            time_s = times_s[a, s]
            gap_m = personal[0] + personal[1] * time_s
            is_clear = True
            for p in range(len(walking)):
                x, y = walking[p, 0] - poses[a, s, 0], walking[p, 1] - poses[a, s, 1]
                vx, vy = walking[p, 2], walking[p, 3]
                far_m = reach_m[p] + max(gap_m, 0.0)
                if (x + time_s * vx) ** 2 + (y + time_s * vy) ** 2 > far_m**2:
                    continue
                heading = math.cos(poses[a, s, 2]), math.sin(poses[a, s, 2])
                squared = _least_squared_gap((x, y, vx, vy), heading, half, time_s, later_s)
                is_clear = is_clear and math.sqrt(squared) - walking[p, 4] > gap_m
            if not is_clear:
                break
            clear[a, s] = True
    return clear


@finite
def _least_squared_gap(
    person: tuple[float, float, float, float],
    heading: tuple[float, float],
    half: tuple[float, float],
    time_s: float,
    later_s: Floats,
) -> float:
    """Return the least squared distance of the footprint to a person, x, y and velocity along both
    from its middle, at a time and at some seconds later; a loop that the compiler vectorises."""
    (x, y, vx, vy), (cos, sin), (half_length, half_width) = person, heading, half
    least = math.inf
    for moment in range(len(later_s)):
        t = time_s + later_s[moment]
        dx, dy = x + t * vx, y + t * vy
        out_x, out_y = abs(cos * dx + sin * dy) - half_length, abs(cos * dy - sin * dx) - half_width
        out_x = out_x if out_x > 0.0 else 0.0
        out_y = out_y if out_y > 0.0 else 0.0
        squared = out_x * out_x + out_y * out_y
        least = squared if squared < least else least
    return least
