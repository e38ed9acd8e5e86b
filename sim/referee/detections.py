"""Detection score: the beware objects that came into view, and which of them a map holds, or holds
wrongly."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping

import cv2
import numpy as np
import numpy.typing as npt
import shapely

from navcore.geometry.camera import project
from navcore.geometry.transform import Matrix, Pose2
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.robot.frame import Frame
from sim.models.person import PERSON
from sim.models.solids import Polygon
from sim.physics.pedestrians import BODY_DIAMETER_M
from sim.scenario.schema import Scenario
from sim.truth.true_map import rasterise
from sim.truth.true_objects import TrueObject, true_objects

IN_VIEW_M = 4.0
"""Distance within which an object is expected to be detected."""
HIDDEN_M = 0.3
"""Least difference between the distance of an object and the measured depth at which something
occludes it."""
TARGET_HEIGHT_M = 0.02
"""Height of the point of an object that must be visible."""
MIN_VIEWS = 3
"""Number of frames that must show an object for it to count as seen."""
MATCH_M = 0.4
"""Distance within which cells of the map match an object, because odometry drifts; cells that match
none are false."""
PEOPLE_STEP_M = 0.1
"""Resolution of the places where people have been, metres."""
PEOPLE_REACH_M = BODY_DIAMETER_M / 2 + MATCH_M
"""Distance from the middle of a person within which a cell shows them."""
MERGE_M = 0.15
"""Half of the largest gap between cells that count as one object of the map."""


class DetectionScore:
    """Records the objects that come into view, by the true pose, and compares them with a map."""

    def __init__(self, scenario: Scenario) -> None:
        self._objects = true_objects(scenario)
        self._centres = np.array([_centre(entry) for entry in self._objects]).reshape(-1, 2)
        self._views = np.zeros(len(self._objects), dtype=np.int64)
        self._people: set[tuple[float, float]] = set()

    def observe(self, frame: Frame, T_map_camera: Matrix, people: Iterable[Pose2] = ()) -> None:
        """Record the objects that a frame without faults shows, taken from this true pose of the
        camera, and where the people are."""
        self._people |= {
            (round(pose.x_m / PEOPLE_STEP_M), round(pose.y_m / PEOPLE_STEP_M)) for pose in people
        }
        if not len(self._objects):
            return
        floor = np.column_stack(
            [
                self._centres,
                np.full(len(self._centres), TARGET_HEIGHT_M),
                np.ones(len(self._centres)),
            ]
        )
        x, y, z, _ = np.linalg.inv(T_map_camera) @ floor.T
        lens = frame.intrinsics
        col, row = np.rint(project(np.column_stack([x, y, z]), lens)).T
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
            self._views[number] += depth_m == 0 or depth_m > z[number] - HIDDEN_M

    def counts_by_class(
        self,
        held: Mapping[str, BoolGrid],
        spec: GridSpec,
        placed: Callable[[Polygon], Polygon] = lambda outline: outline,
    ) -> dict[str, dict[str, int]]:
        """Return class → number of objects `there` in the world, `seen` within 4 m or `not_passed`,
        of the seen ones those `missed` on the map under any class, and `false` ones. A cell of the
        map shows the nearest object.

        `held`: class → (rows, cols) cells of the map, for each class of the list; objects of others
        are in no count, and no false ones. `placed` returns where the map shows what an outline of
        the true world covers. People move, so of them only false ones are counted: cells where no
        person has been.
        """
        counts: defaultdict[str, dict[str, int]] = defaultdict(
            lambda: {"there": 0, "seen": 0, "not_passed": 0, "missed": 0, "false": 0}
        )
        real = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
        anything = np.any(list(held.values()), axis=0) if held else real
        rows, cols = np.nonzero(anything)
        middles = np.asarray(shapely.points(spec.centres(np.column_stack([rows, cols]))))
        nearest_m, shown = np.full(len(rows), np.inf), np.full(len(rows), -1)
        for number, entry in enumerate(self._objects):
            outlines = [*map(placed, entry.outlines)]
            near = _dilated(rasterise(outlines, spec), MATCH_M, spec)
            real |= near
            (beside,) = np.nonzero(near[rows, cols])
            if len(beside):
                away_m = shapely.distance(
                    shapely.union_all([*map(shapely.Polygon, outlines)]), middles[beside]
                )
                nearer = beside[away_m < nearest_m[beside]]
                nearest_m[beside] = np.minimum(nearest_m[beside], away_m)
                shown[nearer] = number
        for number, (entry, views) in enumerate(zip(self._objects, self._views, strict=True)):
            if entry.name not in held:
                continue
            counts[entry.name]["there"] += 1
            counts[entry.name]["seen" if views >= MIN_VIEWS else "not_passed"] += 1
            counts[entry.name]["missed"] += int(views >= MIN_VIEWS and number not in shown)
        for name, cells in held.items():
            wrong = cells & ~(self._near_people(spec) if name == PERSON else real)
            if wrong.any():
                number, _ = cv2.connectedComponents(_dilated(wrong, MERGE_M, spec).view(np.uint8))
                counts[name]["false"] += number - 1
        return {name: counts[name] for name in sorted(counts)}

    def _near_people(self, spec: GridSpec) -> BoolGrid:
        """Return (rows, cols), True within reach of a place where a person has been."""
        been = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
        for x, y in self._people:
            point = x * PEOPLE_STEP_M, y * PEOPLE_STEP_M
            if spec.contains(*point):
                been[spec.cell(*point)] = True
        return _dilated(been, PEOPLE_REACH_M, spec)


def _centre(entry: TrueObject) -> npt.NDArray[np.float64]:
    """Return the mean of the corners of the first part of an object."""
    first: Polygon = entry.outlines[0]
    return np.asarray(first.mean(axis=0))


def _dilated(cells: BoolGrid, by_m: float, spec: GridSpec) -> BoolGrid:
    side = 2 * round(by_m / spec.resolution_m) + 1
    return cv2.dilate(
        cells.view(np.uint8), cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    ).view(np.bool_)
