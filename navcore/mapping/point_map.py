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

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from navcore.config.mapping import MappingConfig
from navcore.errors import BadConfiguration
from navcore.geometry.arrays import Bools, FloatImage, Indices, Points
from navcore.geometry.transform import Pose2
from navcore.grid.bitplane import MOST_CELLS, BitPlane
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import BoolGrid, Box, GridSpec
from navcore.grid.growth import Growth
from navcore.mapping.correction import (
    MapSnapshot,
    PreparedCorrection,
    catch_up,
    prepare,
)
from navcore.mapping.explored.patch import DRIVEN, FLOOR, MEASURED, VISIBLE
from navcore.mapping.explored.visibility import VisibilityMap
from navcore.mapping.layers import MapLayers
from navcore.mapping.manual_edits import ManualEdits
from navcore.mapping.placed_points import PlacedPoints
from navcore.mapping.point_evidence import PointEvidence
from navcore.mapping.points.confidence import (
    ALL_RECOGNISED,
    initial_confidence,
)
from navcore.mapping.points.erasing import ErasedArea
from navcore.mapping.points.people_points import (
    body_cells,
    class_set,
    points_of_bodies,
    within_image,
)
from navcore.mapping.points.placing import base_points, pose_rows
from navcore.mapping.points.point_links import Records
from navcore.mapping.points.point_queries import points_in
from navcore.mapping.points.point_table import MapPoints
from navcore.mapping.points.pose_ids import PoseIds, check_movable
from navcore.mapping.points.rejections import Rejections
from navcore.mapping.storage.map_state import MapState
from navcore.mapping.storage.stored_scans import NO_SCANS, StoredScans
from navcore.mapping.terrain.terrain_map import TerrainMap, TerrainRecords
from navcore.mapping.views.observation import Observation
from navcore.mission.beware_list import NOTHING, BewareList
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY, RobotProfile


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Checkpoint:
    """What a map holds at one moment, stored or not."""

    state: MapState
    """What is stored."""
    terrain: TerrainRecords
    """Ground as it was seen."""
    floor: BitPlane
    """Cells whose floor was measured."""
    loaded_prior: CellMask | None
    """Cells of the prior map as it was loaded."""
    erased_areas: tuple[ErasedArea, ...]
    """What operators have erased."""


class PointMap:
    """Points by pose ID, the cells that they occupy, and the known space."""

    def __init__(self, spec: GridSpec, rules: MappingConfig, profile: RobotProfile = HUSKY) -> None:
        if spec.rows * spec.cols > MOST_CELLS:
            raise BadConfiguration(
                f"the map would have {spec.rows} × {spec.cols} cells, at most {MOST_CELLS} in all; "
                "use a coarser resolution or a smaller area"
            )
        self._rules = rules
        self._placed = PlacedPoints(spec, rules)
        self.explored = VisibilityMap(spec, rules.raycast, self.pose_ids)
        """Known space."""
        self.terrain = TerrainMap(spec, rules.terrain, self.pose_ids, profile)
        """Slope, steps and roughness of the ground."""
        self.rejections = Rejections(rules.rejection)
        """What an operator has said is not there."""
        self.edits = ManualEdits(self._placed, self.explored, self.terrain, self.rejections, rules)
        """Changes by hand."""
        self._evidence = PointEvidence(self._placed, rules)
        self.scans: Callable[[], StoredScans] = lambda: NO_SCANS
        """Returns the scans that are stored with the map, as what makes them has set it."""

    @property
    def spec(self) -> GridSpec:
        """Size and position of the grid."""
        return self._placed.spec

    @property
    def layers(self) -> MapLayers:
        """Occupied cells by class."""
        return self._placed.layers

    @property
    def pose_ids(self) -> PoseIds:
        """Poses from which the points were measured."""
        return self._placed.pose_ids

    @property
    def version(self) -> int:
        """Number that grows whenever a cell of any layer becomes occupied or free, or the
        confidence of a beware point may have changed."""
        return self._placed.version

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
        placed, box = self._placed, observation.box
        held = placed.indices_in(box)
        if labels is not None:
            held = self._evidence.count(frame, labels, recognised, held, box)
        pose_id = self.pose_ids.id_of(frame.pose)
        outdated = self._evidence.outdated(frame, observation, pose_id, held)
        new = self._new_points(observation, pose_id, labels)
        is_beware = new["class_id"] != NOTHING
        placed.has_uncertain |= bool((new["confidence"] < 1).any())
        placed.has_beware |= bool(is_beware.any())
        self.layers.add_classes(new["class_id"])
        live, cells = placed.table.live, new["cell"][new["cell"] >= 0]
        touched = np.concatenate([live["cell"][outdated], cells]).astype(np.int64)
        beware_changed = bool((live["class_id"][outdated] != NOTHING).any() or is_beware.any())
        placed.table.remove(outdated)
        placed.add(new)
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
        changed = placed.refresh(np.concatenate([touched, disproved]))
        placed.version += changed or beware_changed
        placed.keep_to_budget()

    def _new_points(self, observation: Observation, pose_id: int, labels: Labels | None) -> Records:
        """Return the measured points as records of a pose ID."""
        rows, at = pose_rows([self.pose_ids[pose_id]]), np.zeros(len(observation.rgb), np.int32)
        points_base = base_points(observation.points_map, at, rows)
        new = self._placed.records(observation, points_base, at, rows)
        new["pose_id"], new["looks"] = pose_id, self._rules.fading.first
        if labels is not None and (new["confidence"] < 1).any():
            new["confidence"] = initial_confidence(
                new["confidence"],
                self.explored.was_measured(new["cell"]),
                self._rules.confidence,
            )
        return new

    def observe_ground(self, frame: Frame, ground_m: FloatImage, object_height_m: float) -> None:
        """Add the ground that a frame shows to the terrain (`TerrainMap.observe`)."""
        self._placed.version += self.terrain.observe(frame, ground_m, object_height_m)

    def forget(self, cells: Indices, class_ids: Iterable[int]) -> None:
        """Remove the points of some classes in (N,) distinct cells, row · cols + col, for example
        where a person walked."""
        kinds = class_set(class_ids)
        table = self._placed.table
        self._placed.remove(points_in(table.first, table.records, cells, kinds))

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
            ghosts = points_of_bodies(self._placed.table, cells, self.spec, people)
            self._placed.remove(within_image(self._placed.table, ghosts, frame))

    def forget_people(self, class_ids: Iterable[int], robot: Pose2) -> None:
        """Remove the people of a map that was loaded: all points of `class_ids` and, farther than
        `bodies_from_m` from the robot, T_map_base, obstacles within `body_m` of them. What is
        nearer may be out of the camera's sight, and stays until it is not."""
        people, rules = list(class_ids), self._rules
        cells = self._body_cells(people, (0, 0, self.spec.rows, self.spec.cols))
        bodies = points_of_bodies(self._placed.table, cells, self.spec, people)
        at = self._placed.table.records[bodies]
        is_far = np.hypot(at["x"] - robot.x_m, at["y"] - robot.y_m) > rules.bodies_from_m
        bodies = bodies[is_far & (at["z"] > rules.flat_m)]
        named = np.flatnonzero(class_set(people)[self._placed.table.live["class_id"]])
        self._placed.remove(np.union1d(bodies, named))

    def positions_of(self, class_ids: Iterable[int]) -> Points:
        """Return the (N, 2) positions in metres of all points of some classes."""
        live = self._placed.table.live
        held = live[class_set(class_ids)[live["class_id"]]]
        return np.column_stack([held["x"], held["y"]]).astype(np.float64)

    def _body_cells(self, people: list[int], box: Box) -> Indices:
        planes = (plane for plane in map(self.layers.plane, people) if plane is not None)
        return body_cells(planes, self.spec, box, self._rules.body_m)

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
        self._placed.snapshot += 1
        self._placed.table.changed[:] = False
        count = self._placed.table.count
        records = self._placed.table.copied_records()
        base, submaps = self.explored.snapshot()
        return MapSnapshot(
            number=self._placed.snapshot,
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
        self._placed.grow(growth)
        self.explored.grow(growth)
        self.terrain.grow(growth)
        self.rejections.place(self._placed.rows, self.spec)
        self.edits.grow(growth)
        self._placed.snapshot += 1
        self._placed.version += 1

    def apply(self, prepared: PreparedCorrection, later: Mapping[int, Pose2] | None = None) -> bool:
        """Take over a correction with what frames have changed since its snapshot; False if the map
        was corrected, restored, grown or given a prior map meanwhile, and then nothing has
        happened.

        `later`: poses of IDs that are newer than the snapshot. Raises `BadConfiguration` for one
        that is not, or is unknown, and then nothing has moved.
        """
        if prepared.number != self._placed.snapshot:
            return False
        later, known = {} if later is None else later, prepared.known
        check_movable(prepared.poses, known, self.pose_ids.frozen)
        check_movable(later, len(self.pose_ids), known)
        self.pose_ids.adopt(prepared.pose_ids, later)
        self._placed.snapshot += 1
        newer = (self.pose_ids[pose_id] for pose_id in range(known, len(self.pose_ids)))
        rows = np.vstack([prepared.rows, pose_rows(newer)])
        cells = catch_up(prepared.points, self._placed.table, rows, self.spec)
        self.rejections.place(rows, self.spec)
        prepared.points.reuse(self._placed.table)
        self._placed.table = prepared.points
        floor = self.explored.replace(prepared.explored)
        self.terrain.place()
        self.layers.replace(prepared.rules, prepared.planes, prepared.prior, self._placed.table)
        if self.layers.floor_bins:
            cells = np.concatenate([cells, self.layers.clear_prior(floor)])
        self._placed.refresh(cells)
        self._placed.version += 1
        return True

    def load_prior(self, occupied: BoolGrid) -> None:
        """Occupy the (rows, cols) cells of a prior map until the camera sees their floor free."""
        self._placed.version += self.layers.load_prior(occupied, self._placed.table)
        self.explored.forget_floor()
        self._placed.snapshot += 1

    def state(self) -> MapState:
        """Return the complete state of the map, whose poses will be constants."""
        rows, cols, explored = self.spec.rows, self.spec.cols, self.explored.live
        live = self._placed.table.live
        return MapState(
            spec=self.spec,
            points=self._placed.table.copied(),
            points_base=np.column_stack([live["base_x"], live["base_y"]]),
            poses=self.pose_ids.array(),
            numbering=self.pose_ids.numbering,
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
        self._placed.restore(state)
        self.explored.restore(
            self.spec, (state.measured, state.visible, state.driven), state.volume, state.submaps
        )
        self.terrain.clear(self.spec)
        self.scans = lambda: state.scans
        self.rejections.load(state.rejections, self._placed.rows, self.spec)
        self.edits.forget_areas()
        self._placed.snapshot += 1
        self._placed.version += 1

    def checkpoint(self) -> Checkpoint:
        """Return what the map holds."""
        return Checkpoint(
            state=self.state(),
            terrain=self.terrain.records(),
            floor=self.explored.live.planes[FLOOR].copy(),
            loaded_prior=self.layers.loaded_prior,
            erased_areas=self.edits.erased_areas,
        )

    def return_to(self, checkpoint: Checkpoint) -> None:
        """Take back all that has come since a checkpoint, and the growth of the grid; its poses are
        constants from then on."""
        scans = self.scans
        self.restore(checkpoint.state)
        self.scans = scans
        self.terrain.restore(checkpoint.terrain)
        self.explored.restore_floor(checkpoint.floor)
        self.layers.loaded_prior = checkpoint.loaded_prior
        self.edits.erased_areas = checkpoint.erased_areas

    def use(self, beware: BewareList) -> None:
        """Count only points with the confidence that the list asks for, past ones included, and let
        its patterns fade as wholes and its lines by their brightness."""
        self.layers.use(beware, self._placed.table)
        self._evidence.use(beware)

    @property
    def points(self) -> MapPoints:
        """Snapshot of all points."""
        return self._placed.table.copied()

    @property
    def poses(self) -> tuple[Pose2, ...]:
        """T_map_base of every pose ID, in order."""
        return self.pose_ids.poses

    @property
    def memory_mb(self) -> float:
        """Memory of the points in megabytes; `MappingConfig.budget_mb` bounds it unless every cell
        is down to one point of each class."""
        return self._placed.memory_mb
