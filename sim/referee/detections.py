"""Which things to beware of came into the camera's view, and which of them a map holds, or holds
wrongly."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

import cv2
import numpy as np
import numpy.typing as npt

from navcore.geometry.transform import Matrix
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.robot.frame import Frame
from sim.models.solids import Polygon
from sim.scenario.schema import Scenario
from sim.truth.true_map import rasterise
from sim.truth.true_objects import PERSON, TrueThing, true_things

IN_VIEW_M = 4.0
"""Things further away are not expected to be found."""
HIDDEN_M = 0.3
"""Where depth is so much less than the distance of a thing, something stands before it."""
LOOKS = 3
"""A thing was in view when so many pictures show it."""
NEAR_M = 0.4
"""What the map holds within this of a thing is that thing: odometry drifts. What is as near to none
of them is false."""
TOGETHER_M = 0.15
"""Cells no further apart than twice this are one thing of the map."""


class DetectionScore:
    """Follows what comes into view, by the true pose, and compares it with a map."""

    def __init__(self, scenario: Scenario) -> None:
        self._things = true_things(scenario)
        self._spots = np.array([_middle(thing) for thing in self._things]).reshape(-1, 2)
        self._looks = np.zeros(len(self._things), dtype=np.int64)

    def look(self, frame: Frame, T_map_camera: Matrix) -> None:
        """Note what a picture shows, taken from this true pose of the camera."""
        if not len(self._things):
            return
        floor = np.column_stack(
            [self._spots, np.full(len(self._spots), 0.02), np.ones(len(self._spots))]
        )
        x, y, z, _ = np.linalg.inv(T_map_camera) @ floor.T
        lens, ahead = frame.intrinsics, np.maximum(z, 1e-6)
        col, row = np.rint(lens.fx * x / ahead + lens.cx), np.rint(lens.fy * y / ahead + lens.cy)
        shown = (
            (z > 0)
            & (z < IN_VIEW_M)
            & (col >= 0)
            & (col < lens.width)
            & (row >= 0)
            & (row < lens.height)
        )
        for number in np.flatnonzero(shown):
            depth_m = frame.depth_m[int(row[number]), int(col[number])]
            self._looks[number] += depth_m == 0 or depth_m > z[number] - HIDDEN_M

    def verdict(self, held: Mapping[str, BoolGrid], spec: GridSpec) -> dict[str, dict[str, int]]:
        """Class → `there` in the world, `seen` within 4 m, of these `missed` on the map under any
        class, and `false` ones.

        `held`: class → (rows, cols) cells of the map. People walk about and are not counted.
        """
        counts: defaultdict[str, dict[str, int]] = defaultdict(
            lambda: {"there": 0, "seen": 0, "missed": 0, "false": 0}
        )
        real, anything = (
            np.zeros((spec.rows, spec.cols), dtype=np.bool_),
            np.zeros((spec.rows, spec.cols), dtype=np.bool_),
        )
        for cells in held.values():
            anything |= cells
        for thing, looks in zip(self._things, self._looks, strict=True):
            near = _grown(rasterise(thing.outlines, spec), NEAR_M, spec)
            real |= near
            counts[thing.name]["there"] += 1
            counts[thing.name]["seen"] += int(looks >= LOOKS)
            counts[thing.name]["missed"] += int(looks >= LOOKS and not (near & anything).any())
        for name, cells in held.items():
            wrong = cells & ~real
            if name != PERSON and wrong.any():
                number, _ = cv2.connectedComponents(_grown(wrong, TOGETHER_M, spec).view(np.uint8))
                counts[name]["false"] += number - 1
        return {name: counts[name] for name in sorted(counts)}


def _middle(thing: TrueThing) -> npt.NDArray[np.float64]:
    """A spot of its first part: the middle of that part's corners."""
    first: Polygon = thing.outlines[0]
    return np.asarray(first.mean(axis=0))


def _grown(cells: BoolGrid, by_m: float, spec: GridSpec) -> BoolGrid:
    side = 2 * round(by_m / spec.resolution_m) + 1
    return cv2.dilate(
        cells.view(np.uint8), cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    ).view(np.bool_)
