"""Occupancy grid as image tiles on the floor: only changed tiles are painted and sent."""

from __future__ import annotations

from typing import Any

import viser

from web.images.encode import UNKNOWN_ALPHA, paint_floor
from web.images.tiles import Tile, TileVersions, changed_since, tile_cells
from web.viewer.layers.base import Scene

FLOOR_Z = 0.0
"""Height of the images in metres."""


class FloorLayer:
    """One image per tile, none for unknown tiles."""

    name = "floor"
    period_s = 0.35

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._tiles = TileVersions()
        self._images: dict[Tile, Any] = {}
        self._shown = 0

    def push(self, scene: Scene) -> None:
        """Send the tiles in which a cell changed, or all for another beware list."""
        newest, versions = self._tiles.update(scene.tick, scene.beware)
        for row, col in [*self._images]:  # the grid of another site may be smaller
            if row >= versions.shape[0] or col >= versions.shape[1]:
                self._images.pop((row, col)).remove()
        for tile, _ in changed_since(versions, self._shown):
            self._push_tile(tile, scene)
        self._shown = newest

    def _push_tile(self, tile: Tile, scene: Scene) -> None:
        tick, spec = scene.tick, scene.tick.grid_spec
        part = top, left, bottom, right = tile_cells(tile, tick)
        image = paint_floor(tick, scene.beware, part)
        if not image[..., 3].max() > UNKNOWN_ALPHA:
            if (old := self._images.pop(tile, None)) is not None:
                old.remove()
            return
        metre = spec.resolution_m
        x, y = (
            spec.origin_x_m + (left + right) / 2 * metre,
            spec.origin_y_m + (top + bottom) / 2 * metre,
        )
        # A new image would be drawn at the origin for one frame, which takes seconds on a slow
        # browser: the one that is there gets the contents.
        if (shown := self._images.get(tile)) is not None:
            with self._server.atomic():
                shown.render_width = (right - left) * metre
                shown.render_height = (bottom - top) * metre
                shown.position = (x, y, FLOOR_Z)
                shown.image = image
            return
        # Image rows go down, towards −y; half a turn about x puts the image face up on the floor.
        self._images[tile] = self._server.scene.add_image(
            f"/floor/{tile[0]}_{tile[1]}",
            image,
            (right - left) * metre,
            (bottom - top) * metre,
            format="png",
            cast_shadow=False,
            receive_shadow=False,
            position=(x, y, FLOOR_Z),
            wxyz=(0.0, 1.0, 0.0, 0.0),
        )
