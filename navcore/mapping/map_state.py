"""State of a point map as a value, as it is stored when the program ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import GridSpec
from navcore.mapping.point_table import MapPoints
from navcore.mapping.raycast import BLOCK
from navcore.mission.beware_list import LARGEST_CLASS_ID

_ROUNDING_M = 1e-3
"""Distance in metres that a point may be outside the grid, because of its single precision."""
_HIGHEST_M = 1000.0
"""Largest height or depth in metres that can be a measurement."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapState:
    """Complete state of a map; a map restored from it continues as the first one would have."""

    spec: GridSpec
    """Size and position of the grid."""
    points: MapPoints
    """All points in order, each with the ID of its pose."""
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


def check_state(state: MapState, where: str) -> None:
    """Raise `BadConfiguration` for a part with values that no map has; `where` names the file."""
    for name, fits in _rules(state).items():
        if not fits:
            raise BadConfiguration(
                f"{where}: {name}: has values that no map has; this file is not from this program"
            )


def _rules(state: MapState) -> dict[str, bool]:
    """Return for each part whether its values are possible."""
    points, spec = state.points, state.spec
    # Heights are above the plane of the start, and the ground may be anywhere below or above it.
    low = np.array([spec.origin_x_m, spec.origin_y_m, -_HIGHEST_M])
    size = np.array([spec.cols * spec.resolution_m, spec.rows * spec.resolution_m, 2 * _HIGHEST_M])
    columns = (
        points.points_map,
        points.rgb,
        points.class_ids,
        points.confidence,
        points.range_m,
        points.pose_ids,
    )
    masks = (state.measured, state.visible, state.driven, state.prior)
    return {
        "points": len({len(column) for column in columns}) == 1,
        "points_map": points.points_map.shape[1:] == (3,)
        and _within(points.points_map.astype(np.float64) - low, -_ROUNDING_M, size + _ROUNDING_M),
        "rgb": points.rgb.shape[1:] == (3,),
        "class_ids": _within(points.class_ids, 0, LARGEST_CLASS_ID),
        "confidence": _within(points.confidence, 0, 1),
        "range_m": _within(points.range_m, 0, 1000),
        "pose_ids": _within(points.pose_ids, 0, len(state.poses) - 1),
        "poses": state.poses.shape[1:] == (3,) and _within(state.poses, -1e7, 1e7),
        "masks": all((mask.rows, mask.cols) == (spec.rows, spec.cols) for mask in masks),
        "volume": state.volume.shape == (-(-spec.rows // BLOCK), -(-spec.cols // BLOCK)),
    }


def _within(
    values: npt.NDArray[np.integer | np.floating], low: float, high: float | npt.NDArray[np.float64]
) -> bool:
    # Written so that NaN is outside the range.
    return bool(((values >= low) & (values <= high)).all())
