"""Distance of the footprint from many polygons, at every physics step: compiled, with bounding
circles first."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, nested
from sim.models.solids import Polygon

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outlines:
    """Packed simple polygons; each belongs to an object, of which it may be one part of many."""

    corners: Floats
    """(M, 2) corners of all polygons, one after the other."""
    ends: npt.NDArray[np.int64]
    """(K + 1,) index in `corners` at which each polygon begins and ends."""
    circles: Floats
    """(K, 3) x, y and radius of a bounding circle of each polygon."""
    owners: npt.NDArray[np.int64]
    """(K,) number of the object that each polygon belongs to."""
    count: int
    """Number of objects."""

    @staticmethod
    def of(owners: Sequence[Sequence[Polygon]]) -> Outlines:
        """Pack the polygons of each object; they need not be convex."""
        polygons = [np.asarray(polygon, dtype=np.float64) for parts in owners for polygon in parts]
        return Outlines(
            corners=np.concatenate([np.empty((0, 2)), *polygons]),
            ends=np.cumsum([0, *(len(polygon) for polygon in polygons)]),
            circles=np.array([_circle(polygon) for polygon in polygons]).reshape(-1, 3),
            owners=np.array([i for i, parts in enumerate(owners) for _ in parts], dtype=np.int64),
            count=len(owners),
        )

    def proximity(
        self, body: Polygon, touch_m: float, known_m: float
    ) -> tuple[npt.NDArray[np.bool_], float]:
        """Return the (count,) mask of objects within `touch_m` of the polygon `body`, and the least
        distance to any object in metres.

        The distance is exact where it is below `known_m`, else `known_m`; it is 0 on overlap.
        """
        touched = np.zeros(self.count, dtype=np.bool_)
        least_m = _proximity(
            body, self.corners, self.ends, self.circles, self.owners, touch_m, known_m, touched
        )
        return touched, float(least_m)


def distance_m(a: Polygon, b: Polygon) -> float:
    """Return the distance of two simple polygons; 0 when they overlap."""
    return float(_distance(np.ascontiguousarray(a), np.ascontiguousarray(b)))


def _circle(polygon: Polygon) -> tuple[float, float, float]:
    x, y = (polygon.min(axis=0) + polygon.max(axis=0)) / 2
    return x, y, float(np.hypot(polygon[:, 0] - x, polygon[:, 1] - y).max())


@compiled
def _proximity(
    body: Floats,
    corners: Floats,
    ends: npt.NDArray[np.int64],
    circles: Floats,
    owners: npt.NDArray[np.int64],
    touch_m: float,
    known_m: float,
    touched: npt.NDArray[np.bool_],
) -> float:
    x, y, reach = 0.0, 0.0, 0.0
    for i in range(len(body)):
        x += body[i, 0] / len(body)
        y += body[i, 1] / len(body)
    for i in range(len(body)):
        reach = max(reach, math.hypot(body[i, 0] - x, body[i, 1] - y))
    least = known_m
    for k in range(len(owners)):
        at_least = math.hypot(circles[k, 0] - x, circles[k, 1] - y) - circles[k, 2] - reach
        if at_least > touch_m and at_least >= least:
            continue
        gap = _distance(body, corners[ends[k] : ends[k + 1]])
        least = min(least, gap)
        if gap <= touch_m:
            touched[owners[k]] = True
    return least


@compiled
def _distance(a: Floats, b: Floats) -> float:
    if _contains(a, b[0, 0], b[0, 1]) or _contains(b, a[0, 0], a[0, 1]):
        return 0.0
    least = np.inf
    for i in range(len(a)):
        p, q = a[i], a[(i + 1) % len(a)]
        for j in range(len(b)):
            r, s = b[j], b[(j + 1) % len(b)]
            if _cross(p, q, r, s):
                return 0.0
            least = min(least, _distance_to_edge(p, r, s), _distance_to_edge(r, p, q))
    return least


@nested
def _contains(polygon: Floats, x: float, y: float) -> bool:
    """Return whether a point lies inside, by the parity of the edges to its right."""
    inside = False
    for i in range(len(polygon)):
        x0, y0 = polygon[i - 1]
        x1, y1 = polygon[i]
        if (y0 > y) != (y1 > y) and x < (x1 - x0) * (y - y0) / (y1 - y0) + x0:
            inside = not inside
    return inside


@nested
def _cross(p: Floats, q: Floats, r: Floats, s: Floats) -> bool:
    """Return whether the edges pq and rs cross; a mere touch has distance 0 anyway."""
    return _side(p, q, r) * _side(p, q, s) < 0 and _side(r, s, p) * _side(r, s, q) < 0


@nested
def _side(p: Floats, q: Floats, r: Floats) -> float:
    return float((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))


@nested
def _distance_to_edge(p: Floats, r: Floats, s: Floats) -> float:
    dx, dy = s[0] - r[0], s[1] - r[1]
    length = dx * dx + dy * dy
    share = (
        0.0
        if length == 0
        else min(1.0, max(0.0, ((p[0] - r[0]) * dx + (p[1] - r[1]) * dy) / length))
    )
    return math.hypot(p[0] - r[0] - share * dx, p[1] - r[1] - share * dy)
