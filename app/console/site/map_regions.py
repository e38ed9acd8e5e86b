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


def regions_of(point_map: PointMap, class_id: int) -> tuple[Region, ...]:
    """Return the regions of a class; what is larger than a region may be becomes several."""
    plane = point_map.layers.bools(class_id)
    count, names = cv2.connectedComponents(plane.astype(np.uint8), connectivity=8)
    seen = point_map.beware_points
    seen = seen[(seen["class_id"] == class_id) & (seen["cell"] >= 0)]
    surest = np.zeros(count)
    np.maximum.at(surest, names.ravel()[seen["cell"]], seen["confidence"])

    def of(name: int) -> Iterator[Region]:
        points = point_map.spec.centres(np.argwhere(names == name))
        for first in range(0, len(points), MAX_POINTS):
            yield Region(
                class_id=class_id,
                points=points[first : first + MAX_POINTS],
                confidence=max(float(surest[name]), LEAST_CONFIDENCE),
            )

    return tuple(region for name in range(1, count) for region in of(name))


def distance_m(region: Region, x_m: float, y_m: float) -> float:
    """Return the distance of a place from a region, metres."""
    return float(np.hypot(*(region.points - (x_m, y_m)).T).min())


def regions_at(point_map: PointMap, class_id: int, at: tuple[float, float]) -> tuple[Region, ...]:
    """Return the region of a class at a place, the nearest one within `REACH_M`; empty without
    one."""
    found = [(distance_m(region, *at), region) for region in regions_of(point_map, class_id)]
    least = min((away for away, _ in found), default=np.inf)
    return tuple(region for away, region in found if away == least <= REACH_M)
