"""The points of the map with the poses that they move with and the cells that they occupy, kept in
step."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navcore.config.mapping import MappingConfig
from navcore.geometry.arrays import Floats, Indices, sorted_distinct
from navcore.grid.grid import Box, GridSpec
from navcore.grid.growth import Growth
from navcore.mapping.correction import replace_points
from navcore.mapping.layers import MapLayers
from navcore.mapping.points.placing import place, pose_rows
from navcore.mapping.points.point_links import Records
from navcore.mapping.points.point_queries import points_in_box, redundant_points
from navcore.mapping.points.point_table import POINT, MapPoints, PointTable, levels_of
from navcore.mapping.points.pose_ids import PoseIds
from navcore.mapping.storage.map_state import MapState
from navcore.mapping.views.observation import Observation
from navcore.mission.beware_list import NOTHING


class PlacedPoints:
    """The table of points on a grid, the poses they were measured from, and the layers of cells."""

    def __init__(self, spec: GridSpec, rules: MappingConfig) -> None:
        self._rules = rules
        self.spec = spec
        """Size and position of the grid."""
        self.table = PointTable(spec.rows * spec.cols)
        """All points."""
        self.layers = MapLayers(spec, rules)
        """Occupied cells by class."""
        self.pose_ids = PoseIds(rules.pose_spacing_m, rules.pose_spacing_deg)
        """Poses from which the points were measured."""
        self.has_uncertain = False
        """Whether any point may have a confidence below 1."""
        self.has_beware = False
        """Whether any point may be of the beware list."""
        self.version = 0
        """Number that grows whenever a cell of any layer becomes occupied or free, or the
        confidence of a beware point may have changed."""
        self.snapshot = 0
        """Number of the newest snapshot; it grows with every change after which no correction of an
        earlier one may be taken over."""
        self._over_budget = False

    @property
    def rows(self) -> Floats:
        """(P, 4) `pose_rows` of all pose IDs."""
        return pose_rows(self.pose_ids.poses)

    @property
    def memory_mb(self) -> float:
        """Memory of the points in megabytes."""
        return self.table.bytes_used / 1e6

    def records(
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

    def add(self, new: Records) -> None:
        """Add points; the layers follow with `refresh`."""
        self.table.add(new, one_per_cell=self._over_budget)

    def remove(self, indices: Indices) -> None:
        """Remove points by index, and free the cells that none occupies any more."""
        if len(indices):
            cells = sorted_distinct(self.table.live["cell"][indices]).astype(np.int64)
            self.table.remove(indices)
            self.version += self.refresh(cells[cells >= 0])

    def refresh(self, cells: Indices) -> bool:
        """Bring (N,) cells of all layers in step with the points; return whether any changed."""
        return self.layers.refresh(self.table, cells)

    def indices_in(self, box: Box) -> Indices:
        """Return the (N,) indices of the points in a box of cells."""
        return points_in_box(
            self.table.records, self.table.count, self.table.first, self.spec.cols, box
        )

    def keep_to_budget(self) -> None:
        """Thin the older half of the points, then all of them; a cell keeps one point of each
        class."""
        for share in (0.5, 1.0):
            if self.memory_mb <= self._rules.budget_mb or self._over_budget:
                return
            newest = int(np.quantile(self.table.live["pose_id"], share, method="lower"))
            self.table.remove(
                redundant_points(self.table.records, self.table.count, self.table.first, newest)
            )
        self._over_budget = self.memory_mb > self._rules.budget_slack * self._rules.budget_mb

    def grow(self, growth: Growth) -> None:
        """Continue on a larger grid; points that were beside the grid come back."""
        self.spec = growth.new
        beside = self.table.grow(growth)
        self.layers.grow(growth)
        self.refresh(replace_points(self.table, beside, self.rows, self.spec))

    def restore(self, state: MapState) -> None:
        """Replace grid, poses and points by stored ones; the poses are constants from then on."""
        self.spec, held = state.spec, state.points
        self.pose_ids.restore(state.poses, state.numbering)
        records = self.records(held, state.points_base, held.pose_ids, self.rows)
        records["pose_id"], records["looks"] = held.pose_ids, held.looks
        self.table = PointTable(self.spec.rows * self.spec.cols)
        self.table.load(records, len(records))
        self.has_uncertain = bool((records["confidence"] < 1).any())
        self.has_beware = bool((records["class_id"] != NOTHING).any())
        self._over_budget = False
        self.layers.rebuild(self.table, state.prior.bools, self.spec)
