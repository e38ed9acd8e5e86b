"""Values of the navigation as files: map as PNG and in Nav2's format, point cloud as PLY."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from typing import Any, Generic, TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from navcore.formats.map_image import encode
from navcore.formats.nav2_map import description_of, map_from_cells, yaml_text
from navcore.geometry.camera import pixel_rays
from navcore.grid.grid import OccupancyGrid
from navcore.mission.beware_list import BewareList
from web.images import palette
from web.interface.snapshots import Cloud, TickSnapshot

Image = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]

PNG_OPTIONS = [cv2.IMWRITE_PNG_COMPRESSION, 3]
KNOWN_ALPHA, UNKNOWN_ALPHA = 235, 110
"""Opacity of known and unknown cells of the floor in the 3D view, 0 to 255."""
SCALE = 2
"""Pixels per cell and side of the painted map, so that patterns are finer than a cell."""
VIEW_M = 6.0
"""Range in metres up to which the camera measures well."""
Part = tuple[int, int, int, int]
"""(top, left, bottom, right) cells, the last two excluded."""

T = TypeVar("T")


class LatestOnly(Generic[T]):
    """Cache of one value until its key changes, because many clients ask for the same image."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._cached: tuple[Hashable, T] | None = None

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return the cached value of a key, or make it."""
        with self._lock:
            if self._cached is None or self._cached[0] != key:
                self._cached = (key, make())
            return self._cached[1]


def paint_map(tick: TickSnapshot, beware: BewareList, part: Part | None = None) -> Image:
    """Return (SCALE · rows, SCALE · cols, 4) RGBA of all layers, with the largest y in the first
    row.

    `part` is (top, left, bottom, right) cells of the grid; a part is equal to the same part of the
    whole image.
    """
    window = part or _whole(tick)
    grid, seen, blocked = _unpacked(tick, window)
    at = (SCALE * window[0], SCALE * window[1])
    canvas = np.empty((*grid.geometric.shape, 4), dtype=np.uint8)
    canvas[:] = (*palette.UNKNOWN, 255)
    canvas[seen] = (*palette.FREE, 255)
    canvas[blocked & seen] = (*palette.INFLATED, 255)
    canvas[blocked & ~seen] = (*_mixed(palette.INFLATED, palette.UNKNOWN, 0.45), 255)
    canvas[grid.geometric] = (*palette.GEOMETRIC, 255)
    canvas = _enlarged(canvas)
    _dot_unknown(canvas, _enlarged(~seen & ~grid.geometric), at)
    _texture(canvas, _zones(grid), palette.ZONE, "stripes falling", period=10, at=at)
    for entry in beware.classes:
        if (cells := grid.beware.get(entry.class_id)) is not None:
            colour, pattern = (
                palette.class_colour(entry.class_id),
                palette.class_pattern(entry.class_id),
            )
            _texture(canvas, cells, colour, pattern, period=6, at=at)
    return np.ascontiguousarray(canvas[::-1])


def paint_floor(tick: TickSnapshot, beware: BewareList, part: Part | None = None) -> Image:
    """Return the image of `paint_map` with unknown cells transparent, for the 3D view."""
    image = paint_map(tick, beware, part)
    grid, seen, blocked = _unpacked(tick, part or _whole(tick))
    alpha = _enlarged(
        np.where(seen | blocked | grid.occupied(), KNOWN_ALPHA, UNKNOWN_ALPHA).astype(np.uint8)
    )
    image[..., 3] = alpha[::-1]
    return image


def _whole(tick: TickSnapshot) -> Part:
    return 0, 0, tick.grid_spec.rows, tick.grid_spec.cols


def _unpacked(tick: TickSnapshot, part: Part) -> tuple[OccupancyGrid, Mask, Mask]:
    """Return the layers, the observed and the blocked cells of a part of the map."""
    return (
        tick.occupancy.part(*part),
        tick.seen_mask.window(*part),
        ~tick.occupancy.free.window(*part),
    )


def map_png(tick: TickSnapshot, beware: BewareList, part: Part | None = None) -> bytes:
    """Return the painted map, or a part of it, as PNG."""
    image = cv2.cvtColor(paint_map(tick, beware, part), cv2.COLOR_RGBA2BGRA)
    return encoded(".png", image, PNG_OPTIONS)


def cells_png(tick: TickSnapshot, part: Part | None = None) -> bytes:
    """Return the cells of the map, or of a part of it, as PNG: one pixel per cell, uppermost row
    first.

    Red holds bits: 1 observed, 2 obstacle, 4 closed to the robot's centre, 8 keep-out zone, 16
    prior map. Green and blue hold class ids of the beware list, the lower one in green, 0 for none.
    """
    window = part or _whole(tick)
    grid, seen, blocked = _unpacked(tick, window)
    prior = None if tick.prior is None else tick.prior.window(*window)
    cells = np.zeros((*grid.geometric.shape, 3), dtype=np.uint8)
    for bit, mask in enumerate((seen, grid.geometric, blocked, _zones(grid), prior)):
        if mask is not None:
            cells[..., 0] |= mask.astype(np.uint8) << bit
    for class_id, mask in sorted(grid.beware.items()):
        second = mask & (cells[..., 1] > 0)
        cells[..., 2][second] = class_id
        cells[..., 1][mask & ~second] = class_id
    return encoded(".png", cv2.cvtColor(cells[::-1], cv2.COLOR_RGB2BGR), PNG_OPTIONS)


def floor_view(tick: TickSnapshot) -> npt.NDArray[np.float64]:
    """Return (4, 2) corners of the floor in view of the camera, up to `VIEW_M` away, in metres of
    the map frame."""
    lens, camera = tick.intrinsics, tick.T_map_camera
    corners = np.array(
        [[0, 0], [lens.width, 0], [lens.width, lens.height], [0, lens.height]], dtype=np.float64
    )
    rays = pixel_rays(corners[:, 1], corners[:, 0], lens) @ camera[:3, :3].T
    flat_m = np.maximum(np.hypot(rays[:, 0], rays[:, 1]), 1e-9)
    # Distance to the floor along each ray, infinite for rays above the horizon.
    with np.errstate(divide="ignore"):
        reach = np.where(rays[:, 2] < 0, -camera[2, 3] / rays[:, 2] * flat_m, np.inf)
    return np.asarray(
        camera[:2, 3] + rays[:, :2] / flat_m[:, None] * np.minimum(reach, VIEW_M)[:, None]
    )


def map_pgm(tick: TickSnapshot, *, zones: bool = False) -> bytes:
    """Return Nav2's trinary image, row 0 at the top: occupied 0, free 254, unknown 205; with
    `zones` the keep-out zones are occupied, too."""
    occupied = tick.grid.geometric.copy()
    for layer in tick.grid.beware.values():
        occupied |= layer
    if zones:
        occupied |= _zones(tick.grid)
    return encode(map_from_cells(occupied=occupied, known=tick.seen, spec=tick.grid.spec).image)


def map_yaml(tick: TickSnapshot) -> str:
    """Return Nav2's description of `map.pgm`; the origin is the lower-left corner of the map."""
    return yaml_text(description_of(tick.grid.spec), "map.pgm")


def cloud_ply(cloud: Cloud) -> bytes:
    """Return binary little-endian PLY: x, y, z in metres of the map frame, colour, class id."""
    points = np.empty(
        len(cloud.points_map), dtype=[("xyz", "<f4", 3), ("rgb", "u1", 3), ("class_id", "u1")]
    )
    points["xyz"], points["rgb"], points["class_id"] = cloud.points_map, cloud.rgb, cloud.class_ids
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    colours = "".join(f"property uchar {name}\n" for name in ("red", "green", "blue", "class_id"))
    head = (
        "ply\nformat binary_little_endian 1.0\ncomment metres of the map frame\n"
        f"element vertex {len(points)}\n"
    )
    return f"{head}{axes}{colours}end_header\n".encode() + points.tobytes()


def class_colours() -> npt.NDArray[np.uint8]:
    """Return (256, 3) colours by class id; the row of 0 is black."""
    table = np.zeros((256, 3), dtype=np.uint8)
    table[1:] = [palette.class_colour(class_id) for class_id in range(1, 256)]
    return table


def _enlarged(cells: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Repeat cells to `SCALE` pixels per side."""
    return np.repeat(np.repeat(cells, SCALE, axis=0), SCALE, axis=1)


def _dot_unknown(canvas: Image, mask: Mask, at: tuple[int, int]) -> None:
    """Draw sparse dots, so that unknown and occupied cells differ without colour vision, too."""
    raster = np.s_[-at[0] % 8 :: 8, -at[1] % 8 :: 8]
    canvas[raster][mask[raster], :3] = palette.UNKNOWN_DOT


def _zones(grid: OccupancyGrid) -> Mask:
    mask = grid.zones
    for _, wide in grid.wide_zones:
        mask = mask | wide
    return mask


def _texture(
    canvas: Image,
    cells: Mask,
    colour: palette.Rgb,
    pattern: str,
    *,
    period: int,
    at: tuple[int, int],
) -> None:
    """Paint cells in a light tone with a pattern in the full tone, distinct without colour vision.

    `at` is the position of the canvas in the whole image, so that patterns continue across tiles.
    """
    i, j = np.nonzero(_enlarged(cells))
    strong = _pattern(pattern, i + at[0], j + at[1], period)
    light = np.array(_mixed(colour, (255, 255, 255), 0.62), dtype=np.uint8)
    canvas[i, j, :3] = np.where(strong[:, None], np.array(colour, dtype=np.uint8), light)
    canvas[i, j, 3] = 255


def _pattern(name: str, i: npt.NDArray[np.intp], j: npt.NDArray[np.intp], period: int) -> Mask:
    half = period // 2
    patterns: dict[str, Callable[[], Mask]] = {
        "stripes rising": lambda: (i - j) % period < half,
        "stripes falling": lambda: (i + j) % period < half,
        "dots": lambda: (i % period < half) & (j % period < half),
        "grid": lambda: (i % period < half - 1) | (j % period < half - 1),
        "bars": lambda: i % period < half,
        "columns": lambda: j % period < half,
    }
    return patterns[name]()


def _mixed(colour: palette.Rgb, other: palette.Rgb, share: float) -> palette.Rgb:
    r, g, b = (round(share * a + (1 - share) * c) for a, c in zip(colour, other, strict=True))
    return r, g, b


def encoded(suffix: str, image: npt.NDArray[np.integer | np.floating], options: list[int]) -> bytes:
    """Return an image in the format of a file name's suffix."""
    ok, data = cv2.imencode(suffix, image, options)
    if not ok:
        raise RuntimeError(f"OpenCV could not encode {suffix} of shape {image.shape}")
    return data.tobytes()
