"""Growth of zones by the uncertainty of the robot's position.

A zone is added to an ellipse (Minkowski sum), so that a robot which keeps out of the grown zone by
its estimate keeps out of the zone itself with the probability that the ellipse covers. A
stay-inside zone is shrunk by the ellipse instead: what it forbids lies outside.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import LinearRing, MultiPolygon, Polygon

from navcore.geometry.arrays import Floats, Indices
from navcore.geometry.polyline import Corners
from navcore.geometry.transform import Matrix
from navcore.mission.zone import Zone

_ARC_SEGMENTS = 4
"""Segments of a quarter of the ellipse."""
_RADIUS = 1.0 / math.cos(1.5 * math.pi / (4 * _ARC_SEGMENTS))
"""Radius with which an arc drawn by its chords lies around the unit disc, and not within it. GEOS
rounds the number of chords, so that one may be half as long again."""
_LEAST_M = 1e-3
"""Smallest half axis of an ellipse in metres, so that it can be inverted."""
_STEP_M2 = 1e-4
"""Step of the covariances that zones are grown by, square metres."""


def spread_of(covariance: Matrix, sigmas: float) -> Matrix:
    """Return the symmetric (2, 2) matrix that maps the unit disc onto the ellipse of `sigmas`
    standard deviations of a (2, 2) or larger covariance, x and y first, in metres."""
    variances, axes = np.linalg.eigh(covariance[:2, :2])
    half_axes = sigmas * np.sqrt(np.maximum(variances, 0.0))
    return np.asarray((axes * half_axes) @ axes.T)


def largest_axis_m(spread: Matrix) -> float:
    """Return the larger half axis in metres of the ellipse of `spread_of`."""
    return float(np.linalg.eigvalsh(spread)[-1])


def beyond_margin(spread: Matrix, margin_m: float) -> Matrix:
    """Return the part of the ellipse of `spread_of` that has to be added where a margin in metres
    is kept besides.

    The margin is for errors of map and control, which do not depend on those of the position, so
    both add up by their squares: with half axes of √(s² + a²) − s, the margin s and this part keep
    at least √(s² + a²) in a direction in which the ellipse asks for a.
    """
    half_axes, axes = np.linalg.eigh(spread)
    return np.asarray((axes * (np.hypot(half_axes, margin_m) - margin_m)) @ axes.T)


def grown_outlines(corners: Corners, spread: Matrix) -> tuple[Corners, ...]:
    """Return the outline of a polygon plus the ellipse of `spread_of`, which contains the exact
    sum, and those of the holes that the growth leaves."""
    to_disc, from_disc = _scales(spread)
    disc = Polygon(np.asarray(corners) @ to_disc).buffer(_RADIUS, quad_segs=_ARC_SEGMENTS)
    return tuple(_corners(ring, from_disc) for ring in (disc.exterior, *disc.interiors))


def shrunk_outlines(corners: Corners, spread: Matrix) -> tuple[Corners, ...]:
    """Return the outlines of the parts that are left of a polygon where the ellipse of `spread_of`
    fits in, the largest first; where nothing is left, of a speck in which nothing else fits."""
    to_disc, from_disc = _scales(spread)
    disc = Polygon(np.asarray(corners) @ to_disc)
    parts = shapely.get_parts(disc.buffer(-_RADIUS, quad_segs=_ARC_SEGMENTS))
    left = sorted((part for part in parts if part.area > 0), key=lambda part: -part.area)
    left = left or [disc.representative_point().buffer(_LEAST_M, quad_segs=1)]
    return tuple(_corners(part.exterior, from_disc) for part in left)


def _corners(ring: LinearRing, from_disc: Matrix) -> Corners:
    outline = shapely.get_coordinates(ring)[:-1] @ from_disc
    return tuple((float(x), float(y)) for x, y in outline)


def _scales(spread: Matrix) -> tuple[Matrix, Matrix]:
    """Return the (2, 2) maps from metres to a frame in which the ellipse is the unit disc, and
    back."""
    half_axes, axes = np.linalg.eigh(spread)
    half_axes = np.maximum(half_axes, _LEAST_M)
    return (axes / half_axes) @ axes.T, (axes * half_axes) @ axes.T


def grow(zone: Zone, spread: Matrix) -> Zone:
    """Return the zone with what it forbids grown by the ellipse of `spread_of`."""
    outlines = shrunk_outlines if zone.forbids_outside else grown_outlines
    polygon, *further = outlines(zone.polygon, spread)
    return dataclasses.replace(zone, polygon=polygon, further=tuple(further))


def covering(covariance: Matrix) -> Matrix:
    """Return a (2, 2) covariance in steps, so that few polygons are made, whose ellipse contains
    that of a given one: the one by which the safety gate grows a zone, and the planner at least."""
    return np.asarray(np.ceil(covariance / _STEP_M2) * _STEP_M2 + _STEP_M2 * np.eye(2))


def most_growth_m(covariance: Matrix, sigmas: float) -> float:
    """Return an upper bound, without eigenvalues, of the growth in metres by `sigmas` standard
    deviations of `covering` of a (2, 2) covariance."""
    variance_m2 = float(covariance[0, 0]) + float(covariance[1, 1]) + 4 * _STEP_M2
    return sigmas * math.sqrt(max(variance_m2, 0.0))


@lru_cache(maxsize=256)
def polygon_of(corners: Corners, holes: tuple[Corners, ...] = ()) -> Polygon:
    """Return a polygon by its corners and those of its holes, prepared for many queries."""
    polygon = Polygon(corners, holes)
    shapely.prepare(polygon)
    return polygon


def area_of(zone: Zone) -> Polygon | MultiPolygon:
    """Return the area of a zone, prepared for many queries."""
    if zone.further and zone.forbids_outside:
        return _parts_of((zone.polygon, *zone.further))
    return polygon_of(zone.polygon, zone.further)


@lru_cache(maxsize=64)
def _parts_of(outlines: tuple[Corners, ...]) -> MultiPolygon:
    parts = MultiPolygon([Polygon(corners) for corners in outlines])
    shapely.prepare(parts)
    return parts


def distance_m(zone: Zone, shapes: npt.NDArray[np.object_]) -> Floats:
    """Return (N,) distances in metres of N shapes of the map frame from what a zone forbids, 0
    where they touch it."""
    area = area_of(zone)
    if not zone.forbids_outside:
        return np.asarray(shapely.distance(area, shapes))
    inside = shapely.covers(area, shapes)
    return np.where(inside, shapely.distance(area.boundary, shapes), 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class GrownZone:
    """A zone and the ellipse by which it is grown."""

    zone: Zone
    """The zone of the operator."""
    spread: Matrix
    """(2, 2) matrix of `spread_of`."""

    def relative_distance(self, outlines: Floats) -> Floats:
        """Return (N,) distances of (N, K, 2) outlines of the map frame; see `relative_distance`."""
        return relative_distance(self.zone, self.spread, outlines)

    @property
    def growth_m(self) -> float:
        """Largest growth in metres."""
        return largest_axis_m(self.spread)


def relative_distance(zone: Zone, spread: Matrix, outlines: Floats) -> Floats:
    """Return (N,) distances of (N, K, 2) outlines of the map frame from what a zone forbids, in
    units of the ellipse of `spread_of`: 1 where they touch the zone that is grown by it, 0 where
    they touch the zone itself."""
    to_disc, _ = _scales(spread)
    corners = (np.asarray(zone.polygon) @ to_disc).tolist()
    in_disc = dataclasses.replace(zone, polygon=tuple((x, y) for x, y in corners))
    return distance_m(in_disc, np.asarray(shapely.polygons(outlines @ to_disc)))


def kept_distances(now_m: Floats, asked_m: Floats, objects: Indices) -> Floats:
    """Return (N,) how far in metres a robot keeps from cells that are (N,) away now: as far as
    asked for, (N,).

    Of an object, by its (N,) numbers, that is nearer than asked for all cells are kept as far as
    the nearest such cell is, so that the robot may drive along it. Of what it touches it may cover
    no further cells: they are kept as far as they are, and those under it are not kept.
    """
    kept_m, infringed = np.minimum(now_m, asked_m), now_m < asked_m
    if not infringed.any():
        return kept_m
    _, which = np.unique(objects, return_inverse=True)
    nearest_m = np.full(int(which.max()) + 1, np.inf)
    np.minimum.at(nearest_m, which[infringed], now_m[infringed])
    least_m = nearest_m[which]
    kept_m = np.where(now_m < 0.0, -np.inf, kept_m)
    return np.where(least_m > 0.0, np.minimum(asked_m, least_m), kept_m)
