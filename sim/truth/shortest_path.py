"""The shortest way that a disc can take among polygons, in the plane and not on a grid: what a
driven way is measured by.

A shortest way touches only corners of the obstacles, grown by the disc's radius; between two of
them it is straight. A* over these corners finds it; which corner sees which is asked only where the
search comes. Arcs are polygons of chords, which makes the way shorter by at most half a percent of
the radius a corner.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt
import shapely

from navcore.grid.grid import GridSpec
from sim.models.solids import Polygon

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Spot = tuple[float, float]

ARC = 8
"""Chords of a quarter circle."""
SLACK_M = 1e-3
"""Lines of sight may cut so deep into a grown obstacle: those along its side do, by rounding."""
RELIEF_M = 0.6
"""A start may be so far inside a grown obstacle."""
BIN_M = 1.0
"""Side of the squares by which sides of obstacles are found."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VisibilityGraph:
    """Obstacles, grown, as the search needs them."""

    obstacles: shapely.Geometry
    """Their union."""
    corners: Floats
    """(N, 2) where a shortest way may turn."""
    beside: Floats
    """(N, 4) the corners before and after each of them."""
    sides: Floats
    """(M, 4) of the obstacles, shrunk by the slack: what blocks sight."""
    starts: Ints
    """(bins + 1,) where the sides in each bin begin in `listed`."""
    listed: Ints
    """Numbers of the sides, bin by bin; row by row from the lower left."""
    bins: tuple[int, int]
    """Rows and columns of bins."""
    origin: Spot
    """Lower left corner of the bins."""

    @staticmethod
    def of(polygons: Sequence[Polygon], radius_m: float) -> VisibilityGraph:
        """What is left to a disc of this radius among polygons in metres."""
        grown = shapely.union_all(
            shapely.buffer(
                [shapely.Polygon(polygon) for polygon in polygons], radius_m, quad_segs=ARC
            )
        )
        corners, beside = _corners(grown)
        sides = _sides(shapely.buffer(grown, -SLACK_M, join_style="mitre"))
        low = sides.reshape(-1, 2).min(axis=0, initial=0.0) - BIN_M
        cols, rows = (
            int(n)
            for n in np.ceil((sides.reshape(-1, 2).max(axis=0, initial=0.0) - low) / BIN_M) + 1
        )
        starts, listed = _sorted_into_bins(sides, low, rows, cols)
        return VisibilityGraph(
            obstacles=grown,
            corners=corners,
            beside=beside,
            sides=sides,
            starts=starts,
            listed=listed,
            bins=(rows, cols),
            origin=(float(low[0]), float(low[1])),
        )

    def way(self, start: Spot, goal: Spot) -> Floats | None:
        """(K, 2) the corners of the shortest way from start to goal, both included; None when there
        is none."""
        if shapely.intersects_xy(self.obstacles, *start) or shapely.intersects_xy(
            self.obstacles, *goal
        ):
            return None
        places = np.vstack([self.corners, goal, start])
        last = len(places) - 2
        to_goal = np.hypot(*(places - goal).T)
        length, before = np.full(len(places), np.inf), np.full(len(places), -1)
        length[last + 1], done = 0.0, np.zeros(len(places), dtype=np.bool_)
        queue = [(float(to_goal[-1]), last + 1)]
        while queue:
            _, here = heapq.heappop(queue)
            if done[here]:
                continue
            done[here] = True
            if here == last:
                return _traced(places, before, last)
            reached = _relax(
                here,
                places,
                self.beside,
                self.sides,
                self.starts,
                self.listed,
                *self.bins,
                *self.origin,
                done,
                length,
                before,
            )
            for there in reached:
                heapq.heappush(queue, (float(length[there] + to_goal[there]), int(there)))
        return None

    def nearest_free(self, spot: Spot, within_m: float) -> Spot | None:
        """The nearest spot at which the disc has room, itself if it has; None when there is none
        within this distance."""
        if not shapely.intersects_xy(self.obstacles, *spot):
            return spot
        edge = shapely.get_coordinates(
            shapely.shortest_line(shapely.boundary(self.obstacles), shapely.Point(spot))
        )[0]
        away_m = math.dist(edge, spot)
        if away_m > within_m:
            return None
        # A hair beyond the edge, or rounding may put it inside.
        out = (edge - spot) * (1 + 1e-6 / max(away_m, 1e-9)) + spot
        return float(out[0]), float(out[1])


def shortest_way(
    polygons: Sequence[Polygon], radius_m: float, spec: GridSpec, stations: Sequence[Spot]
) -> Floats | None:
    """(K, 2) the shortest way of a disc through all stations in order, on the map and among
    polygons; None without one.

    A first station nearer to a polygon than the radius is left by the nearest way out, if it is not
    far.
    """
    around = VisibilityGraph.of([*polygons, *_frame(spec, radius_m)], radius_m)
    start = around.nearest_free(stations[0], RELIEF_M)
    if start is None:
        return None
    legs, here = [np.array([stations[0]], dtype=np.float64)], start
    for goal in stations[1:]:
        leg = around.way(here, goal)
        if leg is None:
            return None
        legs.append(leg)
        here = goal
    return np.vstack(legs)


def length_m(way: Floats) -> float:
    """Of (K, 2) corners."""
    return float(np.hypot(*np.diff(way, axis=0).T).sum())


def _frame(spec: GridSpec, radius_m: float) -> list[Polygon]:
    """Polygons that, grown, lie about the map."""
    left, bottom = spec.origin_x_m, spec.origin_y_m
    right, top = left + spec.cols * spec.resolution_m, bottom + spec.rows * spec.resolution_m
    out = radius_m + BIN_M
    strips = [
        shapely.box(left - out, bottom - out, left - radius_m, top + out),
        shapely.box(right + radius_m, bottom - out, right + out, top + out),
        shapely.box(left - out, bottom - out, right + out, bottom - radius_m),
        shapely.box(left - out, top + radius_m, right + out, top + out),
    ]
    return [shapely.get_coordinates(strip)[:-1] for strip in strips]


def _rings(area: shapely.Geometry) -> list[Floats]:
    """(N, 2) corners of each ring, the obstacle to the left, the first not repeated."""
    turned = shapely.orient_polygons(shapely.get_parts(area))
    return [shapely.get_coordinates(ring)[:-1] for ring in shapely.get_rings(turned)]


def _corners(area: shapely.Geometry) -> tuple[Floats, Floats]:
    """Where the outline bends towards the obstacle, and the corners before and after."""
    rings = _rings(area)
    here = np.vstack([np.empty((0, 2)), *rings])
    before = np.vstack([np.empty((0, 2)), *(np.roll(ring, 1, axis=0) for ring in rings)])
    after = np.vstack([np.empty((0, 2)), *(np.roll(ring, -1, axis=0) for ring in rings)])
    (ax, ay), (bx, by) = (here - before).T, (after - here).T
    turns = ax * by - ay * bx > 0
    return here[turns], np.hstack([before, after])[turns]


def _sides(area: shapely.Geometry) -> Floats:
    return np.vstack(
        [np.empty((0, 4)), *(np.hstack([ring, np.roll(ring, -1, axis=0)]) for ring in _rings(area))]
    )


def _sorted_into_bins(sides: Floats, low: Floats, rows: int, cols: int) -> tuple[Ints, Ints]:
    """Each side into every bin that its bounding box touches."""
    first = np.floor((np.minimum(sides[:, :2], sides[:, 2:]) - low) / BIN_M).astype(np.int64)
    last = np.floor((np.maximum(sides[:, :2], sides[:, 2:]) - low) / BIN_M).astype(np.int64)
    bins, numbers = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    for number, ((left, bottom), (right, top)) in enumerate(zip(first, last, strict=True)):
        touched = (np.arange(bottom, top + 1)[:, None] * cols + np.arange(left, right + 1)).ravel()
        bins.append(touched)
        numbers.append(np.full(len(touched), number))
    flat, listed = np.concatenate(bins), np.concatenate(numbers)
    order = np.argsort(flat, kind="stable")
    return np.concatenate([[0], np.cumsum(np.bincount(flat, minlength=rows * cols))]), listed[order]


def _traced(places: Floats, before: npt.NDArray[np.int64], last: int) -> Floats:
    way = [last]
    while before[way[-1]] >= 0:
        way.append(int(before[way[-1]]))
    return places[way[::-1]]


@numba.njit(cache=True, nogil=True)
def _relax(
    here: int,
    places: Floats,
    beside: Floats,
    sides: Floats,
    starts: Ints,
    listed: Ints,
    rows: int,
    cols: int,
    low_x: float,
    low_y: float,
    done: npt.NDArray[np.bool_],
    length: Floats,
    before: Ints,
) -> Ints:
    """The places that are reached by a shorter way through `here`; notes that way."""
    reached, count = np.empty(len(places), np.int64), 0
    for there in range(len(places)):
        if done[there]:
            continue
        new = length[here] + math.hypot(
            places[there, 0] - places[here, 0], places[there, 1] - places[here, 1]
        )
        if new >= length[there]:
            continue
        if not (
            _is_tangent(here, there, places, beside) and _is_tangent(there, here, places, beside)
        ):
            continue
        a, b = (here, there) if places[here, 1] <= places[there, 1] else (there, here)
        line = (places[a, 0], places[a, 1], places[b, 0], places[b, 1])
        if _sees(line, sides, starts, listed, rows, cols, low_x, low_y):
            length[there], before[there] = new, here
            reached[count] = there
            count += 1
    return reached[:count]


@numba.njit(cache=True, nogil=True)
def _is_tangent(at: int, other: int, places: Floats, beside: Floats) -> bool:
    """Whether the line between two places leaves the obstacle of `at` on one side; start and goal
    have no obstacle."""
    if at >= len(beside):
        return True
    dx, dy = places[other, 0] - places[at, 0], places[other, 1] - places[at, 1]
    a = dx * (beside[at, 1] - places[at, 1]) - dy * (beside[at, 0] - places[at, 0])
    b = dx * (beside[at, 3] - places[at, 1]) - dy * (beside[at, 2] - places[at, 0])
    return bool(a * b >= -1e-9)


@numba.njit(cache=True, nogil=True)
def _sees(
    line: tuple[float, float, float, float],
    sides: Floats,
    starts: Ints,
    listed: Ints,
    rows: int,
    cols: int,
    low_x: float,
    low_y: float,
) -> bool:
    """Whether no side crosses the line, given upwards: looked up bin row by bin row, in the columns
    that it passes there."""
    x, y, dx, dy = line[0], line[1], line[2] - line[0], line[3] - line[1]
    first = max(0, math.floor((y - low_y) / BIN_M))
    last = min(rows - 1, math.floor((line[3] - low_y) / BIN_M))
    for row in range(first, last + 1):
        from_x, to_x = x, x + dx
        if first < last:
            from_x = x + dx * max(0.0, (low_y + row * BIN_M - y) / dy)
            to_x = x + dx * min(1.0, (low_y + (row + 1) * BIN_M - y) / dy)
        left = max(0, math.floor((min(from_x, to_x) - low_x - 1e-9) / BIN_M))
        right = min(cols - 1, math.floor((max(from_x, to_x) - low_x + 1e-9) / BIN_M))
        for col in range(left, right + 1):
            for k in range(starts[row * cols + col], starts[row * cols + col + 1]):
                side = listed[k]
                if _crosses(
                    x, y, dx, dy, sides[side, 0], sides[side, 1], sides[side, 2], sides[side, 3]
                ):
                    return False
    return True


@numba.njit(cache=True, nogil=True)
def _crosses(
    x: float, y: float, dx: float, dy: float, ax: float, ay: float, bx: float, by: float
) -> bool:
    """Whether the line from (x, y) by (dx, dy) and the one from a to b have a point in common."""
    a, b = dx * (ay - y) - dy * (ax - x), dx * (by - y) - dy * (bx - x)
    if a * b > 0:
        return False
    ex, ey = bx - ax, by - ay
    c, d = ex * (y - ay) - ey * (x - ax), ex * (y + dy - ay) - ey * (x + dx - ax)
    return bool(c * d <= 0 and (a != b or c != d))
