"""The true beware objects of a scenario, by the classes of a beware list: for oracles, and for
counting missed detections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim.models.solids import Polygon
from sim.scenario.layout import items
from sim.scenario.schema import Scenario


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
