"""The point cloud of the map, in tiles: only a tile whose points changed is sent again."""

from __future__ import annotations

import zlib
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import viser

from navcore.beware import NOTHING
from web.pictures import class_colours
from web.port import Cloud

BUDGET = 200_000
"""Points shown at most."""
TILE_M = 8.0
"""Side of a tile. Coordinates are sent as half floats from its middle: a step of 4 mm at its border."""
POINT_SIZE_M = 0.04

ColourMode = Literal["camera", "class"]
Tile = tuple[int, int]


class CloudLayer:
    """Points in the camera's colours, or by what they are to beware of."""

    name = "cloud"

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._sums: dict[Tile, int] = {}
        self._nodes: dict[Tile, Any] = {}
        self._shown: object = None

    def push(self, cloud: Cloud, mode: ColourMode) -> None:
        """Send the tiles that changed."""
        if self._shown == (cloud.serial, mode):
            return
        self._shown = (cloud.serial, mode)
        chosen = chosen_points(cloud.points_map)
        points, rgb = cloud.points_map[chosen], cloud.rgb[chosen]
        if mode == "class":
            rgb = coloured(points, cloud.class_ids[chosen])
        tiles = _tiles(points)
        for gone in self._nodes.keys() - tiles.keys():
            self._nodes.pop(gone).remove()
            del self._sums[gone]
        for tile, members in tiles.items():
            self._push_tile(tile, points[members], rgb[members])

    def _push_tile(self, tile: Tile, points: npt.NDArray[np.float32], rgb: npt.NDArray[np.uint8]) -> None:
        checksum = zlib.crc32(rgb.tobytes(), zlib.crc32(points.tobytes()))
        if self._sums.get(tile) == checksum:
            return
        self._sums[tile] = checksum
        middle = np.array([(tile[0] + 0.5) * TILE_M, (tile[1] + 0.5) * TILE_M, 0.0], dtype=np.float32)
        # Added anew, not updated: a viewer that joins later would get the creation and the update, both in full.
        self._nodes[tile] = self._server.scene.add_point_cloud(
            f"/cloud/{tile[0]}_{tile[1]}",
            points - middle,
            rgb,
            point_size=POINT_SIZE_M,
            point_shape="square",
            point_shading="flat",
            position=middle,
        )


def chosen_points(points: npt.NDArray[np.float32], budget: int = BUDGET) -> npt.NDArray[np.intp]:
    """Indices of at most `budget` finite points. A point's place alone decides, so that a still scene is not sent again."""
    finite = np.flatnonzero(np.isfinite(points).all(axis=1))
    if len(finite) <= budget:
        return finite
    places = np.round(points[finite] * 100).astype(np.int64).astype(np.uint64)
    mixed = places @ np.array([73856093, 19349663, 83492791], dtype=np.uint64)
    draws = (mixed * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(40)
    return finite[draws < np.uint64(int(2**24 * budget / len(finite)))][:budget]


def coloured(points: npt.NDArray[np.float32], class_ids: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """(N, 3) colours: classes in their own, everything else from dark to light by its height up to 2 m."""
    rgb = class_colours()[class_ids]
    plain = class_ids == NOTHING
    shade = np.clip(points[plain, 2] / 2.0, 0.0, 1.0)[:, None]
    rgb[plain] = (np.array([70, 84, 110]) * (1 - shade) + np.array([200, 220, 240]) * shade).astype(np.uint8)
    return rgb


def _tiles(points: npt.NDArray[np.float32]) -> dict[Tile, npt.NDArray[np.intp]]:
    if not len(points):
        return {}
    places = np.floor(points[:, :2] / TILE_M).astype(np.int64)
    unique, inverse = np.unique(places, axis=0, return_inverse=True)
    order = np.argsort(inverse.reshape(-1), kind="stable")
    ends = np.cumsum(np.bincount(inverse.reshape(-1), minlength=len(unique)))[:-1]
    return {(int(x), int(y)): members for (x, y), members in zip(unique, np.split(order, ends), strict=True)}
