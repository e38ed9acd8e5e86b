"""The global point map: points keyed by the pose from which they were measured.

A frame at a known pose ID replaces that pose's points, otherwise its points are appended (the
paper's section on global mapping). Three rules make that safe for a camera that sees only a part of
the world at a time:

* a point is replaced only where the camera observes it again; all other points stay;
* a point through which the camera now sees is removed, whatever its pose, because people walk on;
* a voxel belongs to the first pose that measured it, or to a later one that measured it from much
  nearer, so that the size of the map is bounded by the world's surface, not by the time driven.

The occupied cells (`navcore.mapping.layers`) follow every insertion and removal of points.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping

import numpy as np
import numpy.typing as npt

from navcore.config.mapping import MappingConfig
from navcore.errors import BadConfiguration
from navcore.geometry.arrays import Bools, Floats, Indices, Points, sorted_distinct
from navcore.geometry.transform import Pose2, invert
from navcore.grid.bitplane import MOST_CELLS
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import BoolGrid, Box, GridSpec
from navcore.grid.growth import Growth
from navcore.mapping.correction import (
    MapSnapshot,
    PreparedCorrection,
    catch_up,
    prepare,
    replace_points,
)
from navcore.mapping.explored.patch import DRIVEN, FLOOR, MEASURED, VISIBLE
from navcore.mapping.explored.visibility import VisibilityMap
from navcore.mapping.layers import MapLayers
from navcore.mapping.points.clearing import find_outdated
from navcore.mapping.points.coloured import PastView, is_taken
from navcore.mapping.points.confidence import (
    ALL_RECOGNISED,
    initial_confidence,
    update_confidence,
)
from navcore.mapping.points.erasing import Erased, ErasedArea, put_back, take
from navcore.mapping.points.fading import faded, left_alone, line_limits
from navcore.mapping.points.people_points import (
    body_cells,
    class_set,
    points_of_bodies,
    within_image,
)
from navcore.mapping.points.placing import base_points, place, pose_rows
from navcore.mapping.points.point_links import Records
from navcore.mapping.points.point_queries import points_in, points_in_box, redundant_points
from navcore.mapping.points.point_table import POINT, MapPoints, PointTable, levels_of
from navcore.mapping.points.pose_ids import PoseIds, check_movable
from navcore.mapping.points.rejections import Rejection, Rejections
from navcore.mapping.storage.map_state import MapState
from navcore.mapping.storage.stored_scans import NO_SCANS, StoredScans
from navcore.mapping.terrain.terrain_map import TerrainMap
from navcore.mapping.views.observation import Observation
from navcore.mission.beware_list import NOTHING, BewareList, ColourRule
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY, RobotProfile

MOST_ERASED_AREAS = 50
"""Largest number of erased areas that are remembered, until the frames before them are gone."""


class PointMap:
    """Points by pose ID, the cells that they occupy, and the known space."""

    def __init__(self, spec: GridSpec, rules: MappingConfig, profile: RobotProfile = HUSKY) -> None:
        if spec.rows * spec.cols > MOST_CELLS:
            raise BadConfiguration(
                f"the map would have {spec.rows} × {spec.cols} cells, at most {MOST_CELLS} in all; "
                "use a coarser resolution or a smaller area"
            )
        self.spec = spec
        self._rules = rules
        self._points = PointTable(spec.rows * spec.cols)
        self.layers = MapLayers(spec, rules)
        """Occupied cells by class."""
        self.pose_ids = PoseIds(rules.pose_spacing_m, rules.pose_spacing_deg)
        """Poses from which the points were measured."""
        self.explored = VisibilityMap(spec, rules.raycast, self.pose_ids)
        """Known space."""
        self.terrain = TerrainMap(spec, rules.terrain, self.pose_ids, profile)
        """Slope, steps and roughness of the ground."""
        self.rejections = Rejections(rules.rejection)
        """What an operator has said is not there."""
        self._has_uncertain = False  # whether any point may have a confidence below 1
        self._has_beware = False  # whether any point may be of the beware list
        self._over_budget = False
        self._patterns: Mapping[int, ColourRule] = {}  # rules with a pattern, by class id
        self._lines = line_limits(BewareList(classes=()))
        self._snapshot = 0  # number of the newest snapshot
        self._erased_areas: tuple[ErasedArea, ...] = ()
        self.erasures = 0
        """Number of the newest erasure of points of the beware list."""
        self.edits = 0
        """Number of edits by hand."""
        self.scans: Callable[[], StoredScans] = lambda: NO_SCANS
        """Returns the scans that are stored with the map, as what makes them has set it."""
        self.version = 0
        """Number that grows whenever a cell of any layer becomes occupied or free, or the
        confidence of a beware point may have changed."""

    def insert(
        self,
        observation: Observation,
        frame: Frame,
        labels: Labels | None = None,
        recognised: Bools = ALL_RECOGNISED,
    ) -> None:
        """Replace or append the points of the frame's pose ID, and remove those it sees through.

        With `labels` the confidence of uncertain points follows every image (`confidence.py`), and
        flat points of colour rules fade (`fading.py`); without, both stay as they are.
        `recognised`: (256,) whether a network or an example can show a class, by its id. Raises
        `ValueError` for an observation on another grid than the map's present one.
        """
        if observation.spec != self.spec:
            raise ValueError(
                f"observation of a grid of {observation.spec.rows} × {observation.spec.cols} cells,"
                f" the map has {self.spec.rows} × {self.spec.cols}"
            )
        held = self._points_in(observation.box)
        if labels is not None:
            if self._update_confidence(frame, labels, recognised, held):
                held = self._points_in(observation.box)  # others have their indices now
            if self._fade(frame, labels, held):
                held = self._points_in(observation.box)
        pose_id = self.pose_ids.id_of(frame.pose)
        outdated = self._outdated(frame, observation, pose_id, held)
        rows, at = pose_rows([self.pose_ids[pose_id]]), np.zeros(len(observation.rgb), np.int32)
        points_base = base_points(observation.points_map, at, rows)
        new = self._records(observation, points_base, at, rows)
        new["pose_id"], new["looks"] = pose_id, self._rules.fading.first
        if labels is not None and (new["confidence"] < 1).any():
            new["confidence"] = initial_confidence(
                new["confidence"],
                self.explored.was_measured(new["cell"]),
                self._rules.confidence,
            )
        self._has_uncertain = self._has_uncertain or bool((new["confidence"] < 1).any())
        self._has_beware = self._has_beware or bool((new["class_id"] != NOTHING).any())
        self.layers.add_classes(new["class_id"])
        cells = new["cell"][new["cell"] >= 0]
        touched = np.concatenate([self._points.live["cell"][outdated], cells]).astype(np.int64)
        beware_changed = bool(
            (self._points.live["class_id"][outdated] != NOTHING).any()
            or (new["class_id"] != NOTHING).any()
        )
        self._points.remove(outdated)
        self._points.add(new, one_per_cell=self._over_budget)
        floor_bins = self.layers.floor_bins
        marked = self.explored.mark_measured(
            observation.cells_seen,
            observation.heights_seen,
            observation.box,
            pose_id,
            floor_bins,
        )
        disproved = np.empty(0, dtype=np.int64)
        if floor_bins:
            disproved = self.layers.clear_prior(marked.cells(FLOOR, self.spec.cols))
        changed = self.layers.refresh(self._points, np.concatenate([touched, disproved]))
        self.version += changed or beware_changed
        self._keep_to_budget()

    def forget(self, cells: Indices, class_ids: Iterable[int]) -> None:
        """Remove the points of some classes in (N,) distinct cells, row · cols + col, for example
        where a person walked."""
        kinds = class_set(class_ids)
        self._remove(points_in(self._points.first, self._points.records, cells, kinds))

    def clear_ghosts(
        self,
        box: Box,
        is_free_floor: Callable[[Points], Bools],
        class_ids: Iterable[int],
        frame: Frame,
    ) -> None:
        """Remove the remains of people who have left: points of `class_ids`, and obstacles within
        `body_m` of them.

        Only cells of `box` are cleared in which the frame shows free floor (`is_free_floor` of
        (N, 2) positions in metres of the map frame) and whose points are all within the image.
        """
        people = list(class_ids)
        cells = self._body_cells(people, box)
        if len(cells):
            cells = cells[is_free_floor(self.spec.centres(cells))]
            ghosts = points_of_bodies(self._points, cells, self.spec, people)
            self._remove(within_image(self._points, ghosts, frame))

    def forget_people(self, class_ids: Iterable[int], robot: Pose2) -> None:
        """Remove the people of a map that was loaded: all points of `class_ids` and, farther than
        `bodies_from_m` from the robot, T_map_base, obstacles within `body_m` of them. What is
        nearer may be out of the camera's sight, and stays until it is not."""
        people, rules = list(class_ids), self._rules
        cells = self._body_cells(people, (0, 0, self.spec.rows, self.spec.cols))
        bodies = points_of_bodies(self._points, cells, self.spec, people)
        at = self._points.records[bodies]
        is_far = np.hypot(at["x"] - robot.x_m, at["y"] - robot.y_m) > rules.bodies_from_m
        bodies = bodies[is_far & (at["z"] > rules.flat_m)]
        named = np.flatnonzero(class_set(people)[self._points.live["class_id"]])
        self._remove(np.union1d(bodies, named))

    def positions_of(self, class_ids: Iterable[int]) -> Points:
        """Return the (N, 2) positions in metres of all points of some classes."""
        live = self._points.live
        held = live[class_set(class_ids)[live["class_id"]]]
        return np.column_stack([held["x"], held["y"]]).astype(np.float64)

    def _body_cells(self, people: list[int], box: Box) -> Indices:
        planes = (plane for plane in map(self.layers.plane, people) if plane is not None)
        return body_cells(planes, self.spec, box, self._rules.body_m)

    def _remove(self, indices: Indices) -> None:
        if len(indices):
            cells = sorted_distinct(self._points.live["cell"][indices]).astype(np.int64)
            self._points.remove(indices)
            self.version += self.layers.refresh(self._points, cells[cells >= 0])

    def erase(self, cells: Indices, class_ids: Iterable[int]) -> Erased:
        """Remove the points of some classes in (N,) cells, row · cols + col, and with `NOTHING` the
        prior map and what is known of the ground, and return it; what the camera sees there later
        comes back. Raises `ValueError` for a cell that is not on the grid."""
        cells = np.unique(cells).astype(np.int64)
        if len(cells) and not 0 <= cells[0] <= cells[-1] < self.spec.rows * self.spec.cols:
            raise ValueError(f"cells {cells[0]} to {cells[-1]} are not all on the grid of the map")
        kinds = class_set(class_ids)
        taken = take(
            self._points, points_in(self._points.first, self._points.records, cells, kinds)
        )
        is_area = bool(kinds[NOTHING + 1 :].any())
        if is_area:
            self.erasures += 1
            area = ErasedArea(number=self.erasures, cells=cells, kinds=kinds)
            self._erased_areas = (*self._erased_areas, area)[-MOST_ERASED_AREAS:]
        prior, beyond, ground = cells[:0], cells[:0], None
        if kinds[NOTHING]:
            prior, beyond = self.layers.erase_prior(cells), self._beyond_limits(cells)
            ground = self.terrain.erase(self._centres(cells))
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
        return self.spec.centres(np.column_stack(np.divmod(cells, self.spec.cols)))

    def _beyond_limits(self, cells: Indices) -> Indices:
        """Return those of (N,) cells whose ground is beyond the robot's limits."""
        return cells[self.terrain.bools.ravel()[cells]]

    def put_back(self, erased: Erased) -> None:
        """Put back what `erase` or `forget_coloured` has removed from this map, with the poses from
        which it was seen; what the camera has seen there since stays as it is, and what was erased
        since stays away."""
        taken = erased.records.copy()
        place(taken, taken["pose_id"], pose_rows(self.pose_ids.poses), self.spec)
        if erased.is_area:
            areas = (area for area in self._erased_areas if area.number != erased.number)
            self._erased_areas = tuple(areas)
        taken = self._not_erased_since(erased.number, taken)
        put_back(self._points, taken)
        rows, cols = (self.spec.cell(x, y) for x, y in erased.prior_xy), self.spec.cols
        prior = np.array([row * cols + col for row, col in rows], dtype=np.int64)
        self.layers.put_back_prior(prior, self.explored.has_floor(prior))
        if erased.ground is not None:
            self.terrain.put_back(erased.ground)
        cells = taken["cell"][taken["cell"] >= 0].astype(np.int64)
        self._changed_by_hand(np.union1d(cells, prior), prior)
        self._keep_to_budget()

    def reject(self, class_id: int, points: Points, confidence: float) -> tuple[Rejection, Erased]:
        """Remove the points of a class around (N, 2) positions in metres, and remember that it
        takes better evidence there than looks with this confidence.

        Returns what was removed and the rejection, which moves with the pose that saw most of the
        points, or the nearest one. Raises `ValueError` on a map without a pose, and for too many.
        """
        if not len(self.pose_ids) or not len(points):
            raise ValueError("a rejection needs positions, and a map with a pose")
        self.rejections.check_room(len(points))
        erased = self.erase(self.rejections.cells_around(points, self.spec), [class_id])
        rows, (x_m, y_m) = pose_rows(self.pose_ids.poses), points.mean(axis=0)
        seen_from = np.bincount(erased.records["pose_id"], minlength=len(rows))
        distances = np.hypot(rows[:, 0] - x_m, rows[:, 1] - y_m)
        pose_id = int(seen_from.argmax() if seen_from.any() else distances.argmin())
        rejection = Rejection(
            id=0,
            class_id=class_id,
            confidence=confidence,
            pose_id=pose_id,
            points_base=self.pose_ids[pose_id].from_parent(points).astype(np.float32),
        )
        return self.rejections.add(rejection, rows, self.spec), erased

    def restore_rejection(self, rejection: Rejection) -> None:
        """Remember a rejection again that was taken back."""
        self.version += 1
        self.edits += 1
        self.rejections.add(rejection, pose_rows(self.pose_ids.poses), self.spec)

    def take_back(self, rejection_id: int) -> Rejection | None:
        """Forget a rejection and return it; None for an unknown number."""
        self.version += 1
        self.edits += 1
        return self.rejections.remove(rejection_id, pose_rows(self.pose_ids.poses), self.spec)

    @property
    def beware_points(self) -> Records:
        """Copy of the points of the beware list's classes."""
        live = self._points.live
        return np.asarray(live[live["class_id"] != NOTHING])

    def forget_coloured(
        self, class_id: int, rule: ColourRule | None, before: ColourRule | None, past: PastView
    ) -> Erased:
        """Remove and return the points of a class that its colour rule has found and that its new
        rule does not take; `before` is the rule until now, `rule` None for no rule any more."""
        live = self._points.live
        indices = np.flatnonzero((live["class_id"] == class_id) & (live["confidence"] >= 1))
        gone = indices[~self.is_taken(live[indices], rule, before, past)]
        taken = take(self._points, gone)
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
        if not 0 <= pose_id < len(self.pose_ids):
            raise ValueError(f"pose ID {pose_id} is not on the map")
        at = np.zeros(len(observation.rgb), np.int32)
        points_base = base_points(observation.points_map, at, pose_rows([T_map_id]))
        new = self._records(observation, points_base, at, pose_rows([self.pose_ids[pose_id]]))
        new["pose_id"], new["looks"] = pose_id, self._rules.fading.first
        return self._not_erased_since(erasures, new[new["class_id"] != NOTHING])

    def _not_erased_since(self, number: int, points: Records) -> Records:
        """Return points without those in areas that were erased after the erasure of a number."""
        for area in self._erased_areas:
            if area.number > number:
                points = points[~area.holds(points)]
        return points

    def add_past(self, points: Records) -> None:
        """Add `past_points` where the map has none of their class."""
        self._has_beware = self._has_beware or len(points) > 0
        self.layers.add_classes(points["class_id"])
        self._points.add(points, one_per_cell=self._over_budget)
        cells = np.unique(points["cell"][points["cell"] >= 0]).astype(np.int64)
        self._changed_by_hand(cells, cells[:0])
        self._keep_to_budget()

    def _changed_by_hand(self, cells: Indices, prior: Indices) -> None:
        self.layers.refresh(self._points, cells)
        self.version += 1
        self.edits += 1
        if len(prior):  # a correction under way would bring back the former prior map
            self._snapshot += 1

    def correct(self, poses: Mapping[int, Pose2]) -> None:
        """Move past poses (pose ID → corrected T_map_base) with all that was seen from them, for
        example after a loop closure.

        Afterwards the map is the one of each pose's own points and explored cells at the present
        poses: nothing is merged or lost, and points beside the grid come back with their pose.
        Raises `BadConfiguration` for an unknown or frozen pose ID, and then nothing has moved.
        This takes long on a large map; `snapshot`, `prepare` and `apply` are its parts.
        """
        self.apply(prepare(self.snapshot(), poses))

    def snapshot(self) -> MapSnapshot:
        """Return what `correction.prepare` needs, as a value; an earlier snapshot becomes
        invalid."""
        self._snapshot += 1
        self._points.changed[:] = False
        count = self._points.count
        records = self._points.copied_records()
        base, submaps = self.explored.snapshot()
        return MapSnapshot(
            number=self._snapshot,
            spec=self.spec,
            records=records,
            count=count,
            poses=self.pose_ids.poses,
            frozen=self.pose_ids.frozen,
            spacing=(self.pose_ids.spacing_m, self.pose_ids.spacing_deg),
            rules=self.layers.rules(),
            base=base,
            submaps=submaps,
        )

    def grow(self, growth: Growth) -> None:
        """Continue on a larger grid; every point, cell and pose stays in its place, and points that
        were beside the grid come back."""
        self.spec = growth.new
        beside = self._points.grow(growth)
        self.layers.grow(growth)
        self.explored.grow(growth)
        self.terrain.grow(growth)
        rows = pose_rows(self.pose_ids.poses)
        self.layers.refresh(self._points, replace_points(self._points, beside, rows, self.spec))
        self.rejections.place(rows, self.spec)
        self._erased_areas = tuple(
            dataclasses.replace(area, cells=growth.flat(area.cells)) for area in self._erased_areas
        )
        self._snapshot += 1
        self.version += 1

    def apply(self, prepared: PreparedCorrection, later: Mapping[int, Pose2] | None = None) -> bool:
        """Take over a correction with what frames have changed since its snapshot; False if the map
        was corrected, restored, grown or given a prior map meanwhile, and then nothing has
        happened.

        `later`: poses of IDs that are newer than the snapshot. Raises `BadConfiguration` for one
        that is not, or is unknown, and then nothing has moved.
        """
        if prepared.number != self._snapshot:
            return False
        later, known = {} if later is None else later, prepared.known
        check_movable(prepared.poses, known, self.pose_ids.frozen)
        check_movable(later, len(self.pose_ids), known)
        self.pose_ids.adopt(prepared.pose_ids, later)
        self._snapshot += 1
        newer = (self.pose_ids[pose_id] for pose_id in range(known, len(self.pose_ids)))
        rows = np.vstack([prepared.rows, pose_rows(newer)])
        cells = catch_up(prepared.points, self._points, rows, self.spec)
        self.rejections.place(rows, self.spec)
        prepared.points.reuse(self._points)
        self._points = prepared.points
        floor = self.explored.replace(prepared.explored)
        self.terrain.place()
        self.layers.replace(prepared.rules, prepared.planes, prepared.prior, self._points)
        if self.layers.floor_bins:
            cells = np.concatenate([cells, self.layers.clear_prior(floor)])
        self.layers.refresh(self._points, cells)
        self.version += 1
        return True

    def load_prior(self, occupied: BoolGrid) -> None:
        """Occupy the (rows, cols) cells of a prior map until the camera sees their floor free."""
        self.version += self.layers.load_prior(occupied, self._points)
        self.explored.forget_floor()
        self._snapshot += 1

    def state(self) -> MapState:
        """Return the complete state of the map, whose poses will be constants."""
        rows, cols, explored = self.spec.rows, self.spec.cols, self.explored.live
        live = self._points.live
        return MapState(
            spec=self.spec,
            points=self._points.copied(),
            points_base=np.column_stack([live["base_x"], live["base_y"]]),
            poses=self.pose_ids.array(),
            measured=CellMask.copied(explored.planes[MEASURED], rows, cols),
            visible=CellMask.copied(explored.planes[VISIBLE], rows, cols),
            driven=CellMask.copied(explored.planes[DRIVEN], rows, cols),
            volume=explored.volume.copy(),
            submaps=self.explored.beyond(),
            scans=self.scans(),
            rejections=self.rejections.all,
            prior=self.layers.prior or CellMask.of(np.zeros((rows, cols), dtype=np.bool_)),
        )

    def restore(self, state: MapState) -> None:
        """Replace the contents by a stored state, whose poses are constants from then on, and the
        grid by that of the state; raises `BadConfiguration` for cells of another size."""
        if state.spec.resolution_m != self.spec.resolution_m:
            raise BadConfiguration(
                f"the stored map covers {state.spec.extent()} in cells of "
                f"{state.spec.resolution_m:g} m, "
                f"this one {self.spec.extent()} in cells of {self.spec.resolution_m:g} m"
            )
        self.spec = state.spec
        self.pose_ids.restore(state.poses)
        held, rows = state.points, pose_rows(self.pose_ids.poses)
        records = self._records(held, state.points_base, held.pose_ids, rows)
        records["pose_id"], records["looks"] = held.pose_ids, held.looks
        self._points = PointTable(self.spec.rows * self.spec.cols)
        self._points.load(records, len(records))
        self._has_uncertain = bool((records["confidence"] < 1).any())
        self._has_beware = bool((records["class_id"] != NOTHING).any())
        self.explored.restore(
            self.spec, (state.measured, state.visible, state.driven), state.volume, state.submaps
        )
        self.layers.rebuild(self._points, state.prior.bools, self.spec)
        self.terrain.clear(self.spec)
        self.scans = lambda: state.scans
        self.rejections.load(state.rejections, rows, self.spec)
        self._over_budget = False
        self._erased_areas = ()
        self._snapshot += 1
        self.version += 1

    def use(self, beware: BewareList) -> None:
        """Count only points with the confidence that the list asks for, past ones included, and let
        its patterns fade as wholes and its lines by their brightness."""
        self.layers.use(beware, self._points)
        self._lines = line_limits(beware)
        self._patterns = {
            entry.class_id: entry.colour
            for entry in beware.classes
            if entry.colour is not None and entry.colour.pattern is not None
        }

    @property
    def points(self) -> MapPoints:
        """Snapshot of all points."""
        return self._points.copied()

    @property
    def poses(self) -> tuple[Pose2, ...]:
        """T_map_base of every pose ID, in order."""
        return self.pose_ids.poses

    @property
    def memory_mb(self) -> float:
        """Memory of the points in megabytes; `MappingConfig.budget_mb` bounds it unless every cell
        is down to one point of each class."""
        return self._points.bytes_used / 1e6

    def _points_in(self, box: Box) -> Indices:
        return points_in_box(
            self._points.records, self._points.count, self._points.first, self.spec.cols, box
        )

    def _update_confidence(
        self, frame: Frame, labels: Labels, recognised: Bools, held: Indices
    ) -> bool:
        """Update the confidence of the uncertain ones of (N,) points, and forget the disproved
        ones; return whether there were any of these."""
        if not self._has_uncertain:
            return False
        forgotten, cells = update_confidence(
            self._points,
            held,
            frame,
            labels,
            recognised,
            self._rules.confidence,
            self._rules.clearing,
        )
        self._points.remove(forgotten)
        if len(cells):
            self.layers.refresh(self._points, sorted_distinct(cells))
            self.version += 1
        return len(forgotten) > 0

    def _fade(self, frame: Frame, labels: Labels, held: Indices) -> bool:
        """Count the look at the certain flat ones of (N,) points, and forget those that have faded;
        return whether there were any of these."""
        if not self._has_beware:
            return False
        gone = faded(
            self._points,
            held,
            frame,
            labels,
            self._lines,
            self._rules.fading,
            self._rules.clearing,
        )
        if len(gone):
            alone = left_alone(self._points, gone, self._patterns, self._rules.clearing.flat_m)
            gone = np.concatenate([gone, alone])
            cells = sorted_distinct(self._points.live["cell"][gone]).astype(np.int64)
            self._points.remove(gone)
            self.layers.refresh(self._points, cells[cells >= 0])
            self.version += 1
        return len(gone) > 0

    def _outdated(
        self, frame: Frame, observation: Observation, pose_id: int, held: Indices
    ) -> Indices:
        return find_outdated(
            self._points.records,
            held,
            frame.depth_m,
            invert(frame.T_map_camera),
            frame.intrinsics.pinhole,
            self._rules.clearing,
            observation.max_range_m,
            pose_id,
        )

    def _records(
        self,
        seen: Observation | MapPoints,
        points_base: npt.NDArray[np.float32],
        poses: npt.NDArray[np.int32],
        rows: Floats,
    ) -> Records:
        """Return points as records without their pose ID, placed by (N, 2) positions in the base
        frame at `poses`, (N,) indices of `pose_rows`."""
        new = np.zeros(len(seen.class_ids), dtype=POINT)
        new["base_x"], new["base_y"] = points_base.T
        new["z"] = seen.points_map[:, 2]
        new["r"], new["g"], new["b"] = seen.rgb.T
        new["class_id"], new["confidence"] = seen.class_ids, seen.confidence
        new["range_m"], new["level"] = seen.range_m, levels_of(new["z"])
        place(new, poses, rows, self.spec)
        return new

    def _keep_to_budget(self) -> None:
        """Thin the older half of the points, then all of them; a cell keeps one point of each
        class."""
        for share in (0.5, 1.0):
            if self.memory_mb <= self._rules.budget_mb or self._over_budget:
                return
            newest = int(np.quantile(self._points.live["pose_id"], share, method="lower"))
            self._points.remove(
                redundant_points(
                    self._points.records, self._points.count, self._points.first, newest
                )
            )
        self._over_budget = self.memory_mb > self._rules.budget_slack * self._rules.budget_mb
