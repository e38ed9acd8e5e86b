"""Everything that a global map knows, as a value: what is kept of it when the program ends."""

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
"""So far off the grid a point may be stored: it is kept in single precision."""
_HIGHEST_M = 1000.0
"""What is said to be higher or deeper is no measurement."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapState:
    """A map at one moment, complete: a map that is made of it goes on as the first one would have."""

    spec: GridSpec
    """Where the grid lies."""
    points: MapPoints
    """All points in their order, each with the ID of the pose that it belongs to."""
    poses: npt.NDArray[np.float64]
    """(P, 3) x, y in metres of the map frame and yaw in radians of each pose, by its ID."""
    seen: CellMask
    """Cells in which the camera has measured anything."""
    looked: CellMask
    """Cells over which a line of sight has passed."""
    trodden: CellMask
    """Cells that the robot has stood on."""
    prior: CellMask
    """Cells that are occupied on a map from elsewhere, and that the camera has not seen free."""
    volume: npt.NDArray[np.uint64]
    """(⌈rows / 4⌉, ⌈cols / 4⌉) blocks, a bit for each height bin that was looked into."""


def check_state(state: MapState, where: str) -> None:
    """Raise `BadConfiguration` with the part that no map can have made; `where` names the file."""
    for name, fits in _rules(state).items():
        if not fits:
            raise BadConfiguration(
                f"{where}: {name}: holds values that no map has; the file was made by something else"
            )


def _rules(state: MapState) -> dict[str, bool]:
    """Part → whether its values are possible."""
    points, spec = state.points, state.spec
    # How high a point may be is said of the ground there, and how high that is nobody knows.
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
    masks = (state.seen, state.looked, state.trodden, state.prior)
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
    # Written so that NaN is outside.
    return bool(((values >= low) & (values <= high)).all())
