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

import math
from collections.abc import Callable, Iterable, Mapping

import numpy as np
import numpy.typing as npt

from navcore.config.mapping import MappingConfig
from navcore.errors import BadConfiguration
from navcore.geometry.arrays import Bools, Indices, Points
from navcore.geometry.transform import Pose2, invert, wrap_angle
from navcore.grid.bitplane import MOST_CELLS
from navcore.grid.cell_mask import CellMask, window
from navcore.grid.grid import BoolGrid, Box, GridSpec, inflate
from navcore.mapping.clearing import find_outdated
from navcore.mapping.confidence import initial_confidence, update_confidence
from navcore.mapping.layers import MapLayers
from navcore.mapping.map_state import MapState
from navcore.mapping.observation import Observation
from navcore.mapping.point_table import (
    POINT,
    MapPoints,
    PointTable,
    Records,
    levels_of,
    points_in,
    redundant_points,
)
from navcore.mapping.visibility import VisibilityMap
from navcore.mission.beware_list import NOTHING, BewareList
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame


class PointMap:
    """Points by pose ID, the cells that they occupy, and the known space."""

    def __init__(self, spec: GridSpec, rules: MappingConfig) -> None:
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
        self.explored = VisibilityMap(spec, rules.raycast)
        """Known space."""
        self._poses: list[Pose2] = []
        self._has_uncertain = False  # whether any point may have a confidence below 1
        self._over_budget = False
        self.version = 0
        """Number that grows whenever a cell of any layer becomes occupied or free, or the
        confidence of a beware point may have changed."""

    def insert(self, observation: Observation, frame: Frame, labels: Labels | None = None) -> None:
        """Replace or append the points of the frame's pose ID, and remove those it sees through.

        With `labels` the confidence of uncertain points follows every image (`confidence.py`);
        without, the first confidence stays.
        """
        if labels is not None:
            self._update_confidence(frame, labels, observation.box)
        pose_id = self._pose_id_of(frame.pose)
        outdated = self._outdated(frame, observation, pose_id)
        new = self._records(observation, pose_id)
        if labels is not None and (new["confidence"] < 1).any():
            new["confidence"] = initial_confidence(
                new["confidence"],
                self.explored.was_measured(new["cell"]),
                self._rules.confidence,
            )
        self._has_uncertain = self._has_uncertain or bool((new["confidence"] < 1).any())
        self.layers.add_classes(new["class_id"])
        touched = np.concatenate([self._points.live["cell"][outdated], new["cell"]]).astype(
            np.int64
        )
        beware_changed = bool(
            (self._points.live["class_id"][outdated] != NOTHING).any()
            or (new["class_id"] != NOTHING).any()
        )
        self._points.remove(outdated)
        self._points.add(new, one_per_cell=self._over_budget)
        self.explored.mark_measured(observation.cells_seen, observation.heights_seen)
        disproved = self.layers.clear_prior(observation.cells_seen, observation.heights_seen)
        changed = self.layers.refresh(self._points, np.concatenate([touched, disproved]))
        self.version += changed or beware_changed
        self._keep_to_budget()

    def forget(self, cells: Indices, class_ids: Iterable[int]) -> None:
        """Remove the points of some classes in (N,) distinct cells, row · cols + col, for example
        where a person walked."""
        gone = points_in(self._points.first, self._points.records, cells, _class_set(class_ids))
        if len(gone):
            self._points.remove(gone)
            self.version += self.layers.refresh(self._points, cells)

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
        (N, 2) positions in metres of the map frame) and whose points are all within the image:
        depth may see nothing at all behind remains that float in the air.
        """
        class_ids = list(class_ids)
        bodies = [
            window(plane, *box) for plane in map(self.layers.plane, class_ids) if plane is not None
        ]
        if not any(body.any() for body in bodies):
            return
        whole = inflate(
            np.logical_or.reduce(bodies), math.ceil(self._rules.body_m / self.spec.resolution_m)
        )
        cells = np.argwhere(whole) + box[:2]
        cells = cells[is_free_floor(self.spec.centres(cells))]
        flat = cells[:, 0] * self.spec.cols + cells[:, 1]
        indices = points_in(
            self._points.first, self._points.records, flat, _class_set([NOTHING, *class_ids])
        )
        held = self._points.records[indices]
        outside = held["cell"][~frame.shows(np.column_stack([held["x"], held["y"], held["z"]]))]
        gone = ~np.isin(held["cell"], outside)
        self._points.remove(indices[gone])
        self.version += self.layers.refresh(
            self._points, np.unique(held["cell"][gone]).astype(np.int64)
        )

    def correct(self, poses: Mapping[int, Pose2]) -> None:
        """Move past poses (pose ID → corrected T_map_base) with their points, for example after a
        loop closure.

        Raises `BadConfiguration` for an unknown pose ID, and then nothing has moved. Points that
        leave the grid are forgotten. Of two points in one voxel the more confident one stays.
        """
        unknown = [pose_id for pose_id in poses if not 0 <= pose_id < len(self._poses)]
        if unknown:
            raise BadConfiguration(
                f"pose ID {unknown[0]} is not on the map, which has {len(self._poses)}"
            )
        moving = np.flatnonzero(
            np.isin(self._points.live["pose_id"], np.array(list(poses), dtype=np.int32))
        )
        taken = self._points.live[moving].copy()
        self._points.remove(moving)
        before = taken["cell"].astype(np.int64)
        for pose_id, pose in poses.items():
            own = taken["pose_id"] == pose_id
            T_new_old = pose.matrix() @ invert(self._poses[pose_id].matrix())
            xy = (
                np.column_stack([taken["x"][own], taken["y"][own]]).astype(np.float64)
                @ T_new_old[:2, :2].T
                + T_new_old[:2, 3]
            )
            taken["x"][own], taken["y"][own] = xy[:, 0], xy[:, 1]
            self._poses[pose_id] = pose
        kept = self._on_grid(taken)
        self._points.add(kept, one_per_cell=self._over_budget)
        self.version += (
            self.layers.refresh(
                self._points, np.concatenate([before, kept["cell"].astype(np.int64)])
            )
            or len(moving) > 0
        )

    def load_prior(self, occupied: BoolGrid) -> None:
        """Occupy the (rows, cols) cells of a prior map until the camera sees their floor free."""
        self.version += self.layers.load_prior(occupied, self._points)

    def state(self) -> MapState:
        """Return the complete state of the map."""
        rows, cols, explored = self.spec.rows, self.spec.cols, self.explored
        return MapState(
            spec=self.spec,
            points=self._points.copied(),
            poses=np.array(
                [[pose.x_m, pose.y_m, pose.yaw_rad] for pose in self._poses], dtype=np.float64
            ).reshape(-1, 3),
            measured=CellMask.copied(explored.measured, rows, cols),
            visible=CellMask.copied(explored.visible, rows, cols),
            driven=CellMask.copied(explored.driven, rows, cols),
            prior=self.layers.prior or CellMask.of(np.zeros((rows, cols), dtype=np.bool_)),
            volume=explored.volume.copy(),
        )

    def restore(self, state: MapState) -> None:
        """Replace the contents by a stored state; raises `BadConfiguration` for a state of another
        grid."""
        if state.spec != self.spec:
            raise BadConfiguration(
                f"the stored map covers {state.spec.extent()} in cells of "
                f"{state.spec.resolution_m:g} m, "
                f"this one {self.spec.extent()} in cells of {self.spec.resolution_m:g} m"
            )
        records = self._records(state.points, state.points.pose_ids)
        self._points = PointTable(self.spec.rows * self.spec.cols)
        self._points.add(records)
        self._has_uncertain = bool((records["confidence"] < 1).any())
        self._poses = [Pose2(x_m=x, y_m=y, yaw_rad=yaw) for x, y, yaw in state.poses.tolist()]
        explored = self.explored
        explored.measured, explored.visible, explored.driven = (
            mask.plane.copy() for mask in (state.measured, state.visible, state.driven)
        )
        explored.volume = state.volume.copy()
        self.layers.rebuild(self._points, state.prior.bools)
        self.version += 1

    def use(self, beware: BewareList) -> None:
        """Count only points with the confidence that the list asks for, past ones included."""
        self.layers.use(beware, self._points)

    @property
    def points(self) -> MapPoints:
        """Snapshot of all points."""
        return self._points.copied()

    @property
    def poses(self) -> tuple[Pose2, ...]:
        """T_map_base of every pose ID, in order."""
        return tuple(self._poses)

    @property
    def memory_mb(self) -> float:
        """Memory of the points in megabytes; `MappingConfig.budget_mb` bounds it unless every cell
        is down to one point of each class."""
        return self._points.bytes_used / 1e6

    def _pose_id_of(self, pose: Pose2) -> int:
        near = bool(self._poses) and (
            self._poses[-1].distance_to(pose.x_m, pose.y_m) < self._rules.pose_spacing_m
            and abs(wrap_angle(pose.yaw_rad - self._poses[-1].yaw_rad))
            < math.radians(self._rules.pose_spacing_deg)
        )
        if not near:
            self._poses.append(pose)
        return len(self._poses) - 1

    def _update_confidence(self, frame: Frame, labels: Labels, box: Box) -> None:
        """Update the confidence of the uncertain points in view, and forget the disproved ones."""
        if not self._has_uncertain:
            return
        forgotten, cells = update_confidence(
            self._points,
            self.spec.cols,
            box,
            frame,
            labels.all_hypotheses[0],
            self._rules.confidence,
            self._rules.clearing,
        )
        self._points.remove(forgotten)
        if len(cells):
            self.layers.refresh(self._points, np.unique(cells))
            self.version += 1

    def _outdated(self, frame: Frame, observation: Observation, pose_id: int) -> Indices:
        return find_outdated(
            self._points.records,
            self._points.count,
            self._points.first,
            self.spec.cols,
            observation.box,
            frame.depth_m,
            invert(frame.T_map_camera),
            frame.intrinsics.pinhole,
            self._rules.clearing,
            observation.max_range_m,
            pose_id,
        )

    def _records(
        self, seen: Observation | MapPoints, pose_ids: int | npt.NDArray[np.int32]
    ) -> Records:
        new = np.zeros(len(seen.class_ids), dtype=POINT)
        new["x"], new["y"], new["z"] = seen.points_map.T
        new["r"], new["g"], new["b"] = seen.rgb.T
        new["class_id"], new["confidence"] = seen.class_ids, seen.confidence
        new["range_m"], new["pose_id"] = seen.range_m, pose_ids
        new["level"] = levels_of(new["z"])
        # A point inside the border may be outside by a rounding error in single precision.
        rows, cols = self._rows_cols(new)
        new["cell"] = np.clip(rows, 0, self.spec.rows - 1) * self.spec.cols + np.clip(
            cols, 0, self.spec.cols - 1
        )
        return new

    def _on_grid(self, records: Records) -> Records:
        """Return the records on the grid, with their cells."""
        rows, cols = self._rows_cols(records)
        inside = (rows >= 0) & (rows < self.spec.rows) & (cols >= 0) & (cols < self.spec.cols)
        records["cell"][inside] = (rows * self.spec.cols + cols)[inside]
        return records[inside]

    def _rows_cols(self, records: Records) -> tuple[Indices, Indices]:
        spec = self.spec
        rows = np.floor(
            (records["y"].astype(np.float64) - spec.origin_y_m) / spec.resolution_m
        ).astype(np.int64)
        cols = np.floor(
            (records["x"].astype(np.float64) - spec.origin_x_m) / spec.resolution_m
        ).astype(np.int64)
        return rows, cols

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


def _class_set(class_ids: Iterable[int]) -> npt.NDArray[np.bool_]:
    """Return the set of classes as (256,) truth values by class id."""
    kinds = np.zeros(256, dtype=np.bool_)
    kinds[list(class_ids)] = True
    return kinds
