"""Region growing from a clicked pixel: the pixels of the object there, and its outline on the
floor."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
import shapely

from navcore.config.perception import DEFAULT_PERCEPTION, RegionGrowingConfig
from navcore.errors import BadGeometry
from navcore.geometry.arrays import FloatImage, Floats
from navcore.geometry.camera import Intrinsics, back_project_pixels
from navcore.geometry.polyline import Corners
from navcore.geometry.transform import Matrix, transform_points
from navcore.grid.grid import BoolGrid

_DEFAULT = DEFAULT_PERCEPTION.region_growing


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Region:
    """The object at a clicked pixel."""

    pixels: BoolGrid
    """(H, W) pixels of the object."""
    class_id: int
    """Class id of the beware list; 0 for an object that was separated by depth alone."""
    footprint: Corners
    """Outline on the floor: corners (x, y) in metres of the map frame."""


def region_at(
    row: int,
    col: int,
    *,
    class_ids: npt.NDArray[np.uint8],
    depth_m: FloatImage,
    intrinsics: Intrinsics,
    T_map_camera: Matrix,
    config: RegionGrowingConfig = _DEFAULT,
) -> Region:
    """Return the connected pixels of one class around a pixel of (H, W) images or, where there is
    no class, those of one object by depth.

    Raises `BadGeometry` with the reason where no object can be separated.
    """
    height, width = class_ids.shape
    if not (0 <= row < height and 0 <= col < width):
        raise BadGeometry(f"pixel ({row}, {col}) lies outside the image of {height} × {width}")
    points = _point_image(depth_m, intrinsics, T_map_camera, config.max_range_m)
    class_id = int(class_ids[row, col])
    pixels = (
        _connected(class_ids == class_id, row, col)
        if class_id
        else _grow(depth_m, points[..., 2], row, col, config)
    )
    return Region(pixels=pixels, class_id=class_id, footprint=_footprint(points[pixels], config))


def _point_image(
    depth_m: FloatImage, lens: Intrinsics, T_map_camera: Matrix, max_range_m: float
) -> Floats:
    """Return (H, W, 3) points in metres of the map frame; NaN where nothing was measured."""
    rows, cols = np.mgrid[: depth_m.shape[0], : depth_m.shape[1]]
    z = np.where((depth_m > 0) & (depth_m < max_range_m), depth_m, np.nan)
    optical = back_project_pixels(rows, cols, z, lens)
    return transform_points(T_map_camera, optical.reshape(-1, 3)).reshape(*depth_m.shape, 3)


def _connected(mask: BoolGrid, row: int, col: int) -> BoolGrid:
    """Return the (H, W) component of a mask that holds a pixel."""
    _, parts = cv2.connectedComponents(mask.view(np.uint8), connectivity=8)
    return np.asarray(parts == parts[row, col])


def _grow(
    depth_m: FloatImage, height_m: Floats, row: int, col: int, config: RegionGrowingConfig
) -> BoolGrid:
    """Return the (H, W) pixels above the floor that are connected with a pixel without a step of
    depth."""
    if np.isnan(height_m[row, col]):
        raise BadGeometry(
            "the camera has measured no distance there; click nearer to the middle of the object"
        )
    if height_m[row, col] < config.floor_m:
        raise BadGeometry(
            "there is only floor there; click an object that stands on it, or draw the zone on the "
            "map"
        )
    outside = np.pad(~(height_m >= config.floor_m), 1, constant_values=True).astype(np.uint8)
    near = np.ascontiguousarray(depth_m, dtype=np.float32)
    cv2.floodFill(
        near.copy(),
        outside,
        (col, row),
        0.0,
        config.depth_step_m,
        config.depth_step_m,
        8 | cv2.FLOODFILL_MASK_ONLY | (2 << 8),
    )
    return np.asarray(outside[1:-1, 1:-1] == 2)


def _footprint(points_map: Floats, config: RegionGrowingConfig) -> Corners:
    """Return the outline on the floor of (N, 3) points; gaps of a cell are closed, and only the
    largest part counts."""
    good = np.isfinite(points_map).all(axis=1) & (points_map[:, 2] < config.ceiling_m)
    xy, cell_m = points_map[good, :2], config.cell_m
    if len(xy) < config.min_pixels:
        raise BadGeometry(
            f"only {len(xy)} pixels of the object have a distance, {config.min_pixels} are needed; "
            "drive nearer"
        )
    low = xy.min(axis=0) - 3 * cell_m
    cells = np.floor((xy - low) / cell_m).astype(np.int64)
    mask = np.zeros(cells.max(axis=0)[::-1] + 4, dtype=np.uint8)
    mask[cells[:, 1], cells[:, 0]] = 1
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((5, 5), dtype=np.uint8))
    mask = cv2.dilate(mask, np.ones((3, 3), dtype=np.uint8))
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    ring = max(outlines, key=cv2.contourArea).reshape(-1, 2)
    outline = shapely.Polygon(low + (ring + 0.5) * cell_m).buffer(0).simplify(cell_m)
    if not isinstance(outline, shapely.Polygon) or outline.is_empty:
        raise BadGeometry(
            "the object is too small or too thin for a zone; draw the zone on the map"
        )
    return tuple((round(float(x), 3), round(float(y), 3)) for x, y in outline.exterior.coords[:-1])
