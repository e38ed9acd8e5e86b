"""Loops: matches of a keyframe with what earlier ones showed, within odometry's uncertainty."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from navcore.config.localisation.localisation import MatchConfig
from navcore.config.localisation.pose_graph import LoopClosureConfig
from navcore.config.localisation.relocalisation import PlaceSearchConfig, RelocalisationConfig
from navcore.geometry.arrays import Floats, Indices
from navcore.geometry.transform import Matrix, Pose2
from navcore.localisation.graph.edges import Edge, in_own_axes
from navcore.localisation.graph.pose_graph import OptimisedGraph
from navcore.localisation.relocalisation.place_fit import PlaceFit
from navcore.localisation.relocalisation.place_map import PlaceMap, place_map_of
from navcore.localisation.relocalisation.place_search import SearchWindow, search_places
from navcore.localisation.relocalisation.submap import Submap, submap_of
from navcore.localisation.scans.matching import match
from navcore.localisation.scans.scan import Keyframe
from navcore.localisation.scans.scan_map import ScanMap

MATCH_SCALE = 0.1
"""Number of measurements that a point counts as between two keyframes."""
_REFINED = np.diag([0.02, 0.02, math.radians(0.1)]) ** 2
"""Covariance of a pose by matching two scans that no number of points makes smaller."""
_SEARCH = PlaceSearchConfig(levels=3, max_candidates=4, least_score=0.12, least_evidence=0.25)
"""Search within odometry's uncertainty, which leaves few places."""
LEAST_REACH_M = 0.3
"""Half the edge in metres of the smallest search window."""
LEAST_REACH_RAD = math.radians(4.0)
"""Half the range in radians of the smallest search window."""


class LoopFinder:
    """Matches keyframes with earlier ones at the present poses."""

    def __init__(
        self,
        keyframes: Sequence[Keyframe],
        graph: OptimisedGraph,
        config: LoopClosureConfig,
        match_config: MatchConfig,
    ) -> None:
        """`keyframes` are in the order of driving, `graph` has their present poses."""
        self._keyframes = keyframes
        self._graph = graph
        self._config = config
        self._poses = [graph.poses[keyframe.pose_id] for keyframe in keyframes]
        xy = np.array([(pose.x_m, pose.y_m) for pose in self._poses])
        yaw = np.array([pose.yaw_rad for pose in self._poses])
        steps = np.hypot(*np.diff(xy, axis=0).T)
        self._driven_m = np.concatenate([[0.0], np.cumsum(steps)])
        self._seen = xy + config.ahead_m * np.column_stack([np.cos(yaw), np.sin(yaw)])
        self._index = {keyframe.pose_id: i for i, keyframe in enumerate(keyframes)}
        self._place_maps: dict[int, PlaceMap] = {}
        self._near: dict[int, ScanMap] = {}
        self._match_config = match_config
        self._rules = RelocalisationConfig(search=_SEARCH)

    def loops_of(self, index: int) -> list[Edge]:
        """Return the edges from earlier keyframes to this one."""
        candidates = self._earlier(index)
        if not len(candidates):
            return []
        query = self._submap(index)
        matches = (self._match(other, index, query) for other in candidates.tolist())
        return [edge for edge in matches if edge is not None]

    def _earlier(self, index: int) -> Indices:
        """Return the earlier keyframes that may show the same, nearest first and apart from each
        other."""
        rules = self._config
        old = np.flatnonzero(self._driven_m <= self._driven_m[index] - rules.least_driven_m)
        away = np.hypot(*(self._seen[old] - self._seen[index]).T)
        near = away <= rules.overlap_m + rules.most_reach_m
        old, away = old[near], away[near]
        kept: list[int] = []
        for other in old[np.argsort(away, kind="stable")].tolist():
            if all(
                abs(self._driven_m[other] - self._driven_m[k]) > 2.0 * rules.submap_m for k in kept
            ):
                kept.append(other)
            if len(kept) == rules.per_keyframe:
                break
        return np.array(kept, dtype=np.int64)

    def _match(self, other: int, index: int, query: Submap) -> Edge | None:
        """Return the edge between two keyframes, or None if what they show does not match within
        odometry's uncertainty."""
        rules = self._config
        expected = self._poses[other].inverse() @ self._poses[index]
        ids = self._keyframes[other].pose_id, self._keyframes[index].pose_id
        covariance = self._graph.relative_covariance(*ids)
        reach_m = rules.sigmas * math.sqrt(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]))
        reach_rad = rules.sigmas * math.sqrt(float(covariance[2, 2]))
        away = float(np.hypot(*(self._seen[other] - self._seen[index])))
        if (
            reach_m > rules.most_reach_m
            or reach_rad > math.radians(rules.most_reach_deg)
            or away > rules.overlap_m + reach_m
        ):
            return None
        window = SearchWindow(
            T_map_base=expected,
            reach_m=max(reach_m, LEAST_REACH_M),
            reach_rad=max(reach_rad, LEAST_REACH_RAD),
        )
        place_map = self._place_map(other)
        places = search_places(query, place_map, self._rules, window)
        if not places or not self._is_clear(places, len(query)):
            return None
        pose, spread = self._refined(other, index, places[0])
        edge = Edge(
            from_id=ids[0],
            to_id=ids[1],
            T_from_to=pose,
            covariance=in_own_axes(pose, spread),
        )
        error = _vector(expected.inverse() @ pose)
        distance2 = error @ np.linalg.solve(covariance + edge.covariance, error)
        return edge if distance2 <= rules.sigmas**2 + 3.0 else None

    def _refined(self, other: int, index: int, place: PlaceFit) -> tuple[Pose2, Matrix]:
        """Return the pose of a keyframe in the frame of another and its (3, 3) covariance there, by
        its own scan alone: the surfaces around it were placed by odometry."""
        scan = self._keyframes[index].scan
        found = match(
            scan,
            self._surfaces(other),
            place.T_map_base,
            place.covariance,
            scale=MATCH_SCALE,
            search_m=self._match_config.fine_m,
            config=self._match_config,
        )
        least = max(self._config.least_fit_share * len(scan), self._match_config.min_points)
        if found.fitting < least:
            return place.T_map_base, place.covariance
        prior = np.linalg.inv(place.covariance)
        spread = np.linalg.inv(MATCH_SCALE * found.information + prior)
        return found.pose, np.asarray(spread) + _REFINED

    def _surfaces(self, index: int) -> ScanMap:
        """Return the surfaces seen shortly before and after a keyframe, in its frame."""
        if index not in self._near:
            pose, surfaces = self._poses[index], ScanMap(self._match_config)
            away = np.abs(self._driven_m - self._driven_m[index])
            surfaces.replace(
                replace(self._keyframes[i], T_map_base=pose.inverse() @ self._poses[i])
                for i in np.flatnonzero(away <= self._config.refined_m).tolist()
            )
            self._near[index] = surfaces
        return self._near[index]

    def _is_clear(self, places: list[PlaceFit], points: int) -> bool:
        """Return whether the best of some places, at which so many points were matched, is a loop
        as far as a match alone tells."""
        rules, best = self._config, places[0]
        return (
            best.fit_share >= rules.least_fit_share
            and best.fit_share * points >= rules.least_points
            and best.closeness >= rules.least_closeness
            and best.contradicted_share < rules.contradicted_share
            and best.through_walls_share < rules.through_walls_share
            and best.sigma_m <= rules.most_sigma_m
            and all(best.evidence >= place.evidence + rules.margin for place in places[1:])
        )

    def _around(self, index: int) -> list[int]:
        away = np.abs(self._driven_m - self._driven_m[index])
        return np.flatnonzero(away <= self._config.submap_m).tolist()

    def _submap(self, index: int) -> Submap:
        """Return the surfaces that were seen around a keyframe, in its frame."""
        views = [(self._poses[i], self._keyframes[i].scan) for i in self._around(index)]
        return submap_of(views, reference=self._poses[index])

    def _place_map(self, index: int) -> PlaceMap:
        """Return what was seen around a keyframe, prepared for the search."""
        if index not in self._place_maps:
            submap = self._submap(index)
            self._place_maps[index] = place_map_of(
                submap.points,
                submap.normals,
                self._rules.search,
                [
                    replace(
                        self._keyframes[i],
                        T_map_base=self._poses[index].inverse() @ self._poses[i],
                    )
                    for i in self._around(index)
                ],
            )
        return self._place_maps[index]

    def recent(self, loops: Sequence[Edge]) -> tuple[Edge, ...]:
        """Return the loops of keyframes with which later ones may agree."""
        least_m = self._driven_m[-1] - self._config.agree_driven_m
        return tuple(one for one in loops if self._driven_m[self._index[one.to_id]] >= least_m)

    def agreeing(self, loops: Sequence[Edge], believed: Sequence[Edge]) -> list[Edge]:
        """Return the loops that enough others, of other keyframes nearby, agree with, those that
        are `believed` already included.

        Those that agree match much the same scans and err alike: together they count as one, so
        the covariance of each is multiplied by their number.
        """
        rules = self._config
        kept = []
        for one in loops:
            others = (two for two in (*loops, *believed) if two is not one)
            friends = {two.to_id for two in others if self._agree(one, two)}
            count = len(friends - {one.to_id}) + 1
            if count >= rules.agreeing:
                kept.append(replace(one, covariance=count * one.covariance))
        return kept

    def _agree(self, one: Edge, two: Edge) -> bool:
        """Return whether the circle through two loops closes."""
        rules, place = self._config, self._index
        for a, b in ((one.from_id, two.from_id), (one.to_id, two.to_id)):
            if abs(self._driven_m[place[a]] - self._driven_m[place[b]]) > rules.agree_driven_m:
                return False
        poses = self._graph.poses
        old = poses[one.from_id].inverse() @ poses[two.from_id]
        new = poses[one.to_id].inverse() @ poses[two.to_id]
        gap = (old @ two.T_from_to).inverse() @ (one.T_from_to @ new)
        return math.hypot(gap.x_m, gap.y_m) <= rules.agree_m and abs(gap.yaw_rad) <= math.radians(
            rules.agree_deg
        )


def _vector(pose: Pose2) -> Floats:
    return np.array([pose.x_m, pose.y_m, pose.yaw_rad])
