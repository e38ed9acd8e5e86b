"""Regions of a class on the map: its connected cells, whatever has shown them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from navcore.geometry.arrays import Points
from navcore.mapping.point_map import PointMap
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


def regions_of(
    point_map: PointMap, class_id: int, at: tuple[float, float] | None = None
) -> tuple[Region, ...]:
    """Return the regions of a class, or with `at` only the one at this place, the nearest within
    `REACH_M`; empty without one. Connected cells that are too many for one region become several.
    """
    plane = point_map.layers.bools(class_id)
    count, names = cv2.connectedComponents(plane.astype(np.uint8), connectivity=8)
    cells = np.argwhere(plane)
    points, own = point_map.spec.centres(cells), names[plane]
    wanted = np.arange(1, count)
    if at is not None:
        away_m = np.hypot(*(points - at).T)
        near = away_m <= min(REACH_M, away_m.min(initial=np.inf))
        wanted = np.unique(own[near])[:1]
    seen = point_map.edits.beware_points
    seen = seen[(seen["class_id"] == class_id) & (seen["cell"] >= 0)]
    surest = np.zeros(count)
    np.maximum.at(surest, names.ravel()[seen["cell"]], seen["confidence"])
    return tuple(
        Region(
            class_id=class_id,
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
