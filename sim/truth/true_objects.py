"""The true beware objects of a scenario, by the classes of a beware list: for oracles, and for
counting missed detections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim.models.solids import Polygon
from sim.scenario.layout import items
from sim.scenario.schema import Scenario

PERSON = "person"
FIRST_MARKING = 1
"""Body of the first marking: `build_world` makes the floor first, and then all markings."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrueObject:
    """A beware object."""

    name: str
    """Class in the beware list, e.g. `cup`, `red floor`, `spill`."""
    outlines: tuple[Polygon, ...]
    """(N, 2) outlines of the covered floor, in metres of the map frame."""


def true_objects(scenario: Scenario) -> tuple[TrueObject, ...]:
    """Return all items and all beware markings; people move and are not included."""
    lying = [TrueObject(name=item.name, outlines=item.outlines()) for item in items(scenario)]
    painted = [
        TrueObject(name=marking.beware_class, outlines=(np.array(marking.polygon),))
        for marking in scenario.markings
        if marking.beware
    ]
    return (*lying, *painted)


def class_of_bodies(
    scenario: Scenario, *, item_bodies: Sequence[int], first_person: int
) -> dict[int, str]:
    """Return body → class. `item_bodies`: the bodies of the items; those of people begin at
    `first_person`."""
    return {
        **{
            FIRST_MARKING + i: marking.beware_class
            for i, marking in enumerate(scenario.markings)
            if marking.beware
        },
        **{body: item.kind for body, item in zip(item_bodies, scenario.items, strict=True)},
        **{first_person + i: PERSON for i in range(len(scenario.people))},
    }
