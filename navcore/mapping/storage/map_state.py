"""State of a point map as a value, as it is stored when the program ends."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import GridSpec
from navcore.grid.growth import Growth
from navcore.mapping.explored.patch import grown_volume
from navcore.mapping.explored.raycast import BLOCK
from navcore.mapping.explored.submap import PackedSubmap, shifted
from navcore.mapping.points.point_table import MapPoints
from navcore.mapping.points.rejections import Rejection
from navcore.mapping.storage.map_rules import require, within
from navcore.mapping.storage.stored_scans import NO_SCANS, StoredScans, check_scans
from navcore.mission.beware_list import LARGEST_CLASS_ID

_ROUNDING_M = 1e-3
"""Distance in metres that a point may be outside the grid, because of its single precision."""
_HIGHEST_M = 1000.0
"""Largest height or depth in metres that can be a measurement."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapState:
    """State of a map; a map restored from it continues as the first one would have, but for the
    terrain, which is not stored: the camera measures the ground again."""

    spec: GridSpec
    """Size and position of the grid."""
    points: MapPoints
    """All points in order, each with the ID of its pose."""
    points_base: npt.NDArray[np.float32]
    """(N, 2) x and y of each point in metres of the base frame at its pose."""
    poses: npt.NDArray[np.float64]
    """(P, 3) x and y in metres of the map frame and yaw in radians of each pose, by ID."""
    measured: CellMask
    """Cells in which a surface was measured."""
    visible: CellMask
    """Cells over which a line of sight has passed."""
    driven: CellMask
    """Cells that the robot drove on."""
    prior: CellMask
    """Occupied cells of the prior map that the camera has not seen free."""
    volume: npt.NDArray[np.uint64]
    """(⌈rows / 4⌉, ⌈cols / 4⌉) blocks, one bit for each height bin that was seen."""
    submaps: Mapping[int, PackedSubmap]
    """Further explored cells by pose ID. A file of an older program has those of all IDs; now only
    those are kept that may lie beyond the grid, for when it grows."""
    scans: StoredScans = NO_SCANS
    """Scans by which the robot finds its pose on the map."""
    rejections: tuple[Rejection, ...] = ()
    """What an operator has said is not there."""
    numbering: str = ""
    """Numbering in which the poses have their IDs; empty in a file of an older program."""

    def grown(self, growth: Growth) -> MapState:
        """Return the state on a larger grid."""
        return replace(
            self,
            spec=growth.new,
            measured=growth.mask(self.measured),
            visible=growth.mask(self.visible),
            driven=growth.mask(self.driven),
            prior=growth.mask(self.prior),
            volume=grown_volume(self.volume, growth),
            submaps=shifted(self.submaps, growth.rows, growth.cols),
        )


def check_points(parts: Mapping[str, npt.NDArray[Any]], spec: GridSpec, where: str) -> None:
    """Raise `BadConfiguration` unless the positions of the points of a map file can be computed.

    `parts`: arrays by name, with `points_map` on the grid or else `points_base`.
    """
    poses, kind = parts["poses"], "points_map" if "points_map" in parts else "points_base"
    # Heights are above the plane of the start, and the ground may be anywhere below or above it.
    low, size = np.full(3, -_HIGHEST_M), np.full(3, 2 * _HIGHEST_M)
    if kind == "points_map":
        low[:2] = spec.origin_x_m, spec.origin_y_m
        size[:2] = spec.cols * spec.resolution_m, spec.rows * spec.resolution_m
    points = parts[kind]
    require(
        {
            "points": len(points) == len(parts["pose_ids"]),
            kind: points.shape[1:] == (3,)
            and within(points.astype(np.float64) - low, -_ROUNDING_M, size + _ROUNDING_M),
            "poses": poses.shape[1:] == (3,) and within(poses, -1e7, 1e7),
            "pose_ids": within(parts["pose_ids"], 0, len(poses) - 1),
        },
        where,
    )


def check_state(state: MapState, where: str) -> None:
    """Raise `BadConfiguration` for a part with values that no map has; `where` names the file."""
    points, spec = state.points, state.spec
    columns = (
        state.points_base,
        points.points_map,
        points.rgb,
        points.class_ids,
        points.confidence,
        points.range_m,
        points.pose_ids,
        points.looks,
    )
    masks = (state.measured, state.visible, state.driven, state.prior)
    require(
        {
            "points": len({len(column) for column in columns}) == 1,
            "points_base": state.points_base.shape[1:] == (2,)
            and within(state.points_base, -_HIGHEST_M, _HIGHEST_M),
            "points_map": points.points_map.shape[1:] == (3,)
            and within(points.points_map, -2e7, 2e7),
            "rgb": points.rgb.shape[1:] == (3,),
            "class_ids": within(points.class_ids, 0, LARGEST_CLASS_ID),
            "confidence": within(points.confidence, 0, 1),
            "range_m": within(points.range_m, 0, 1000),
            "pose_ids": within(points.pose_ids, 0, len(state.poses) - 1),
            "poses": state.poses.shape[1:] == (3,) and within(state.poses, -1e7, 1e7),
            "masks": all((mask.rows, mask.cols) == (spec.rows, spec.cols) for mask in masks),
            "volume": state.volume.shape == (-(-spec.rows // BLOCK), -(-spec.cols // BLOCK)),
        },
        where,
    )
    check_scans(state.scans, len(state.poses), where)
