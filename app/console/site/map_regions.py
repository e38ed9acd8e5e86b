"""Regions of a class on the map: its connected cells, whatever has shown them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from navcore.geometry.arrays import Points
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.point_links import Records
from navcore.mapping.points.rejections import MAX_POINTS

REACH_M = 0.3
"""Largest distance in metres of a place from the region that is meant by it."""
LEAST_CONFIDENCE = 0.95
"""Least confidence that a region is taken to have been shown with: a map keeps what its looks
amount to, and not the surest of them."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Region:
    """Where something of a class is."""

    class_id: int
    """Class id of the beware list."""
    points: Points
    """(N, 2) positions in metres of the map frame that cover it, at most `MAX_POINTS`."""
    confidence: float
    """Highest confidence of what has shown it, 0 to 1."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClassCells:
    """What a map holds of a class."""

    class_id: int
    """Class id of the beware list."""
    spec: GridSpec
    """Grid of the map."""
    occupied: BoolGrid
    """(rows, cols) cells of the class."""
    points: Records
    """(N,) points of the class."""

    @classmethod
    def of(cls, point_map: PointMap, class_id: int) -> ClassCells:
        """Return a copy of what a map holds; only the thread that changes the map may call it."""
        points = point_map.edits.beware_points
        return cls(
            class_id=class_id,
            spec=point_map.spec,
            occupied=point_map.layers.bools(class_id),
            points=points[points["class_id"] == class_id],
        )


def regions_of(cells: ClassCells, at: tuple[float, float] | None = None) -> tuple[Region, ...]:
    """Return the regions of a class, or with `at` only the one at this place, the nearest within
    `REACH_M`; empty without one. Connected cells that are too many for one region become several.
    """
    occupied = cells.occupied
    count, names = cv2.connectedComponents(occupied.astype(np.uint8), connectivity=8)
    points, own = cells.spec.centres(np.argwhere(occupied)), names[occupied]
    wanted = np.arange(1, count)
    if at is not None:
        away_m = np.hypot(*(points - at).T)
        near = away_m <= min(REACH_M, away_m.min(initial=np.inf))
        wanted = np.unique(own[near])[:1]
    seen = cells.points[cells.points["cell"] >= 0]
    surest = np.zeros(count)
    np.maximum.at(surest, names.ravel()[seen["cell"]], seen["confidence"])
    return tuple(
        Region(
            class_id=cells.class_id,
            points=part,
            confidence=max(float(surest[name]), LEAST_CONFIDENCE),
        )
        for name in wanted.tolist()
        for part in _parts(points[own == name])
    )


def _parts(points: Points) -> Iterator[Points]:
    """Return points in parts of at most `MAX_POINTS`."""
    for first in range(0, len(points), MAX_POINTS):
        yield points[first : first + MAX_POINTS]


def distance_m(region: Region, x_m: float, y_m: float) -> float:
    """Return the distance of a place from a region, metres."""
    return float(np.hypot(*(region.points - (x_m, y_m)).T).min())
