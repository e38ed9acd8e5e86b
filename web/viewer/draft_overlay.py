"""One operator's view: what the draft looks like, and what clicks and drags in it report to the
page. Others do not see it."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import viser

from navcore.grid.grid import GridSpec
from web.images import palette
from web.viewer.layers.geometry import closed_ring, handle_mesh, polyline_segments
from web.viewer.messages import Draft, Highlight
from web.viewer.picking import Point, clamped, floor_point

log = logging.getLogger(__name__)

DRAFT_Z = 0.09
MARK_Z = 0.12
HANDLE_M = 0.13

Post = Callable[[dict[str, Any]], None]


class DraftOverlay:
    """The draft in one client's scene."""

    def __init__(
        self, client: viser.ClientHandle, post: Post, spec: Callable[[], GridSpec | None]
    ) -> None:
        self._client, self._post, self._spec = client, post, spec
        self._handles: Any = None
        self._marked: Any = None
        self._count = 0
        self._draggable = False
        self._nodes: dict[str, Any] = {}
        # Taken all the time, not only while picking: to ask the browser for them would cost the
        # first click of a mode. A coroutine, so that quick clicks keep their order; viser awaits
        # it, though its signature does not say so.
        client.scene.on_click()(self._clicked)  # type: ignore[arg-type]

    def show(self, draft: Draft) -> None:
        """Draw the draft; its corners can be dragged while it is edited."""
        corners = np.array(draft.corners, dtype=np.float64).reshape(-1, 2)
        # What the corners stand for: a circle has two.
        shape = np.array(draft.outline or draft.corners, dtype=np.float64).reshape(-1, 2)
        with self._client.atomic():
            self._line(
                "outline", closed_ring(shape) if len(shape) > 2 else shape, palette.DRAFT, 0.06
            )
            self._line(
                "path", np.array(draft.path, dtype=np.float64).reshape(-1, 2), palette.DRAFT, 0.04
            )
            self._show_handles(corners, draggable=draft.mode == "edit")

    def mark(self, mark: Highlight) -> None:
        """Draw the explained path and the place of a jump; each replaces what was marked before."""
        lines = [
            (line.colour, np.array(line.points).reshape(-1, 2))
            for line in mark.lines
            if len(line.points) > 1
        ]
        if mark.place is not None:
            around = np.array(mark.place) + 0.4 * np.array(
                [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]]
            )
            lines.append(("#f0b429", closed_ring(around)))
        with self._client.atomic():
            if self._marked is not None:
                self._marked.remove()
                self._marked = None
            if lines:
                segments = [polyline_segments(points, MARK_Z) for _, points in lines]
                colours = [
                    np.tile(_rgb(colour), (len(part), 2, 1))
                    for (colour, _), part in zip(lines, segments, strict=True)
                ]
                self._marked = self._client.scene.add_line_segments(
                    "/mark", np.concatenate(segments), np.concatenate(colours), thickness=0.12
                )

    def _line(self, name: str, points: Any, colour: palette.Rgb, thickness: float) -> None:
        if (old := self._nodes.pop(name, None)) is not None and len(points) < 2:
            old.remove()
        if len(points) >= 2:
            self._nodes[name] = self._client.scene.add_line_segments(
                f"/draft/{name}", polyline_segments(points, DRAFT_Z), colour, thickness=thickness
            )

    def _show_handles(self, corners: Any, *, draggable: bool) -> None:
        positions = np.column_stack([corners, np.full(len(corners), DRAFT_Z)]).astype(np.float32)
        if self._handles is not None and (len(corners), draggable) == (
            self._count,
            self._draggable,
        ):
            # Moved in place: a handle that is removed would end the drag that moves it.
            self._handles.batched_positions = positions
            return
        if self._handles is not None:
            self._handles.remove()
            self._handles = None
        self._count, self._draggable = len(corners), draggable
        if len(corners):
            vertices, faces = handle_mesh()
            turns = np.tile(np.array([1.0, 0.0, 0.0, 0.0], dtype=np.float32), (len(corners), 1))
            self._handles = self._client.scene.add_batched_meshes_simple(
                "/draft/corners",
                vertices * HANDLE_M,
                faces,
                turns,
                positions,
                batched_colors=palette.DRAFT,
                flat_shading=True,
            )
            if draggable:
                self._handles.on_drag(self._dragged)

    async def _clicked(self, event: Any) -> None:
        self._report({"type": "click"}, floor_point(event.ray_origin, event.ray_direction))

    async def _dragged(self, event: Any) -> None:
        """The pointer is given on a plane that faces the camera; the ray through it meets the floor
        elsewhere."""
        eye = np.asarray(event.client.camera.position, dtype=np.float64)
        way = np.asarray(event.end_position, dtype=np.float64) - eye
        point = floor_point(eye.tolist(), way.tolist())
        index = event.instance_index
        if isinstance(index, int) and 0 <= index < self._count:
            self._report({"type": "drag", "phase": str(event.phase), "index": index}, point)

    def _report(self, message: dict[str, Any], point: Point | None) -> None:
        spec = self._spec()
        if point is None or spec is None:
            return
        on_map = clamped(point, spec)
        self._post({**message, "x_m": point[0], "y_m": point[1], "on_map": list(on_map)})


def _rgb(colour: str) -> npt.NDArray[np.uint8]:
    """Of `#rrggbb`."""
    return np.frombuffer(bytes.fromhex(colour[1:]), dtype=np.uint8)
