"""Refinement of a place: the pose at which a submap fits a map best, and how well it does."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from navcore.config.localisation.relocalisation import PlaceFitConfig, RelocalisationConfig
from navcore.geometry.arrays import Bools, Floats, Points
from navcore.geometry.transform import Matrix, Pose2, wrap_angle
from navcore.localisation.relocalisation.place_map import PlaceMap
from navcore.localisation.relocalisation.submap import Submap
from navcore.localisation.relocalisation.walls import seen_through_walls
from navcore.localisation.scans.ambiguity import poses_beside, spread_to

NEIGHBOURS = 4
"""Nearest surfaces among which a point finds one that faces as it does."""
LEAST_COSINE = 0.5
"""Smallest cosine between the normals of a point and of its surface."""
EFFECTIVE_POINTS = 10.0
"""Number of independent measurements that the points of a submap are worth: neighbours err
alike."""
LEAST_VARIANCE = np.square([0.02, 0.02, math.radians(0.25)])
"""Variance of a refined pose in m², m², rad² that no number of points makes smaller."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaceFit:
    """How well a submap fits at a pose of the map."""

    T_map_base: Pose2
    """Refined pose."""
    covariance: Matrix
    """(3, 3) covariance of x and y along the map's axes in metres and yaw in radians; along a
    corridor without features it is large."""
    evidence: float
    """What speaks for the place less what speaks against it, the mean over the points, at most 1:
    places are ranked by it."""
    score: float
    """Mean likelihood of the points, 0 to 1."""
    fit_share: float
    """Share of the points that lie at a surface that faces as they do, 0 to 1."""
    through_walls_share: float
    """Share of the lines of sight that cross a surface of the map, 0 to 1."""
    contradicted_share: float
    """Share of the points that lie where the map has seen that nothing stands, 0 to 1."""

    @property
    def agreeing_share(self) -> float | None:
        """Share that fits of the points of which the map tells whether they do, 0 to 1; None
        without any. The others are new: the side of a wall that the map has not seen."""
        told = self.fit_share + self.contradicted_share
        return self.fit_share / told if told > 0.0 else None

    @property
    def sigma_m(self) -> float:
        """Standard deviation of the position along its least certain direction, metres."""
        return math.sqrt(float(np.linalg.eigvalsh(self.covariance[:2, :2])[-1]))

    @property
    def closeness(self) -> float:
        """Mean likelihood of the points that fit, 0 to 1: how near they are to their surfaces.

        Points of another room that has the shape of this one lie anywhere within the distance in
        which they count as fitting; those of this one are as near as the sensor measures.
        """
        return self.score / self.fit_share if self.fit_share > 0.0 else 0.0

    def contradiction(self, rules: RelocalisationConfig) -> str:
        """Return what of the map speaks against the place; "" for nothing."""
        if refutation := self.refutation(rules):
            return refutation
        if self.through_walls_share >= rules.through_walls_share:
            return f"{self.through_walls_share:.0%} of the lines of sight cross walls of the map"
        return ""

    def refutation(self, rules: RelocalisationConfig) -> str:
        """Return what of the map refutes a place that is believed; "" for nothing. Lines of sight
        across surfaces do not by their share alone: they cross a table that the map has seen from
        another side."""
        if self.contradicted_share >= rules.contradicted_share:
            return f"{self.contradicted_share:.0%} of what is seen stands where the map is clear"
        if self.evidence < rules.least_evidence:
            return (
                f"{self.contradicted_share:.0%} of what is seen stands where the map is clear, and "
                f"{self.through_walls_share:.0%} of the lines of sight cross walls of the map"
            )
        return ""


def doubt_of(places: Sequence[PlaceFit], rules: RelocalisationConfig) -> str:
    """Return why the best of some places, best first, is not to be believed; "" if nothing speaks
    against it."""
    if not places:
        return "no place of the map fits what has been seen; drive on or turn round"
    best = places[0]
    if best.fit_share < rules.least_fit_share:
        return f"only {best.fit_share:.0%} of what is seen fits at the best place"
    if contradiction := best.contradiction(rules):
        return contradiction
    alike = 1 + len(rivals_of(best, places[1:], rules))
    return f"{alike} places fit alike; drive on until something differs" if alike > 1 else ""


def is_same_place(one: Pose2, two: Pose2, rules: RelocalisationConfig) -> bool:
    """Return whether two poses in the map are the same place."""
    turn = abs(wrap_angle(one.yaw_rad - two.yaw_rad))
    return one.distance_to(two.x_m, two.y_m) < rules.same_m and turn < math.radians(rules.same_deg)


def elsewhere(
    places: Sequence[PlaceFit], here: Pose2, rules: RelocalisationConfig
) -> list[PlaceFit]:
    """Return those of some places that are not where a pose in the map is."""
    return [one for one in places if not is_same_place(one.T_map_base, here, rules)]


def is_clearly_better(one: PlaceFit, other: PlaceFit, rules: RelocalisationConfig) -> bool:
    """Return whether more than a little more speaks for one place than for another."""
    return one.evidence - rules.margin >= other.evidence


def rivals_of(
    best: PlaceFit,
    others: Sequence[PlaceFit],
    rules: RelocalisationConfig,
    margin: float | None = None,
) -> list[PlaceFit]:
    """Return those of other places that fit nearly as well, and that nothing of the map speaks
    against; `margin` is the evidence in which they lack more, by default that of the rules."""
    least = best.evidence - (rules.margin if margin is None else margin)
    return [one for one in others if one.evidence > least and not one.contradiction(rules)]


def fit_place(submap: Submap, near: Pose2, place_map: PlaceMap, config: PlaceFitConfig) -> PlaceFit:
    """Return the best pose of a submap near a first guess of T_map_base."""
    pose = near
    if not len(submap) or not len(place_map.surfaces):
        return evaluate_place(submap, near, place_map, config)
    hessian = np.zeros((3, 3))
    for step in range(config.steps):
        gate = max(config.wide_m * 0.7**step, config.narrow_m)
        hessian, gradient = _normal_equations(submap, pose, place_map, gate, config)
        change = np.linalg.solve(hessian + np.diag([1e-3, 1e-3, 1e-3]), -gradient)
        pose = Pose2(
            x_m=pose.x_m + float(change[0]),
            y_m=pose.y_m + float(change[1]),
            yaw_rad=wrap_angle(pose.yaw_rad + float(change[2])),
        )
        if gate == config.narrow_m and float(np.abs(change).max()) < 1e-4:
            break
    return evaluate_place(submap, pose, place_map, config, hessian)


def fit_beside(
    submap: Submap,
    fit: PlaceFit,
    place_map: PlaceMap,
    config: RelocalisationConfig,
    is_cancelled: Callable[[], bool] = lambda: False,
) -> PlaceFit:
    """Return the best of a fit and of those that begin beside it, with a covariance that spans all
    that fit nearly as well; of no use once `is_cancelled`, which ends it early."""
    fits = [fit]
    for one in poses_beside(fit.T_map_base, fit.covariance):
        if is_cancelled():
            break
        fits.append(fit_place(submap, one, place_map, config.fit))
    best = max(fits, key=lambda one: one.evidence)
    alike = [
        one.T_map_base
        for one in fits
        if one.evidence >= best.evidence - config.beside_margin
        and is_same_place(one.T_map_base, best.T_map_base, config)
    ]
    return replace(best, covariance=best.covariance + spread_to(best.T_map_base, alike))


def evaluate_place(
    submap: Submap,
    pose: Pose2,
    place_map: PlaceMap,
    config: PlaceFitConfig,
    hessian: Matrix | None = None,
) -> PlaceFit:
    """Return how well a submap fits at T_map_base, without moving it: not at all where nothing is
    seen, or nothing is on the map."""
    if not len(submap) or not len(place_map.surfaces):
        return PlaceFit(
            T_map_base=pose,
            covariance=np.diag(LEAST_VARIANCE) + np.eye(3) * 1e6,
            evidence=0.0,
            score=0.0,
            fit_share=0.0,
            through_walls_share=0.0,
            contradicted_share=0.0,
        )
    if hessian is None:
        hessian, _ = _normal_equations(submap, pose, place_map, config.narrow_m, config)
    points, distances, _, found = _associate(submap, pose, place_map, config.narrow_m)
    likelihood = np.exp(-0.5 * np.square(distances / config.sigma_m))
    rays = seen_through_walls(
        place_map.walls,
        place_map.lattice,
        pose.to_parent(submap.origins),
        points,
        config.ray_start_m,
        config.ray_end_m,
    )
    effective = hessian * (EFFECTIVE_POINTS / max(len(submap), EFFECTIVE_POINTS))
    weak = np.linalg.inv(effective / config.sigma_m**2 + np.diag([1e-2, 1e-2, 1e-2]))
    score, fit_share = float(np.where(found, likelihood, 0.0).mean()), float(found.mean())
    through_walls_share = rays / len(submap)
    contradicted_share = float((place_map.is_clear(points) & ~found).mean())
    return PlaceFit(
        T_map_base=pose,
        covariance=np.asarray(weak) + np.diag(LEAST_VARIANCE),
        evidence=score
        + config.unknown_worth * (1.0 - fit_share - contradicted_share)
        - config.contradicted_cost * contradicted_share
        - config.walls_cost * through_walls_share,
        score=score,
        fit_share=fit_share,
        through_walls_share=through_walls_share,
        contradicted_share=contradicted_share,
    )


def _associate(
    submap: Submap, pose: Pose2, place_map: PlaceMap, gate_m: float
) -> tuple[Points, Floats, Floats, Bools]:
    """Return the (N, 2) points in the map, their signed distances (N,) to the nearest surface that
    faces alike, the (N, 2) unit directions of these distances, and (N,) whether one was found.

    The distance is across the surface where it has a normal, else to its position.
    """
    turn = Pose2(x_m=0.0, y_m=0.0, yaw_rad=pose.yaw_rad)
    points, normals = pose.to_parent(submap.points), turn.to_parent(submap.normals)
    count = min(NEIGHBOURS, len(place_map.surfaces))
    away, index = place_map.tree.query(points, k=range(1, count + 1), distance_upper_bound=gate_m)
    within = np.isfinite(away)
    index = np.where(within, index, 0)
    theirs = place_map.normals[index]
    known = _is_known(theirs) & _is_known(normals)[:, None]
    alike = np.einsum("nkj,nj->nk", theirs, normals) >= LEAST_COSINE
    usable = within & (alike | ~known)
    best = np.where(usable.any(axis=1), usable.argmax(axis=1), 0)
    rows = np.arange(len(points))
    found = usable[rows, best]
    delta = points - place_map.surfaces[index[rows, best]]
    normal = place_map.lines[index[rows, best]]
    away_best = np.where(found, away[rows, best], 1.0)
    flat = _is_known(normal)
    direction = np.where(
        flat[:, None], normal, delta / np.maximum(np.abs(away_best), 1e-9)[:, None]
    )
    distance = np.where(flat, np.einsum("nj,nj->n", delta, normal), away_best)
    return points, np.where(found, distance, gate_m), direction, found


def _is_known(normals: Points) -> Bools:
    """Return which normals are not (0, 0)."""
    return np.asarray((normals != 0.0).any(axis=-1))


def _normal_equations(
    submap: Submap, pose: Pose2, place_map: PlaceMap, gate_m: float, config: PlaceFitConfig
) -> tuple[Matrix, Floats]:
    """Return the (3, 3) Hessian and the (3,) gradient of half the squared distances."""
    points, distances, directions, found = _associate(submap, pose, place_map, gate_m)
    arm = points - np.array([pose.x_m, pose.y_m])
    jacobian = np.column_stack(
        [directions, directions[:, 1] * arm[:, 0] - directions[:, 0] * arm[:, 1]]
    )[found]
    scale = max(gate_m / 3.0, config.sigma_m)
    weights = 1.0 / (1.0 + np.square(distances[found] / scale))
    weighted = jacobian * weights[:, None]
    return np.asarray(weighted.T @ jacobian), np.asarray(weighted.T @ distances[found])
