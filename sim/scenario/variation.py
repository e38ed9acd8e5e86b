"""Variation of a scenario by a seed: exact poses of chairs and items, contents of rooms and woods,
positions of hills, and the random sources of the sensors.

The same seed gives the same world, bit for bit.
"""

from __future__ import annotations

import dataclasses
from enum import IntEnum
from typing import TypeVar

import numpy as np

from sim.scenario.furnishing import furnish
from sim.scenario.scattering import scatter
from sim.scenario.schema import Furniture, Item, Scenario

Movable = TypeVar("Movable", Furniture, Item)

MOVED_BY_HAND = frozenset({"chair", "armchair", "bin", "plant"})
"""Kinds of furniture that people move a little every day."""
SHIFT_M = 0.03
"""Standard deviation of the position of a piece along x and along y."""
TURN_DEG = 5.0
"""Standard deviation of its rotation."""
MAX_DEVIATIONS = 2.0
"""Largest displacement in standard deviations, so that a path that is free in the file stays free.
"""


class Source(IntEnum):
    """Random sources, each with a generator of its own, so that one more draw in one changes none
    of the others."""

    WORLD = 0
    PEOPLE = 1
    GYRO = 2
    ENCODER = 3
    CAMERA = 4
    FAULTS = 5
    SCENERY = 6
    SLIP = 7
    ACCELEROMETER = 8
    GNSS = 9
    SCANNER = 10


def generator(seed: int, source: Source) -> np.random.Generator:
    """Return the random generator of one source in one run."""
    return np.random.default_rng((seed, source))


def randomise(scenario: Scenario, seed: int) -> Scenario:
    """Return the scenario as it is in the run of this seed."""
    relief = scenario.relief and dataclasses.replace(scenario.relief, seed=seed)
    found = dataclasses.replace(another_day(scenario, seed), relief=relief)
    scenery = generator(seed, Source.SCENERY)
    return scatter(furnish(found, scenery), scenery)


def another_day(scenario: Scenario, seed: int) -> Scenario:
    """Return the same world on another day: chairs and items stand a little elsewhere."""
    rng = generator(seed, Source.WORLD)
    furniture = tuple(
        _nudge(piece, rng) if piece.kind in MOVED_BY_HAND else piece for piece in scenario.furniture
    )
    items = tuple(_nudge(item, rng) for item in scenario.items)
    return dataclasses.replace(scenario, furniture=furniture, items=items)


def _nudge(piece: Movable, rng: np.random.Generator) -> Movable:
    x, y, turn = np.clip(rng.standard_normal(3), -MAX_DEVIATIONS, MAX_DEVIATIONS)
    at = (piece.at[0] + SHIFT_M * float(x), piece.at[1] + SHIFT_M * float(y))
    return dataclasses.replace(piece, at=at, yaw_deg=piece.yaw_deg + TURN_DEG * float(turn))
