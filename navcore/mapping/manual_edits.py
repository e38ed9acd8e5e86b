"""What an operator changes on the map by hand: what is erased, rejected, or of another colour rule.

What was erased or rejected is a value that can be put back.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

import numpy as np

from navcore.config.mapping import MappingConfig
from navcore.geometry.arrays import Bools, Indices, Points
from navcore.geometry.transform import Pose2
from navcore.grid.growth import Growth
from navcore.mapping.explored.visibility import VisibilityMap
from navcore.mapping.placed_points import PlacedPoints
from navcore.mapping.points.coloured import PastView, is_taken
from navcore.mapping.points.erasing import Erased, ErasedArea, put_back, take
from navcore.mapping.points.people_points import class_set
from navcore.mapping.points.placing import base_points, place, pose_rows
from navcore.mapping.points.point_links import Records
from navcore.mapping.points.point_queries import points_in
from navcore.mapping.points.rejections import Rejection, Rejections
from navcore.mapping.terrain.terrain_map import TerrainMap
from navcore.mapping.views.observation import Observation
from navcore.mission.beware_list import NOTHING, ColourRule

MOST_ERASED_AREAS = 50
"""Largest number of erased areas that are remembered, until the frames before them are gone."""


class ManualEdits:
    """The changes by hand of one map."""

    def __init__(
        self,
        placed: PlacedPoints,
        explored: VisibilityMap,
        terrain: TerrainMap,
        rejections: Rejections,
        rules: MappingConfig,
    ) -> None:
        self._placed, self._explored, self._terrain = placed, explored, terrain
        self._rejections, self._rules = rejections, rules
        self.erased_areas: tuple[ErasedArea, ...] = ()
        """What was erased, so that images of before do not bring it back."""
        self.erasures = 0
        """Number of the newest erasure of points of the beware list."""
        self.count = 0
        """Number of changes."""
        self.by_operator = 0
        """Number of those that an operator has made looking at the map: erasures, rejections, and
        such as were taken back. Another colour rule is none."""

    def erase(self, cells: Indices, class_ids: Iterable[int]) -> Erased:
        """Remove the points of some classes in (N,) cells, row · cols + col, and with `NOTHING` the
        prior map and what is known of the ground, and return it; what the camera sees there later
        comes back. Raises `ValueError` for a cell that is not on the grid."""
        spec, table = self._placed.spec, self._placed.table
        cells = np.unique(cells).astype(np.int64)
        if len(cells) and not 0 <= cells[0] <= cells[-1] < spec.rows * spec.cols:
            raise ValueError(f"cells {cells[0]} to {cells[-1]} are not all on the grid of the map")
        kinds = class_set(class_ids)
        self.by_operator += 1
        taken = take(table, points_in(table.first, table.records, cells, kinds))
        is_area = bool(kinds[NOTHING + 1 :].any())
        if is_area:
            self.erasures += 1
            area = ErasedArea(number=self.erasures, cells=cells, kinds=kinds)
            self.erased_areas = (*self.erased_areas, area)[-MOST_ERASED_AREAS:]
        prior, beyond, ground = cells[:0], cells[:0], None
        if kinds[NOTHING]:
            prior, beyond = self._placed.layers.erase_prior(cells), self._beyond_limits(cells)
            ground = self._terrain.erase(self._centres(cells))
        self._changed_by_hand(cells, prior)
        return Erased(
            records=taken,
            prior_xy=self._centres(prior),
            cells=len(np.union1d(np.union1d(taken["cell"], prior), beyond)),
            number=self.erasures,
            is_area=is_area,
            ground=ground,
        )

    def _centres(self, cells: Indices) -> Points:
        spec = self._placed.spec
        return spec.centres(np.column_stack(np.divmod(cells, spec.cols)))

    def _beyond_limits(self, cells: Indices) -> Indices:
        """Return those of (N,) cells whose ground is beyond the robot's limits."""
        return cells[self._terrain.bools.ravel()[cells]]

    def put_back(self, erased: Erased) -> None:
        """Put back what `erase` or `forget_coloured` has removed from this map, with the poses from
        which it was seen; what the camera has seen there since stays as it is, and what was erased
        since stays away."""
        taken, spec = erased.records.copy(), self._placed.spec
        place(taken, taken["pose_id"], self._placed.rows, spec)
        self.by_operator += erased.is_area or erased.ground is not None
        if erased.is_area:
            areas = (area for area in self.erased_areas if area.number != erased.number)
            self.erased_areas = tuple(areas)
        taken = self._not_erased_since(erased.number, taken)
        put_back(self._placed.table, taken)
        at = (spec.cell(x, y) for x, y in erased.prior_xy)
        prior = np.array([row * spec.cols + col for row, col in at], dtype=np.int64)
        self._placed.layers.put_back_prior(prior, self._explored.has_floor(prior))
        if erased.ground is not None:
            self._terrain.put_back(erased.ground)
        cells = taken["cell"][taken["cell"] >= 0].astype(np.int64)
        self._changed_by_hand(np.union1d(cells, prior), prior)
        self._placed.keep_to_budget()

    def reject(self, class_id: int, points: Points, confidence: float) -> tuple[Rejection, Erased]:
        """Remove the points of a class around (N, 2) positions in metres, and remember that it
        takes better evidence there than looks with this confidence.

        Returns what was removed and the rejection, which moves with the pose that saw most of the
        points, or the nearest one. Raises `ValueError` on a map without a pose, and for too many.
        """
        if not len(self._placed.pose_ids) or not len(points):
            raise ValueError("a rejection needs positions, and a map with a pose")
        self._rejections.check_room(len(points))
        erased = self.erase(self._rejections.cells_around(points, self._placed.spec), [class_id])
        rows, (x_m, y_m) = self._placed.rows, points.mean(axis=0)
        seen_from = np.bincount(erased.records["pose_id"], minlength=len(rows))
        distances = np.hypot(rows[:, 0] - x_m, rows[:, 1] - y_m)
        pose_id = int(seen_from.argmax() if seen_from.any() else distances.argmin())
        rejection = Rejection(
            id=0,
            class_id=class_id,
            confidence=confidence,
            pose_id=pose_id,
            points_base=self._placed.pose_ids[pose_id].from_parent(points).astype(np.float32),
        )
        return self._rejections.add(rejection, rows, self._placed.spec), erased

    def restore_rejection(self, rejection: Rejection) -> None:
        """Remember a rejection again that was taken back."""
        self._placed.version += 1
        self.count += 1
        self.by_operator += 1
        self._rejections.add(rejection, self._placed.rows, self._placed.spec)

    def take_back(self, rejection_id: int) -> Rejection | None:
        """Forget a rejection and return it; None for an unknown number."""
        self._placed.version += 1
        self.count += 1
        self.by_operator += 1
        return self._rejections.remove(rejection_id, self._placed.rows, self._placed.spec)

    @property
    def beware_points(self) -> Records:
        """Copy of the points of the beware list's classes."""
        live = self._placed.table.live
        return np.asarray(live[live["class_id"] != NOTHING])

    def forget_coloured(
        self, class_id: int, rule: ColourRule | None, before: ColourRule | None, past: PastView
    ) -> Erased:
        """Remove and return the points of a class that its colour rule has found and that its new
        rule does not take; `before` is the rule until now, `rule` None for no rule any more."""
        live = self._placed.table.live
        indices = np.flatnonzero((live["class_id"] == class_id) & (live["confidence"] >= 1))
        gone = indices[~self.is_taken(live[indices], rule, before, past)]
        taken = take(self._placed.table, gone)
        cells = np.unique(taken["cell"][taken["cell"] >= 0]).astype(np.int64)
        self._changed_by_hand(cells, cells[:0])
        return Erased(
            records=taken, prior_xy=np.empty((0, 2)), cells=len(cells), number=self.erasures
        )

    def is_taken(
        self, points: Records, rule: ColourRule | None, before: ColourRule | None, past: PastView
    ) -> Bools:
        """Return (N,) whether a new colour rule takes points that the rule until now took; None is
        no rule, which takes nothing."""
        if rule is None:
            return np.zeros(len(points), dtype=np.bool_)
        return is_taken(points, rule, before, past, self._rules.clearing, self._rules.fading.rules)

    def past_points(
        self, observation: Observation, pose_id: int, T_map_id: Pose2, erasures: int
    ) -> Records:
        """Return the beware points that a past frame with a known pose ID shows, where they are
        now, without what was erased since. The observation is that of the frame at its capture,
        when the pose of the ID was `T_map_id` and the newest erasure had the number `erasures`.
        Raises `ValueError` for an unknown ID."""
        if not 0 <= pose_id < len(self._placed.pose_ids):
            raise ValueError(f"pose ID {pose_id} is not on the map")
        at, now = np.zeros(len(observation.rgb), np.int32), self._placed.pose_ids[pose_id]
        points_base = base_points(observation.points_map, at, pose_rows([T_map_id]))
        new = self._placed.records(observation, points_base, at, pose_rows([now]))
        new["pose_id"], new["looks"] = pose_id, self._rules.fading.first
        return self._not_erased_since(erasures, new[new["class_id"] != NOTHING])

    def _not_erased_since(self, number: int, points: Records) -> Records:
        """Return points without those in areas that were erased after the erasure of a number."""
        for area in self.erased_areas:
            if area.number > number:
                points = points[~area.holds(points)]
        return points

    def add_past(self, points: Records) -> None:
        """Add `past_points` where the map has none of their class."""
        self._placed.has_beware = self._placed.has_beware or len(points) > 0
        self._placed.layers.add_classes(points["class_id"])
        self._placed.add(points)
        cells = np.unique(points["cell"][points["cell"] >= 0]).astype(np.int64)
        self._changed_by_hand(cells, cells[:0])
        self._placed.keep_to_budget()

    def _changed_by_hand(self, cells: Indices, prior: Indices) -> None:
        self._placed.refresh(cells)
        self._placed.version += 1
        self.count += 1
        if len(prior):  # a correction under way would bring back the former prior map
            self._placed.snapshot += 1

    def grow(self, growth: Growth) -> None:
        """Keep the erased areas in their place on a larger grid."""
        self.erased_areas = tuple(
            dataclasses.replace(area, cells=growth.flat(area.cells)) for area in self.erased_areas
        )

    def forget_areas(self) -> None:
        """Forget what was erased: another map is loaded."""
        self.erased_areas = ()
