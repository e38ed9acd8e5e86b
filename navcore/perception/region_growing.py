"""Region growing from a clicked pixel: the pixels of the object there, by depth and colour, and its
outline on the floor."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
import shapely

from navcore.config.perception.perception import DEFAULT_PERCEPTION, RegionGrowingConfig
from navcore.config.perception.prototype import PrototypeConfig
from navcore.errors import BadGeometry, Refused
from navcore.geometry.arrays import Bools, FloatImage, Floats
from navcore.geometry.camera import Intrinsics, back_project_pixels
from navcore.geometry.polyline import Corners
from navcore.geometry.transform import Matrix, transform_points
from navcore.grid.grid import BoolGrid
from navcore.perception.depth_filter import heights_above_floor
from navcore.perception.prototype import extent_m, lab_image
from navcore.robot.frame import Frame

_DEFAULT, _BY_EXAMPLE = DEFAULT_PERCEPTION.region_growing, DEFAULT_PERCEPTION.prototype
_LEAST_M = 1e-3
"""Depth in metres in place of none, which has no logarithm."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Region:
    """The object at a clicked pixel."""

    pixels: BoolGrid
    """(H, W) pixels of the object."""
    class_id: int
    """Class id of the beware list; 0 for an object that was separated by depth alone."""
    footprint: Corners
    """Outline on the floor: corners (x, y) in metres of the map frame."""


def grown(
    row: int,
    col: int,
    allowed: Bools,
    image: npt.NDArray[np.float32] | None = None,
    step: float = 0.0,
    *,
    diagonal: bool = True,
) -> Bools:
    """Return the allowed (H, W) pixels that are connected with a pixel without a larger step
    between neighbours in an image of depth (H, W) or colour (H, W, 3); without an image, all that
    are connected with it. `diagonal`: whether pixels that touch at a corner are neighbours."""
    outside = np.pad(~allowed, 1, constant_values=True).astype(np.uint8)
    values = np.zeros(allowed.shape, np.float32) if image is None else image.astype(np.float32)
    steps = (step,) * (values.shape[2] if values.ndim == 3 else 1)
    flags = (8 if diagonal else 4) | cv2.FLOODFILL_MASK_ONLY | (2 << 8)
    cv2.floodFill(np.ascontiguousarray(values), outside, (col, row), 0.0, steps, steps, flags)
    return np.asarray(outside[1:-1, 1:-1] == 2)


def object_at(frame: Frame, row: int, col: int, config: PrototypeConfig = _BY_EXAMPLE) -> Bools:
    """Return the (H, W) pixels of the object at a pixel: those above the floor that are connected
    with it without a step of depth, and among them without a step of colour, holes filled.

    Raises `Refused` with the reason where there is no object of its own.
    """
    heights_m = heights_above_floor(frame)
    if frame.depth_m[row, col] <= 0:
        raise Refused(
            "the camera has measured no distance there; click nearer to the middle of the thing"
        )
    if frame.depth_m[row, col] > config.max_range_m:
        raise Refused(f"that is farther away than {config.max_range_m:g} m; drive nearer")
    if heights_m[row, col] < config.floor_m:
        raise Refused(
            "there is only floor there; click a thing that stands on it, or make a colour rule for "
            "a marking"
        )
    inside = grown(row, col, heights_m >= config.floor_m, frame.depth_m, config.depth_step_m)
    smooth = cv2.bilateralFilter(lab_image(frame.rgb), 5, 2 * config.colour_step, 2)
    colour = np.asarray(smooth, dtype=np.float32)
    pixels = _without_holes(grown(row, col, inside, colour, config.colour_step)) & inside
    width_m = extent_m(pixels, frame)
    if width_m > config.max_extent_m:
        raise Refused(
            f"what was clicked is {width_m:.1f} m wide: furniture or a wall, which are obstacles "
            "anyway; click the middle of a smaller thing"
        )
    return pixels


def alike_at(
    row: int,
    col: int,
    *,
    rgb: npt.NDArray[np.uint8],
    depth_m: FloatImage,
    tolerance: float,
    depth_step_m: float,
    max_share: float,
) -> Bools:
    """Return the (H, W) pixels that are connected with a pixel, within `tolerance` of the mean
    colour around it in CIE L*a*b*, and without a step of depth between neighbours: `depth_step_m`
    one metre away, more the farther away, as the step between the rows of a floor is.

    Where the clicked pixel has no depth, colour alone decides. Raises `BadGeometry` for a pixel
    outside the image, `Refused` for a region that takes more than `max_share` of it.
    """
    _check_inside(row, col, depth_m.shape)
    lab = lab_image(rgb)
    around = lab[max(row - 1, 0) : row + 2, max(col - 1, 0) : col + 2].reshape(-1, 3)
    fits = np.linalg.norm(lab - around.mean(axis=0), axis=2) <= tolerance
    fits[row, col] = True
    depth = np.log(np.maximum(depth_m, _LEAST_M)) if depth_m[row, col] > 0 else None
    region = grown(row, col, fits, depth, float(np.log1p(depth_step_m)), diagonal=False)
    if region.mean() > max_share:
        raise Refused(
            f"the region takes {region.mean():.0%} of the image; take a smaller tolerance, "
            "or use the brush"
        )
    return region


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
    _check_inside(row, col, class_ids.shape)
    points = _point_image(depth_m, intrinsics, T_map_camera, config.max_range_m)
    class_id = int(class_ids[row, col])
    pixels = (
        grown(row, col, class_ids == class_id)
        if class_id
        else _above_floor(depth_m, points[..., 2], row, col, config)
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


def _check_inside(row: int, col: int, shape: tuple[int, ...]) -> None:
    height, width = shape
    if not (0 <= row < height and 0 <= col < width):
        raise BadGeometry(f"pixel ({row}, {col}) lies outside the image of {height} × {width}")


def _above_floor(
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
    return grown(row, col, height_m >= config.floor_m, depth_m, config.depth_step_m)


def _without_holes(pixels: Bools) -> Bools:
    """Return pixels with the holes that they enclose, and narrow gaps, filled."""
    closed = cv2.morphologyEx(
        pixels.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), dtype=np.uint8)
    )
    outlines, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(cv2.drawContours(closed, outlines, -1, 1, cv2.FILLED) > 0)


def _footprint(points_map: Floats, config: RegionGrowingConfig) -> Corners:
    """Return the outline on the floor of (N, 3) points; gaps of a cell are closed, and only the
    largest part counts."""
    good = np.isfinite(points_map).all(axis=1) & (points_map[:, 2] < config.ceiling_m)
    xy, cell_m = points_map[good, :2], config.cell_m
    if len(xy) < config.min_pixels:
        raise BadGeometry(
            f"too little of the object has a distance, {len(xy)} of {config.min_pixels} pixels; "
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
