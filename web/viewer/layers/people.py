"""Tracked people and their predicted motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import viser

from navcore.perception.people.track import Track
from web.images import palette
from web.viewer.layers.base import Scene
from web.viewer.layers.geometry import closed_ring, polyline_segments

AHEAD_S = 2.0
"""Duration of the predicted motion in seconds."""
PEOPLE_Z = 0.06
"""Height of the lines in metres."""


class PeopleLayer:
    """Ring around each person, and a line along the predicted motion."""

    name = "people"
    period_s = 0.1

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._shown: tuple[Track, ...] = ()
        self._node: Any = None

    def push(self, scene: Scene) -> None:
        """Redraw all people when one has moved."""
        people = scene.tick.people
        if people == self._shown:
            return
        self._shown = people
        if people:
            segments = np.concatenate([outline_and_prediction(track) for track in people])
            self._node = self._server.scene.add_line_segments(
                "/people/ways", segments, palette.PERSON, thickness=0.05
            )
        elif self._node is not None:
            self._node.remove()
            self._node = None


def outline_and_prediction(track: Track) -> npt.NDArray[np.float32]:
    """Return the segments (N, 2, 3) of a person's ring and predicted path."""
    angles = np.linspace(0.0, 2 * math.pi, 16, endpoint=False)
    ring = np.array([track.x_m, track.y_m]) + track.radius_m * np.column_stack(
        [np.cos(angles), np.sin(angles)]
    )
    prediction = np.array([track.at(0.0), track.at(AHEAD_S)])
    return np.concatenate(
        [polyline_segments(closed_ring(ring), PEOPLE_Z), polyline_segments(prediction, PEOPLE_Z)]
    )
