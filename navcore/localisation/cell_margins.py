"""Margins of beware cells that follow the robot's uncertainty since each cell was in view.

What the camera sees now is where it is seen; what it saw before is as uncertain, relative to the
robot, as the position has become since.
"""

from __future__ import annotations

import numpy as np

from navcore.geometry.arrays import Bools, Floats, Points
from navcore.geometry.transform import Matrix
from navcore.localisation.estimate import LocalisationEstimate
from navcore.robot.frame import Frame


class CellMargins:
    """Remembers the covariance that the position had when each nearby cell was last in view."""

    def __init__(self, *, sigmas: float, resolution_m: float, range_m: float) -> None:
        """`sigmas`: standard deviations of the growth; cells farther from the camera than `range_m`
        metres are not in view."""
        self._sigmas, self._resolution_m, self._range_m = sigmas, resolution_m, range_m
        self._anchors: dict[tuple[int, int], Matrix] = {}

    def follow(self, cells: Points, frame: Frame, place: LocalisationEstimate) -> Floats:
        """Return (N,) growth in metres of (N, 2) cell centres of the map frame.

        The frame is placed in the map. Cells that are left out of a call are forgotten; a cell that
        was never in view is as uncertain as the robot's place in the map.
        """
        if not len(cells):
            self._anchors = {}
            return np.zeros(0)
        now = place.covariance[:2, :2]
        keys = [(int(x), int(y)) for x, y in np.floor(cells / self._resolution_m)]
        self._anchors = {
            key: now if seen else self._anchors.get(key, np.zeros((2, 2)))
            for key, seen in zip(keys, self._in_view(cells, frame), strict=True)
        }
        relative = now - np.stack([self._anchors[key] for key in keys])
        variance = np.maximum(np.linalg.eigvalsh(relative)[:, -1], 0.0)
        return np.asarray(self._sigmas * np.sqrt(variance))

    def _in_view(self, cells: Points, frame: Frame) -> Bools:
        floor = np.column_stack([cells, np.zeros(len(cells))])
        camera = frame.T_map_camera[:2, 3]
        near = np.hypot(*(cells - camera).T) <= self._range_m
        return np.asarray(near & frame.shows(floor))
