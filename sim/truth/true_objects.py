"""What there is to beware of in a scenario, by the classes of a beware list: for oracles, and for
counting what was missed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim.models.solids import Polygon
from sim.scenario.layout import items
from sim.scenario.schema import Marking, Scenario

PERSON = "person"
FIRST_MARKING = 1
"""Number of its body: `build_world` makes the floor first, and then all markings."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrueThing:
    """Something to beware of."""

    name: str
    """Its class, e.g. `cup`, `red floor`, `spill`."""
    outlines: tuple[Polygon, ...]
    """(N, 2) each, in metres of the map frame: what it covers of the floor."""


def true_things(scenario: Scenario) -> tuple[TrueThing, ...]:
    """All items and all markings to beware of; people come and go and are none of them."""
    lying = [TrueThing(name=item.name, outlines=item.outlines()) for item in items(scenario)]
    painted = [
        TrueThing(name=class_of(marking), outlines=(np.array(marking.polygon),))
        for marking in scenario.markings
        if marking.beware
    ]
    return (*lying, *painted)


def class_of(marking: Marking) -> str:
    """Paint to beware of is a red floor, whatever its colour; all else is a spill."""
    return "red floor" if marking.surface == "paint" else "spill"


def class_of_bodies(
    scenario: Scenario, *, loose: Sequence[int], first_person: int
) -> dict[int, str]:
    """Number of a body → class. `loose`: those of the items; people begin at `first_person`."""
    return {
        **{
            FIRST_MARKING + i: class_of(marking)
            for i, marking in enumerate(scenario.markings)
            if marking.beware
        },
        **{body: item.kind for body, item in zip(loose, scenario.items, strict=True)},
        **{first_person + i: PERSON for i in range(len(scenario.people))},
    }
