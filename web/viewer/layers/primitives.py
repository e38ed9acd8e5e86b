"""The motion primitives that the local planner chooses from: what is free of each, and where it
would touch something."""

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
BLOCKED: palette.Rgb = (190, 60, 50)
CHOSEN: palette.Rgb = (255, 204, 51)
EVERY = 2
"""Every second arc is drawn: enough to see what there is to choose from. The chosen one is drawn
whichever it is."""


class PrimitivesLayer:
    """Free parts in green, the step that would touch something in red, the arc that is driven broad
    and yellow."""

    name = "candidates"
    period_s = 0.3

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._shown: object = None
        self._nodes: dict[str, Any] = {}

    def push(self, snapshot: Scene) -> None:
        """Draw them anew with every picture; nothing while nobody wants to see them."""
        found, strength = snapshot.candidates(), snapshot.strength.get(self.name, 1.0)
        key = None if found is None else (found.serial, strength)
        if key == self._shown:
            return
        self._shown = key
        if found is None or not np.isfinite(found.arcs).all():
            self._clear("arcs", "chosen")
            return
        segments, is_free = primitive_segments(found)
        colours = np.where(
            is_free[:, None, None],
            snapshot.faded(palette.GOAL, self.name),
            snapshot.faded(BLOCKED, self.name),
        ).repeat(2, axis=1)
        self._draw("arcs", segments, colours, 0.02)
        if found.chosen is None:
            self._clear("chosen")
        else:
            line = polyline_segments(
                found.arcs[found.chosen][: max(int(found.free[found.chosen]), 2)], ARC_Z + LIFT
            )
            yellow = np.broadcast_to(snapshot.faded(CHOSEN, self.name), line.shape)
            self._draw("chosen", line, yellow, 0.06)

    def _draw(
        self,
        name: str,
        segments: npt.NDArray[np.float32],
        colours: npt.NDArray[Any],
        thickness: float,
    ) -> None:
        # In the place of what had this name before, so that nothing flickers.
        self._nodes[name] = self._server.scene.add_line_segments(
            f"/candidates/{name}", segments, colours.astype(np.uint8), thickness=thickness
        )

    def _clear(self, *names: str) -> None:
        for name in names:
            if name in self._nodes:
                self._nodes.pop(name).remove()


def primitive_segments(found: Candidates) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.bool_]]:
    """(N, 2, 3) segments, and (N,) whether each is free: an arc ends one step after its first
    touch."""
    segments, is_free = [], []
    for arc, free in zip(found.arcs[::EVERY], found.free[::EVERY], strict=True):
        line = polyline_segments(arc[: min(int(free) + 1, len(arc))], ARC_Z)
        segments.append(line)
        is_free.append(np.arange(len(line)) < int(free) - 1)
    return np.concatenate(segments), np.concatenate(is_free)
