"""From a click in the camera's picture to a place on the floor: the pixels of what was clicked, and
where it stands."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
import shapely

from navcore.errors import BadGeometry
from navcore.geometry.camera import Intrinsics
from navcore.geometry.polyline import Corners
from navcore.geometry.transform import Matrix, transform_points
from navcore.grid.grid import BoolGrid

FLOOR_M = 0.04
"""What is lower is floor, as far as telling things apart by their depth is concerned."""
CEILING_M = 2.0
"""What is higher does not stand in anybody's way."""
STEP_M = 0.06
"""Neighbouring pixels whose distances differ by more belong to different things."""
CELL_M = 0.025
FARTHEST_M = 8.0
LEAST_PIXELS = 12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Region:
    """What was clicked."""

    pixels: BoolGrid
    """(H, W) the pixels that show it."""
    class_id: int
    """Of the beware list; 0 for something told apart by its depth alone."""
    footprint: Corners
    """Where it is on the floor: corners (x, y) in metres of the map frame."""


def region_at(
    row: int,
    col: int,
    *,
    class_ids: npt.NDArray[np.uint8],
    depth_m: npt.NDArray[np.float32],
    intrinsics: Intrinsics,
    T_map_camera: Matrix,
) -> Region:
    """The connected pixels of one class about a pixel of (H, W) pictures or, where no class is,
    those of one thing by depth.

    Raises `BadGeometry` with the reason where nothing can be told apart.
    """
    height, width = class_ids.shape
    if not (0 <= row < height and 0 <= col < width):
        raise BadGeometry(f"pixel ({row}, {col}) lies outside the picture of {height} × {width}")
    points = _points_map(depth_m, intrinsics, T_map_camera)
    class_id = int(class_ids[row, col])
    pixels = (
        _connected(class_ids == class_id, row, col)
        if class_id
        else _by_depth(depth_m, points[..., 2], row, col)
    )
    return Region(pixels=pixels, class_id=class_id, footprint=_footprint(points[pixels]))


def _points_map(
    depth_m: npt.NDArray[np.float32], lens: Intrinsics, T_map_camera: Matrix
) -> npt.NDArray[np.float64]:
    """(H, W, 3) metres of the map frame; NaN where nothing was measured."""
    rows, cols = np.mgrid[: depth_m.shape[0], : depth_m.shape[1]]
    z = np.where((depth_m > 0) & (depth_m < FARTHEST_M), depth_m, np.nan).astype(np.float64)
    optical = np.stack([(cols - lens.cx) * z / lens.fx, (rows - lens.cy) * z / lens.fy, z], axis=-1)
    return transform_points(T_map_camera, optical.reshape(-1, 3)).reshape(*depth_m.shape, 3)


def _connected(mask: BoolGrid, row: int, col: int) -> BoolGrid:
    _, parts = cv2.connectedComponents(mask.view(np.uint8), connectivity=8)
    return np.asarray(parts == parts[row, col])


def _by_depth(
    depth_m: npt.NDArray[np.float32], height_m: npt.NDArray[np.float64], row: int, col: int
) -> BoolGrid:
    if np.isnan(height_m[row, col]):
        raise BadGeometry(
            "the camera has measured no distance there; click a place nearer to the middle of the thing"
        )
    if height_m[row, col] < FLOOR_M:
        raise BadGeometry(
            "there is nothing but floor there; click a thing that stands on it, or draw the zone on the map"
        )
    outside = np.pad(~(height_m >= FLOOR_M), 1, constant_values=True).astype(np.uint8)
    near = np.ascontiguousarray(depth_m, dtype=np.float32)
    cv2.floodFill(
        near.copy(),
        outside,
        (col, row),
        0.0,
        STEP_M,
        STEP_M,
        8 | cv2.FLOODFILL_MASK_ONLY | (2 << 8),
    )
    return np.asarray(outside[1:-1, 1:-1] == 2)


def _footprint(points_map: npt.NDArray[np.float64]) -> Corners:
    """The outline on the floor of (N, 3) points; gaps of a cell are closed, stray points left out."""
    good = np.isfinite(points_map).all(axis=1) & (points_map[:, 2] < CEILING_M)
    places = points_map[good, :2]
    if len(places) < LEAST_PIXELS:
        raise BadGeometry(
            f"only {len(places)} pixels of it have a distance, {LEAST_PIXELS} are needed; drive nearer"
        )
    low = places.min(axis=0) - 3 * CELL_M
    cells = np.floor((places - low) / CELL_M).astype(np.int64)
    mask = np.zeros(cells.max(axis=0)[::-1] + 4, dtype=np.uint8)
    mask[cells[:, 1], cells[:, 0]] = 1
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((5, 5), dtype=np.uint8))
    mask = cv2.dilate(mask, np.ones((3, 3), dtype=np.uint8))
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    ring = max(outlines, key=cv2.contourArea).reshape(-1, 2)
    outline = shapely.Polygon(low + (ring + 0.5) * CELL_M).buffer(0).simplify(CELL_M)
    if not isinstance(outline, shapely.Polygon) or outline.is_empty:
        raise BadGeometry("it is too small or too thin to make a zone of; draw the zone on the map")
    return tuple((round(float(x), 3), round(float(y), 3)) for x, y in outline.exterior.coords[:-1])
