"""What a robot may know of its world before it starts: a map from elsewhere, or its own of an earlier session."""

from __future__ import annotations

from pathlib import Path

from navcore import map_file, nav2_map
from navcore.beware import BewareList
from navcore.cloud_map import CloudMap
from navcore.prior_map import prior_layer


def recall(cloud: CloudMap, beware: BewareList, *, prior: Path | None, kept: Path | None) -> None:
    """Put on an empty map what is known; raises `BadConfiguration` naming the file that does not fit."""
    if kept is not None and kept.exists():
        stored = map_file.load(kept)
        map_file.check_classes(stored, beware)
        cloud.restore(stored.state)
    if prior is not None:
        cloud.load_prior(prior_layer(nav2_map.load(prior), cloud.spec))


def keep(cloud: CloudMap, beware: BewareList, kept: Path | None) -> None:
    """Write the map to its file; what was there stays intact until the new one is whole."""
    if kept is not None:
        map_file.save(kept, cloud.state(), {entry.class_id: entry.name for entry in beware.classes})
