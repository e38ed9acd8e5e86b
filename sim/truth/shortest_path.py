"""The shortest path of a disc among polygons, in the plane and not on a grid: the reference for the
length of a driven path.

A shortest path touches only convex corners of the obstacles, grown by the radius of the disc, and
is straight between them. A* over the visibility graph of these corners finds it; visibility is
tested only for the corners that the search reaches. Arcs are polygons of chords, which shortens the
path by at most half a percent of the radius a corner.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from navcore.compiled import compiled, nested
from navcore.grid.grid import GridSpec
from sim.models.solids import Polygon

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Point = tuple[float, float]

CHORDS_PER_QUARTER = 8
"""Number of chords of a quarter circle."""
SLACK_M = 1e-3
"""Depth to which a line of sight may cut into a grown obstacle: lines along its side do, by
rounding."""
MAX_ESCAPE_M = 0.6
"""Largest depth of a start inside a grown obstacle."""
BIN_M = 1.0
"""Side of the square bins in which the sides of obstacles are looked up."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VisibilityGraph:
    """Grown obstacles and their corners."""

    obstacles: shapely.Geometry
    """Union of the grown obstacles."""
    corners: Floats
    """(N, 2) corners at which a shortest path may turn."""
    neighbours: Floats
    """(N, 4) the corners before and after each corner on its outline."""
    sides: Floats
    """(M, 4) sides of the obstacles, shrunk by the slack, which block sight."""
    starts: Ints
    """(bins + 1,) index in `binned` at which the sides of each bin begin."""
    binned: Ints
    """Numbers of the sides, bin by bin; row by row from the lower left."""
    bins: tuple[int, int]
    """Rows and columns of bins."""
    origin: Point
    """Lower left corner of the bins."""

    @staticmethod
    def of(polygons: Sequence[Polygon], radius_m: float) -> VisibilityGraph:
        """Return the graph of a disc of this radius among polygons in metres."""
        grown = shapely.union_all(
            shapely.buffer(
                [shapely.Polygon(polygon) for polygon in polygons],
                radius_m,
                quad_segs=CHORDS_PER_QUARTER,
            )
        )
        corners, neighbours = _convex_corners(grown)
        sides = _sides(shapely.buffer(grown, -SLACK_M, join_style="mitre"))
        low = sides.reshape(-1, 2).min(axis=0, initial=0.0) - BIN_M
        cols, rows = (
            int(n)
            for n in np.ceil((sides.reshape(-1, 2).max(axis=0, initial=0.0) - low) / BIN_M) + 1
        )
        starts, binned = _sorted_into_bins(sides, low, rows, cols)
        return VisibilityGraph(
            obstacles=grown,
            corners=corners,
            neighbours=neighbours,
            sides=sides,
            starts=starts,
            binned=binned,
            bins=(rows, cols),
            origin=(float(low[0]), float(low[1])),
        )

    def path(self, start: Point, goal: Point) -> Floats | None:
        """Return the (K, 2) corners of the shortest path from start to goal, both included; None
        when there is none."""
        if shapely.intersects_xy(self.obstacles, *start) or shapely.intersects_xy(
            self.obstacles, *goal
        ):
            return None
        nodes = np.vstack([self.corners, goal, start])
        last = len(nodes) - 2
        to_goal = np.hypot(*(nodes - goal).T)
        length, previous = np.full(len(nodes), np.inf), np.full(len(nodes), -1)
        length[last + 1], done = 0.0, np.zeros(len(nodes), dtype=np.bool_)
        queue = [(float(to_goal[-1]), last + 1)]
        while queue:
            _, here = heapq.heappop(queue)
            if done[here]:
                continue
            done[here] = True
            if here == last:
                return _trace_back(nodes, previous, last)
            reached = _relax(
                here,
                nodes,
                self.neighbours,
                self.sides,
                self.starts,
                self.binned,
                *self.bins,
                *self.origin,
                done,
                length,
                previous,
            )
            for there in reached:
                heapq.heappush(queue, (float(length[there] + to_goal[there]), int(there)))
        return None

    def nearest_free(self, point: Point, within_m: float) -> Point | None:
        """Return the nearest free position of the disc, which may be `point` itself; None when
        there is none within this distance."""
        if not shapely.intersects_xy(self.obstacles, *point):
            return point
        edge = shapely.get_coordinates(
            shapely.shortest_line(shapely.boundary(self.obstacles), shapely.Point(point))
        )[0]
        away_m = math.dist(edge, point)
        if away_m > within_m:
            return None
        # Slightly beyond the edge, or rounding may put it inside.
        out = (edge - point) * (1 + 1e-6 / max(away_m, 1e-9)) + point
        return float(out[0]), float(out[1])


def shortest_path(
    polygons: Sequence[Polygon], radius_m: float, spec: GridSpec, waypoints: Sequence[Point]
) -> Floats | None:
    """Return the (K, 2) shortest path of a disc through all waypoints in order, on the map and
    among polygons; None when there is none.

    A start that is nearer to a polygon than the radius is first moved to the nearest free position,
    if that is not far.
    """
    around = VisibilityGraph.of([*polygons, *_frame(spec, radius_m)], radius_m)
    start = around.nearest_free(waypoints[0], MAX_ESCAPE_M)
    if start is None:
        return None
    legs, here = [np.array([waypoints[0]], dtype=np.float64)], start
    for goal in waypoints[1:]:
        leg = around.path(here, goal)
        if leg is None:
            return None
        legs.append(leg)
        here = goal
    return np.vstack(legs)


def _frame(spec: GridSpec, radius_m: float) -> list[Polygon]:
    """Return polygons that, once grown, border the map."""
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
    """Return the (N, 2) corners of each ring, the obstacle to the left, the first not repeated."""
    turned = shapely.orient_polygons(shapely.get_parts(area))
    return [shapely.get_coordinates(ring)[:-1] for ring in shapely.get_rings(turned)]


def _convex_corners(area: shapely.Geometry) -> tuple[Floats, Floats]:
    """Return the corners at which the outline bends towards the obstacle, and the corners before
    and after each."""
    rings = _rings(area)
    here = np.vstack([np.empty((0, 2)), *rings])
    previous = np.vstack([np.empty((0, 2)), *(np.roll(ring, 1, axis=0) for ring in rings)])
    after = np.vstack([np.empty((0, 2)), *(np.roll(ring, -1, axis=0) for ring in rings)])
    (ax, ay), (bx, by) = (here - previous).T, (after - here).T
    turns = ax * by - ay * bx > 0
    return here[turns], np.hstack([previous, after])[turns]


def _sides(area: shapely.Geometry) -> Floats:
    return np.vstack(
        [np.empty((0, 4)), *(np.hstack([ring, np.roll(ring, -1, axis=0)]) for ring in _rings(area))]
    )


def _sorted_into_bins(sides: Floats, low: Floats, rows: int, cols: int) -> tuple[Ints, Ints]:
    """Sort each side into every bin that its bounding box touches."""
    first = np.floor((np.minimum(sides[:, :2], sides[:, 2:]) - low) / BIN_M).astype(np.int64)
    last = np.floor((np.maximum(sides[:, :2], sides[:, 2:]) - low) / BIN_M).astype(np.int64)
    bins, numbers = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    for number, ((left, bottom), (right, top)) in enumerate(zip(first, last, strict=True)):
        touched = (np.arange(bottom, top + 1)[:, None] * cols + np.arange(left, right + 1)).ravel()
        bins.append(touched)
        numbers.append(np.full(len(touched), number))
    flat, binned = np.concatenate(bins), np.concatenate(numbers)
    order = np.argsort(flat, kind="stable")
    return np.concatenate([[0], np.cumsum(np.bincount(flat, minlength=rows * cols))]), binned[order]


def _trace_back(nodes: Floats, previous: npt.NDArray[np.int64], last: int) -> Floats:
    path = [last]
    while previous[path[-1]] >= 0:
        path.append(int(previous[path[-1]]))
    return nodes[path[::-1]]


@compiled
def _relax(
    here: int,
    nodes: Floats,
    neighbours: Floats,
    sides: Floats,
    starts: Ints,
    binned: Ints,
    rows: int,
    cols: int,
    low_x: float,
    low_y: float,
    done: npt.NDArray[np.bool_],
    length: Floats,
    previous: Ints,
) -> Ints:
    """Return the nodes that are reached by a shorter path through `here`, and record that path."""
    reached, count = np.empty(len(nodes), np.int64), 0
    for there in range(len(nodes)):
        if done[there]:
            continue
        new = length[here] + math.hypot(
            nodes[there, 0] - nodes[here, 0], nodes[there, 1] - nodes[here, 1]
        )
        if new >= length[there]:
            continue
        if not (
            _is_tangent(here, there, nodes, neighbours)
            and _is_tangent(there, here, nodes, neighbours)
        ):
            continue
        a, b = (here, there) if nodes[here, 1] <= nodes[there, 1] else (there, here)
        line = (nodes[a, 0], nodes[a, 1], nodes[b, 0], nodes[b, 1])
        if _is_visible(line, sides, starts, binned, rows, cols, low_x, low_y):
            length[there], previous[there] = new, here
            reached[count] = there
            count += 1
    return reached[:count]


@nested
def _is_tangent(at: int, other: int, nodes: Floats, neighbours: Floats) -> bool:
    """Return whether the line between two nodes leaves the obstacle of `at` on one side; start and
    goal have no obstacle."""
    if at >= len(neighbours):
        return True
    dx, dy = nodes[other, 0] - nodes[at, 0], nodes[other, 1] - nodes[at, 1]
    a = dx * (neighbours[at, 1] - nodes[at, 1]) - dy * (neighbours[at, 0] - nodes[at, 0])
    b = dx * (neighbours[at, 3] - nodes[at, 1]) - dy * (neighbours[at, 2] - nodes[at, 0])
    return bool(a * b >= -1e-9)


@nested
def _is_visible(
    line: tuple[float, float, float, float],
    sides: Floats,
    starts: Ints,
    binned: Ints,
    rows: int,
    cols: int,
    low_x: float,
    low_y: float,
) -> bool:
    """Return whether no side crosses the line, whose end is not below its start: tested bin row by
    bin row, in the columns that it passes there."""
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
                side = binned[k]
                if _crosses(
                    x, y, dx, dy, sides[side, 0], sides[side, 1], sides[side, 2], sides[side, 3]
                ):
                    return False
    return True


@nested
def _crosses(
    x: float, y: float, dx: float, dy: float, ax: float, ay: float, bx: float, by: float
) -> bool:
    """Return whether the segment from (x, y) by (dx, dy) and the one from a to b share a point."""
    a, b = dx * (ay - y) - dy * (ax - x), dx * (by - y) - dy * (bx - x)
    if a * b > 0:
        return False
    ex, ey = bx - ax, by - ay
    c, d = ex * (y - ay) - ey * (x - ax), ex * (y + dy - ay) - ey * (x + dx - ax)
    return bool(c * d <= 0 and (a != b or c != d))
