"""What a seed changes: where chairs and items stand exactly, what rooms and woods hold, where hills
are, how each sensor errs.

Same seed, same world, bit for bit.
"""

from __future__ import annotations

import dataclasses
from enum import IntEnum
from typing import TypeVar

import numpy as np

from sim.scenario.furnishing import furnish
from sim.scenario.scattering import strew
from sim.scenario.schema import Furniture, Item, Scenario

Placed = TypeVar("Placed", Furniture, Item)

MOVED_BY_HAND = frozenset({"chair", "armchair", "bin", "plant"})
"""Furniture that does not stand on the same spot every day."""
SHIFT_M = 0.03
"""Standard deviation of a piece's place along x and along y."""
TURN_DEG = 5.0
"""Standard deviation of its turn."""
LARGEST = 2.0
"""No piece moves by more standard deviations than this, so a way that is free in the file stays
free."""


class Source(IntEnum):
    """Everything random draws from a generator of its own, so that one more draw in one changes
    none of the others."""

    WORLD = 0
    PEOPLE = 1
    GYRO = 2
    ENCODER = 3
    CAMERA = 4
    FAULTS = 5
    SCENERY = 6


def generator(seed: int, source: Source) -> np.random.Generator:
    """The random numbers of one source in one run."""
    return np.random.default_rng((seed, source))


def randomise(scenario: Scenario, seed: int) -> Scenario:
    """The scenario as it is found in this run."""
    rng = generator(seed, Source.WORLD)
    furniture = tuple(
        _nudge(piece, rng) if piece.kind in MOVED_BY_HAND else piece for piece in scenario.furniture
    )
    relief = scenario.relief and dataclasses.replace(scenario.relief, seed=seed)
    items = tuple(_nudge(item, rng) for item in scenario.items)
    found = dataclasses.replace(scenario, furniture=furniture, items=items, relief=relief)
    scenery = generator(seed, Source.SCENERY)
    return strew(furnish(found, scenery), scenery)


def _nudge(thing: Placed, rng: np.random.Generator) -> Placed:
    x, y, turn = np.clip(rng.standard_normal(3), -LARGEST, LARGEST)
    at = (thing.at[0] + SHIFT_M * float(x), thing.at[1] + SHIFT_M * float(y))
    return dataclasses.replace(thing, at=at, yaw_deg=thing.yaw_deg + TURN_DEG * float(turn))
