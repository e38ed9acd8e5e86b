"""Random outlines of markings and spills on a floor."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Corners = npt.NDArray[np.float64]
"""(N, 2) x, y in metres."""


def zone(rng: np.random.Generator, reach_m: float) -> Corners:
    """Return the (N, 2) corners of a rectangle, or of a polygon of three to seven corners, about
    the origin."""
    turn = rng.uniform(0, math.pi)
    if rng.random() < 0.55:
        x, y = reach_m * rng.uniform(0.5, 1.0, 2)
        corners = np.array([[x, y], [-x, y], [-x, -y], [x, -y]])
        return np.asarray(
            corners
            @ np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        )
    count = int(rng.integers(3, 8))
    angles = turn + 2 * math.pi * (np.arange(count) + rng.uniform(-0.25, 0.25, count)) / count
    return np.asarray(
        (reach_m * rng.uniform(0.6, 1.0, count))[:, None]
        * np.column_stack([np.cos(angles), np.sin(angles)])
    )


def blob(rng: np.random.Generator, reach_m: float) -> Corners:
    """Return the (40, 2) corners of a rounded, irregular puddle about the origin."""
    angles = np.linspace(0, 2 * math.pi, 40, endpoint=False)
    radius = np.ones(40)
    for wave in range(1, 6):
        radius += rng.normal(0, 0.3 / wave) * np.cos(wave * angles + rng.uniform(0, 2 * math.pi))
    radius = reach_m * np.clip(radius, 0.3, 1.8)
    flat = np.column_stack([np.cos(angles), rng.uniform(0.5, 1.0) * np.sin(angles)])
    turn = rng.uniform(0, math.pi)
    spun = flat @ np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    return np.asarray(radius[:, None] * spun)


def as_tuples(corners: Corners) -> tuple[tuple[float, float], ...]:
    """Return the corners as a scene stores them."""
    return tuple((float(x), float(y)) for x, y in corners)
