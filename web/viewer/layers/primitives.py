"""Motion primitives of the local planner: the free part of each, and its first collision."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import viser

from web.images import palette
from web.interface.insight import Candidates
from web.viewer.layers.base import Scene
from web.viewer.layers.geometry import polyline_segments

ARC_Z, LIFT = 0.07, 0.02
"""Height of the primitives, and of the chosen one above them, metres."""
BLOCKED: palette.Rgb = (190, 60, 50)
CHOSEN: palette.Rgb = (255, 204, 51)
STEP = 2
"""Every second primitive is drawn, and the chosen one in any case."""


class PrimitivesLayer:
    """Free parts in green, the first step in collision in red, the driven primitive broad and
    yellow."""

    name = "candidates"
    period_s = 0.3

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._shown: object = None
        self._nodes: dict[str, Any] = {}

    def push(self, scene: Scene) -> None:
        """Redraw the primitives of each tick; nothing while they are hidden."""
        found = scene.candidates()
        key = None if found is None else found.serial
        if key == self._shown:
            return
        self._shown = key
        if found is None or not np.isfinite(found.arcs).all():
            self._clear("arcs", "chosen")
            return
        segments, is_free = primitive_segments(found)
        colours = np.where(
            is_free[:, None, None], np.array(palette.GOAL), np.array(BLOCKED)
        ).repeat(2, axis=1)
        self._draw("arcs", segments, colours, 0.02)
        if found.chosen is None:
            self._clear("chosen")
        else:
            line = polyline_segments(
                found.arcs[found.chosen][: max(int(found.free[found.chosen]), 2)], ARC_Z + LIFT
            )
            yellow = np.broadcast_to(CHOSEN, line.shape)
            self._draw("chosen", line, yellow, 0.06)

    def _draw(
        self,
        name: str,
        segments: npt.NDArray[np.float32],
        colours: npt.NDArray[Any],
        thickness: float,
    ) -> None:
        # A node of the same name is replaced without flicker.
        self._nodes[name] = self._server.scene.add_line_segments(
            f"/candidates/{name}", segments, colours.astype(np.uint8), thickness=thickness
        )

    def _clear(self, *names: str) -> None:
        for name in names:
            if name in self._nodes:
                self._nodes.pop(name).remove()


def primitive_segments(found: Candidates) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.bool_]]:
    """Return the segments (N, 2, 3), and (N,) whether each is free; a primitive ends one step after
    its first collision."""
    segments, is_free = [], []
    for arc, free in zip(found.arcs[::STEP], found.free[::STEP], strict=True):
        line = polyline_segments(arc[: min(int(free) + 1, len(arc))], ARC_Z)
        segments.append(line)
        is_free.append(np.arange(len(line)) < int(free) - 1)
    return np.concatenate(segments), np.concatenate(is_free)
