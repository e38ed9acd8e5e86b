"""Loading and saving of maps: a prior map from elsewhere, the robot's own map of an earlier
session."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from navcore.errors import BadConfiguration
from navcore.formats import nav2_map
from navcore.grid.grid import GridSpec
from navcore.grid.growth import growth_into, growth_over
from navcore.mapping.point_map import PointMap
from navcore.mapping.storage import map_file
from navcore.mapping.storage.map_state import MapState
from navcore.mapping.storage.prior_map import prior_layer
from navcore.mission.beware_list import BewareList


def load_map(cloud: PointMap, beware: BewareList, *, prior: Path | None, kept: Path | None) -> None:
    """Load the prior map and the saved map into an empty map, whose grid grows to contain them.

    Raises `BadConfiguration` naming a file that does not fit. `Navigator.adopt_map` has to follow.
    """
    if kept is not None and kept.exists():
        stored = map_file.load(kept)
        map_file.check_classes(stored, beware)
        check_grid(stored.state.spec, cloud.spec, kept.name)
        cloud.restore(stored.state)
    if prior is not None:
        # The saved map has priority where it was measured: an obstacle of the prior map that was
        # seen to be gone stays gone.
        source = nav2_map.load(prior)
        occupied = prior_layer(source, cloud.spec).copy()
        growth = growth_over(cloud.spec, source.spec)
        if growth is not None:
            cloud.grow(growth)
            occupied = prior_layer(source, cloud.spec).copy()
        measured = cloud.explored.was_measured(np.flatnonzero(occupied))
        occupied[occupied] = ~measured
        held = cloud.layers.prior
        cloud.load_prior(occupied if held is None else occupied | held.bools)


def check_grid(spec: GridSpec, first: GridSpec, where: str) -> None:
    """Raise `BadConfiguration` for a stored map whose grid has not grown from the first grid of
    this world."""
    if growth_into(first, spec) is None:
        raise BadConfiguration(
            f"{where}: the stored map covers {spec.extent()} in cells of {spec.resolution_m:g} m, "
            f"the map of this world begins with {first.extent()} in cells of "
            f"{first.resolution_m:g} m"
        )


def save_map(
    cloud: PointMap, beware: BewareList, kept: Path | None, held: MapState | None = None
) -> None:
    """Write the map, or one that is `held` instead, to its file, atomically."""
    if kept is not None:
        map_file.save(kept, held or cloud.state(), {**names_in(kept), **beware.names})


def names_in(kept: Path) -> Mapping[int, str]:
    """Return the class names of the saved map, which keeps those of removed classes."""
    try:
        return map_file.load(kept).class_names if kept.exists() else {}
    except BadConfiguration:
        return {}  # damaged since it was read: it is overwritten
