"""Point cloud of the map in tiles: only a tile whose points changed is sent again.

A compiled pass over all points, some nanoseconds each, finds the changed tiles; all further work is
done for these. The share of the shown points is halved or doubled as a whole, and rarely: a share
that followed the number of points would change every tile with every new point.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import viser

from navcore.compiled import compiled
from navcore.mission.beware_list import NOTHING
from web.images.encode import class_colours
from web.interface.snapshots import Cloud

BUDGET = 200_000
"""Largest number of shown points."""
TILE_M = 8.0
"""Side of a tile in metres. Coordinates are sent as half floats from its centre, with a resolution
of 4 mm at its border."""
POINT_SIZE_M = 0.04
"""Size of a drawn point in metres."""
MAX_TILES = 1 << 20
"""Largest number of tiles of the bounding box."""
HIGH_M = 2.0
"""Height in metres from which the colour no longer changes."""

ColourMode = Literal["camera", "class", "height"]
Tile = tuple[int, int]
Points = npt.NDArray[np.float32]
Colours = npt.NDArray[np.uint8]


class CloudLayer:
    """Point cloud coloured by the camera, by height, or by class, below a node of its own."""

    def __init__(
        self, server: viser.ViserServer, node: str, mode: ColourMode, *, budget: int = BUDGET
    ) -> None:
        self._server, self._node, self._mode, self._budget = server, node, mode, budget
        self._sums: dict[Tile, int] = {}
        self._nodes: dict[Tile, Any] = {}
        self._shown: object = None
        self._drawn_as: object = None
        self._halvings = 0

    def clear(self) -> None:
        """Remove all tiles: no client shows these colours."""
        for node in self._nodes.values():
            node.remove()
        self._nodes.clear()
        self._sums.clear()
        self._shown = None

    def push(self, cloud: Cloud) -> int:
        """Send the changed tiles and return their number."""
        if self._shown == cloud.serial:
            return 0
        self._shown = cloud.serial
        tile_of, tiles, sums = index_tiles(cloud)
        self._halvings = halvings(int((tile_of >= 0).sum()), self._budget, self._halvings)
        if self._drawn_as != self._halvings:
            self._drawn_as = self._halvings
            self._sums.clear()
        changed = np.array(
            [self._sums.get(tile) != total for tile, total in zip(tiles, sums, strict=True)],
            dtype=np.bool_,
        )
        for gone in self._nodes.keys() - set(tiles):
            self._nodes.pop(gone).remove()
            self._sums.pop(gone, None)
        chosen = np.flatnonzero((tile_of >= 0) & changed[tile_of])
        chosen = chosen[is_kept(cloud.points_map[chosen], self._halvings)]
        order = chosen[np.argsort(tile_of[chosen], kind="stable")]
        borders = np.searchsorted(tile_of[order], np.arange(len(tiles) + 1))
        for index in np.flatnonzero(changed):
            members = order[borders[index] : borders[index + 1]]
            self._sums[tiles[index]] = sums[index]
            self._push_tile(
                tiles[index],
                cloud.points_map[members],
                self._colours(cloud, members),
            )
        return int(changed.sum())

    def _colours(self, cloud: Cloud, members: npt.NDArray[np.intp]) -> Colours:
        points = cloud.points_map[members]
        if self._mode == "camera":
            return cloud.rgb[members]
        if self._mode == "height":
            return height_shading(points)
        return class_shading(points, cloud.class_ids[members])

    def _push_tile(self, tile: Tile, points: Points, rgb: Colours) -> None:
        middle = np.array(
            [(tile[0] + 0.5) * TILE_M, (tile[1] + 0.5) * TILE_M, 0.0], dtype=np.float32
        )
        # Replaced, not updated: a viewer that joins later would get both creation and update.
        self._nodes[tile] = self._server.scene.add_point_cloud(
            f"/{self._node}/{tile[0]}_{tile[1]}",
            points - middle,
            rgb,
            point_size=POINT_SIZE_M,
            point_shape="square",
            point_shading="flat",
            position=middle,
        )


def index_tiles(cloud: Cloud) -> tuple[npt.NDArray[np.int32], list[Tile], list[int]]:
    """Return (N,) the tile index of each point, −1 for points that are not finite; the tiles; and a
    checksum of each tile's points, which does not depend on their order."""
    low_col, low_row, high_col, high_row = _extent(cloud.points_map, TILE_M)
    if high_col < low_col:
        return np.full(len(cloud.points_map), -1, dtype=np.int32), [], []
    cols, rows = high_col - low_col + 1, high_row - low_row + 1
    if cols * rows > MAX_TILES:
        raise ValueError(
            f"the cloud covers {cols} × {rows} tiles of {TILE_M:g} m; "
            "some of its points are far off the map"
        )
    tiles_of, sums = (
        np.full(len(cloud.points_map), -1, dtype=np.int32),
        np.zeros(cols * rows, dtype=np.uint64),
    )
    bits = np.ascontiguousarray(cloud.points_map).view(np.uint32)
    _index_points(
        cloud.points_map,
        bits,
        cloud.rgb,
        cloud.class_ids,
        TILE_M,
        low_col,
        low_row,
        cols,
        tiles_of,
        sums,
    )
    used = np.unique(tiles_of[tiles_of >= 0])
    rank = np.full(
        cols * rows + 1, -1, dtype=np.int32
    )  # the last element is for points without a tile
    rank[used] = np.arange(len(used))
    return (
        rank[tiles_of],
        [(int(at % cols) + low_col, int(at // cols) + low_row) for at in used],
        [int(sums[at]) for at in used],
    )


def halvings(count: int, budget: int, before: int) -> int:
    """Return how often the points are halved to keep the budget; with hysteresis, so that it does
    not alternate."""
    wanted = 0
    while count >> wanted > budget:
        wanted += 1
    return before if before == wanted + 1 and count >> wanted > 0.8 * budget else wanted


def is_kept(points: Points, halved: int) -> npt.NDArray[np.bool_]:
    """Return (N,) True for one point in 2^`halved`, chosen by position alone, so that a still scene
    is not sent again."""
    if halved == 0:
        return np.ones(len(points), dtype=np.bool_)
    tiles_of = np.round(points * 100).astype(np.int64).astype(np.uint64)
    mixed = tiles_of @ np.array([73856093, 19349663, 83492791], dtype=np.uint64)
    draws = (mixed * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(40)
    return np.asarray(draws < np.uint64(2**24 >> halved))


def class_shading(points: Points, class_ids: npt.NDArray[np.uint8]) -> Colours:
    """Return (N, 3) colours: of the class, or from dark to light by height."""
    rgb = class_colours()[class_ids]
    plain = class_ids == NOTHING
    shade = np.clip(points[plain, 2] / HIGH_M, 0.0, 1.0)[:, None]
    rgb[plain] = (np.array([70, 84, 110]) * (1 - shade) + np.array([200, 220, 240]) * shade).astype(
        np.uint8
    )
    return rgb


def height_shading(points: Points) -> Colours:
    """Return (N, 3) colours by height: dark blue, teal, green, yellow, of increasing brightness."""
    stops = np.array(
        [[59, 62, 140], [38, 120, 142], [68, 190, 112], [253, 231, 37]], dtype=np.float64
    )
    at = np.clip(points[:, 2] / HIGH_M, 0.0, 1.0) * (len(stops) - 1)
    return np.column_stack(
        [np.interp(at, np.arange(len(stops)), stops[:, channel]) for channel in range(3)]
    ).astype(np.uint8)


@compiled
def _extent(points: Points, side_m: float) -> tuple[int, int, int, int]:
    """Return the first and last column and row of tiles with a finite point."""
    low_col, low_row, high_col, high_row = 1 << 40, 1 << 40, -(1 << 40), -(1 << 40)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        if np.isfinite(x) and np.isfinite(y) and np.isfinite(z):
            col, row = int(np.floor(x / side_m)), int(np.floor(y / side_m))
            low_col, low_row = min(low_col, col), min(low_row, row)
            high_col, high_row = max(high_col, col), max(high_row, row)
    return low_col, low_row, high_col, high_row


@compiled
def _index_points(
    points: Points,
    bits: npt.NDArray[np.uint32],
    rgb: Colours,
    class_ids: npt.NDArray[np.uint8],
    side_m: float,
    low_col: int,
    low_row: int,
    cols: int,
    tiles_of: npt.NDArray[np.int32],
    sums: npt.NDArray[np.uint64],
) -> None:
    """Write the tile of each finite point, and add a hash of the point to the tile's checksum."""
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        if not (np.isfinite(x) and np.isfinite(y) and np.isfinite(points[i, 2])):
            continue
        at = (int(np.floor(y / side_m)) - low_row) * cols + int(np.floor(x / side_m)) - low_col
        tiles_of[i] = at
        mixed = np.uint64(bits[i, 0]) * np.uint64(0x9E3779B97F4A7C15) ^ np.uint64(
            bits[i, 1]
        ) * np.uint64(0xC2B2AE3D27D4EB4F)
        mixed ^= np.uint64(bits[i, 2]) * np.uint64(0x165667B19E3779F9)
        shade_bits = (
            np.uint64(rgb[i, 0]) << np.uint64(24)
            | np.uint64(rgb[i, 1]) << np.uint64(16)
            | np.uint64(rgb[i, 2]) << np.uint64(8)
        )
        mixed = (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9) + (
            shade_bits | np.uint64(class_ids[i])
        )
        sums[at] += (mixed ^ (mixed >> np.uint64(32))) * np.uint64(0x94D049BB133111EB)
