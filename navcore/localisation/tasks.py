"""What localisation computes beside the tick: values in, values out, in any thread."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from navcore.config.localisation.relocalisation import RelocalisationConfig
from navcore.geometry.arrays import Points
from navcore.localisation.relocalisation.place_map import PlaceMap, place_map_of
from navcore.localisation.relocalisation.relocalisation import SearchResult, SearchTask, search_task
from navcore.localisation.scans.scan import Keyframe
from navcore.localisation.scans.scan_map import ScanMap


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TaskFailed:
    """The outcome of a task that raised an exception."""

    task: object
    """The task."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PrepareSearch:
    """Make the search tables of a map."""

    surfaces: Points
    """(N, 2) positions of the surfaces in metres of the map."""
    normals: Points
    """(N, 2) unit normals; (0, 0) where unknown."""
    keyframes: tuple[Keyframe, ...]
    """Keyframes of the map."""
    config: RelocalisationConfig
    """Sizes of the tables."""

    @staticmethod
    def of(scan_map: ScanMap, config: RelocalisationConfig) -> PrepareSearch:
        """Return the task for a map as it is now."""
        surfaces = scan_map.surfaces  # a copy
        return PrepareSearch(
            surfaces=surfaces[:, :2],
            normals=surfaces[:, 2:4] * surfaces[:, 5:],
            keyframes=scan_map.keyframes,
            config=config,
        )

    def run(self, is_cancelled: Callable[[], bool]) -> PlaceMap:
        """Return the tables; a second for 100 × 100 m, which nothing cuts short."""
        del is_cancelled
        return place_map_of(self.surfaces, self.normals, self.config.search, self.keyframes)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SearchPlaces:
    """Search scans in a map."""

    task: SearchTask
    """What to search."""
    place_map: PlaceMap
    """Where to search."""
    config: RelocalisationConfig
    """How to search."""

    def run(self, is_cancelled: Callable[[], bool]) -> SearchResult | None:
        """Return the places that were found; None if it was cancelled."""
        return search_task(self.task, self.place_map, self.config, is_cancelled)
