"""Draft of one operator in the 3D view, and the clicks and drags that it reports to the page. Other
operators do not see it."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import viser

from web.images import palette
from web.viewer.layers.geometry import closed_ring, handle_mesh, polyline_segments
from web.viewer.messages import Draft, Highlight
from web.viewer.picking import Point, floor_point

log = logging.getLogger(__name__)

DRAFT_Z, HIGHLIGHT_Z = 0.09, 0.12
"""Heights of the drawn lines above the floor, metres."""
HANDLE_M = 0.13
"""Size of a corner's handle in metres."""
PLACE_M = 0.4
"""Half the size of the mark at a highlighted position, metres."""
PLACE_COLOUR = "#f0b429"

Post = Callable[[dict[str, Any]], None]


class DraftOverlay:
    """Draft in one client's scene."""

    def __init__(self, client: viser.ClientHandle, post: Post) -> None:
        self._client, self._post = client, post
        self._handles: Any = None
        self._highlighted: Any = None
        self._count = 0
        self._draggable = False
        self._nodes: dict[str, Any] = {}
        self._note: tuple[str, Any] = ("", None)
        # Clicks are received in every mode: asking the browser for them would lose the first click
        # of a mode. A coroutine keeps the order of quick clicks; viser awaits it, though its
        # signature does not say so.
        client.scene.on_click()(self._clicked)  # type: ignore[arg-type]

    def show(self, draft: Draft) -> None:
        """Draw the draft; its corners can be dragged in the mode `edit`."""
        corners = np.array(draft.corners, dtype=np.float64).reshape(-1, 2)
        # The shape of the corners: a circle has two.
        shape = np.array(draft.outline or draft.corners, dtype=np.float64).reshape(-1, 2)
        with self._client.atomic():
            self._line(
                "outline", closed_ring(shape) if len(shape) > 2 else shape, palette.DRAFT, 0.06
            )
            self._line(
                "path", np.array(draft.path, dtype=np.float64).reshape(-1, 2), palette.DRAFT, 0.04
            )
            self._show_note(draft.note if len(shape) else "", shape)
            self._show_handles(corners, draggable=draft.mode == "edit")

    def highlight(self, highlight: Highlight) -> None:
        """Draw highlighted lines and a position, replacing the previous ones."""
        lines = [
            (line.colour, np.array(line.points).reshape(-1, 2))
            for line in highlight.lines
            if len(line.points) > 1
        ]
        if highlight.place is not None:
            around = np.array(highlight.place) + PLACE_M * np.array(
                [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]]
            )
            lines.append((PLACE_COLOUR, closed_ring(around)))
        with self._client.atomic():
            if self._highlighted is not None:
                self._highlighted.remove()
                self._highlighted = None
            if lines:
                segments = [polyline_segments(points, HIGHLIGHT_Z) for _, points in lines]
                colours = [
                    np.tile(_rgb(colour), (len(part), 2, 1))
                    for (colour, _), part in zip(lines, segments, strict=True)
                ]
                self._highlighted = self._client.scene.add_line_segments(
                    "/mark", np.concatenate(segments), np.concatenate(colours), thickness=0.12
                )

    def _line(self, name: str, points: Any, colour: palette.Rgb, thickness: float) -> None:
        if (old := self._nodes.pop(name, None)) is not None and len(points) < 2:
            old.remove()
        if len(points) >= 2:
            self._nodes[name] = self._client.scene.add_line_segments(
                f"/draft/{name}", polyline_segments(points, DRAFT_Z), colour, thickness=thickness
            )

    def _show_note(self, text: str, shape: Any) -> None:
        shown, label = self._note
        if text != shown:
            if label is not None:
                label.remove()
            label = (
                self._client.scene.add_label("/draft/note", text, anchor="top-left")
                if text
                else None
            )
            self._note = text, label
        if label is not None:
            label.position = (*shape.mean(axis=0).tolist(), DRAFT_Z)

    def _show_handles(self, corners: Any, *, draggable: bool) -> None:
        positions = np.column_stack([corners, np.full(len(corners), DRAFT_Z)]).astype(np.float32)
        if self._handles is not None and (len(corners), draggable) == (
            self._count,
            self._draggable,
        ):
            # Moved in place: removing a handle would end its drag.
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
        """Report the floor point below the pointer; the event gives a point on a plane that faces
        the camera."""
        eye = np.asarray(event.client.camera.position, dtype=np.float64)
        direction = np.asarray(event.end_position, dtype=np.float64) - eye
        point = floor_point(eye.tolist(), direction.tolist())
        index = event.instance_index
        if isinstance(index, int) and 0 <= index < self._count:
            self._report({"type": "drag", "phase": str(event.phase), "index": index}, point)

    def _report(self, message: dict[str, Any], point: Point | None) -> None:
        if point is not None:
            self._post({**message, "x_m": point[0], "y_m": point[1]})


def _rgb(colour: str) -> npt.NDArray[np.uint8]:
    """Return (3,) the colour `#rrggbb`."""
    return np.frombuffer(bytes.fromhex(colour[1:]), dtype=np.uint8)
