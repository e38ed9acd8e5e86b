"""Values of the navigation as files: the map as PNG and in Nav2's format, the cloud as PLY, the
camera as JPEG."""

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
from navcore.perception.labels import Labels
from web.images import palette
from web.interface.snapshots import Cloud, TickSnapshot

Image = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]

JPEG_QUALITY = 80
UNKNOWN_ALPHA = 110
"""Of the floor in the 3D view where nothing is known."""
SCALE = 2
"""Pixels per cell and side of the painted map, so that a texture is finer than a cell."""

VIEW_M = 6.0
"""The camera measures well about so far."""
Part = tuple[int, int, int, int]
"""(top, left, bottom, right) cells, the last two excluded."""

T = TypeVar("T")


class LatestOnly(Generic[T]):
    """The last thing made, kept until its key changes: many clients ask for the same picture."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._held: tuple[Hashable, T] | None = None

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """The held value if it was made for `key`, else a new one."""
        with self._lock:
            if self._held is None or self._held[0] != key:
                self._held = (key, make())
            return self._held[1]


def paint_map(picture: TickSnapshot, beware: BewareList, part: Part | None = None) -> Image:
    """(SCALE · rows, SCALE · cols, 4) RGBA of all layers, row 0 at the top, as pictures have it.

    `part` is (top, left, bottom, right) cells of the grid; tiles painted one by one are the whole
    picture, cut.
    """
    window = part or _whole(picture)
    grid, seen, blocked = _unpacked(picture, window)
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


def paint_floor(picture: TickSnapshot, beware: BewareList, part: Part | None = None) -> Image:
    """As `paint_map`, but see-through where nothing is known, for the floor of the 3D view."""
    image = paint_map(picture, beware, part)
    grid, seen, blocked = _unpacked(picture, part or _whole(picture))
    alpha = _enlarged(
        np.where(seen | blocked | grid.occupied(), 235, UNKNOWN_ALPHA).astype(np.uint8)
    )
    image[..., 3] = alpha[::-1]
    return image


def _whole(picture: TickSnapshot) -> Part:
    return 0, 0, picture.grid_spec.rows, picture.grid_spec.cols


def _unpacked(picture: TickSnapshot, part: Part) -> tuple[OccupancyGrid, Mask, Mask]:
    """Of a part of the map: the layers, what was seen, where the robot's centre may not be."""
    return (
        picture.occupancy.part(*part),
        picture.seen_mask.window(*part),
        ~picture.occupancy.free.window(*part),
    )


def map_png(picture: TickSnapshot, beware: BewareList, part: Part | None = None) -> bytes:
    """The painted map, or a part of it, as PNG."""
    image = cv2.cvtColor(paint_map(picture, beware, part), cv2.COLOR_RGBA2BGRA)
    return _encoded(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 3])


def cells_png(picture: TickSnapshot, part: Part | None = None) -> bytes:
    """The cells of the map, or of a part of it: a pixel a cell, the uppermost row at the top.

    Red holds bits: 1 seen, 2 obstacle, 4 the robot's centre may not be here, 8 keep-out zone, 16
    prior map. Green and blue hold class ids of the beware list, the lower first where two are in
    one cell, 0 for none.
    """
    window = part or _whole(picture)
    grid, seen, blocked = _unpacked(picture, window)
    prior = None if picture.prior is None else picture.prior.window(*window)
    cells = np.zeros((*grid.geometric.shape, 3), dtype=np.uint8)
    for bit, mask in enumerate((seen, grid.geometric, blocked, _zones(grid), prior)):
        if mask is not None:
            cells[..., 0] |= mask.astype(np.uint8) << bit
    for class_id, mask in sorted(grid.beware.items()):
        second = mask & (cells[..., 1] > 0)
        cells[..., 2][second] = class_id
        cells[..., 1][mask & ~second] = class_id
    return _encoded(
        ".png", cv2.cvtColor(cells[::-1], cv2.COLOR_RGB2BGR), [cv2.IMWRITE_PNG_COMPRESSION, 3]
    )


def floor_view(picture: TickSnapshot) -> npt.NDArray[np.float64]:
    """(4, 2) corners of the floor in the camera's picture, metres of the map frame, as far as
    `VIEW_M` from it."""
    lens, camera = picture.intrinsics, picture.T_map_camera
    corners = np.array(
        [[0, 0], [lens.width, 0], [lens.width, lens.height], [0, lens.height]], dtype=np.float64
    )
    rays = pixel_rays(corners[:, 1], corners[:, 0], lens) @ camera[:3, :3].T
    flat_m = np.maximum(np.hypot(rays[:, 0], rays[:, 1]), 1e-9)
    # Where the ray meets the floor, or as far as it is drawn when it does later or never.
    with np.errstate(divide="ignore"):
        reach = np.where(rays[:, 2] < 0, -camera[2, 3] / rays[:, 2] * flat_m, np.inf)
    return np.asarray(
        camera[:2, 3] + rays[:, :2] / flat_m[:, None] * np.minimum(reach, VIEW_M)[:, None]
    )


def map_pgm(picture: TickSnapshot) -> bytes:
    """Nav2's trinary image: row 0 at the top; occupied 0, zones too, free 254, unknown 205."""
    occupied = picture.grid.occupied() | _zones(picture.grid)
    return encode(
        map_from_cells(occupied=occupied, known=picture.seen, spec=picture.grid.spec).image
    )


def map_yaml(picture: TickSnapshot) -> str:
    """Nav2's description beside `map.pgm`; the origin is the lower-left pixel's lower-left corner."""
    return yaml_text(description_of(picture.grid.spec), "map.pgm")


def cloud_ply(cloud: Cloud) -> bytes:
    """Binary little-endian PLY: x, y, z in metres of the map frame, colour, class id."""
    points = np.empty(
        len(cloud.points_map), dtype=[("xyz", "<f4", 3), ("rgb", "u1", 3), ("class_id", "u1")]
    )
    points["xyz"], points["rgb"], points["class_id"] = cloud.points_map, cloud.rgb, cloud.class_ids
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    colours = "".join(f"property uchar {name}\n" for name in ("red", "green", "blue", "class_id"))
    head = f"ply\nformat binary_little_endian 1.0\ncomment metres of the map frame\nelement vertex {len(points)}\n"
    return f"{head}{axes}{colours}end_header\n".encode() + points.tobytes()


def camera_jpg(image: Image) -> bytes:
    """A picture (H, W, 3) of the camera, or one drawn over, as JPEG."""
    return _encoded(
        ".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    )


def with_overlay(picture: TickSnapshot, beware: BewareList) -> Image:
    """(H, W, 3) the camera's picture; what binds the robot is tinted (the surer, the stronger),
    outlined and named."""
    image, binding = picture.rgb.copy(), beware_mask(picture, beware)
    for entry in beware.enabled:
        mask, colour = (
            binding & (picture.labels == entry.class_id),
            palette.class_colour(entry.class_id),
        )
        if not mask.any():
            continue
        opacity = (0.25 + 0.45 * picture.confidence[mask])[:, None]
        image[mask] = ((1 - opacity) * image[mask] + opacity * np.array(colour)).astype(np.uint8)
        outlines, _ = cv2.findContours(
            mask.view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE
        )
        cv2.drawContours(image, outlines, -1, colour, 2)
        left, top, _, _ = cv2.boundingRect(max(outlines, key=cv2.contourArea))
        _name(image, f"{entry.name} {picture.confidence[mask].mean():.0%}", left, top)
    return image


def beware_mask(picture: TickSnapshot, beware: BewareList) -> Mask:
    """(H, W) the pixels that bind the robot: the union of the enabled classes where the segmenter
    is sure enough of them."""
    return Labels(class_ids=picture.labels, confidence=picture.confidence).mask(beware)


def _name(image: Image, text: str, left: int, top: int) -> None:
    """Black-rimmed white, above the place or just below its upper edge. OpenCV draws ASCII only."""
    text = text.encode("ascii", "replace").decode()
    (wide, high), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.4, 1)
    at = min(left, max(image.shape[1] - wide - 2, 0)), top - 4 if top > high + 6 else top + high + 6
    for x, y, level in ((-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, 255)):
        place = at[0] + x, at[1] + y
        cv2.putText(
            image, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.4, (level, level, level), 1, cv2.LINE_AA
        )


def class_colours() -> npt.NDArray[np.uint8]:
    """(256, 3) colour per class id, for the points; 0 is replaced by the caller."""
    table = np.zeros((256, 3), dtype=np.uint8)
    table[1:] = [palette.class_colour(class_id) for class_id in range(1, 256)]
    return table


def _enlarged(cells: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """SCALE pixels per cell and side."""
    return np.repeat(np.repeat(cells, SCALE, axis=0), SCALE, axis=1)


def _dot_unknown(canvas: Image, mask: Mask, at: tuple[int, int]) -> None:
    """A sparse raster of dots: "not seen" must not be mistaken for "occupied" by anybody who sees
    no blue."""
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
    """Paint the cells in a solid light tone and a pattern in the full one: told apart without their
    colour too.

    `at` is where on the whole picture the canvas begins: the pattern goes on from tile to tile.
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


def _encoded(
    suffix: str, image: npt.NDArray[np.integer | np.floating], options: list[int]
) -> bytes:
    ok, data = cv2.imencode(suffix, image, options)
    if not ok:
        raise RuntimeError(f"OpenCV could not encode {suffix} of shape {image.shape}")
    return data.tobytes()
