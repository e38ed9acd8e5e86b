"""Benchmark of corrections of poses: a map of about 190,000 points in cells of 5 cm, in which all
poses move by up to 2 cm.

Times are those of the processor, without waiting for other programs.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial
from typing import TypeVar

import numpy as np
from rich.table import Table

from app.bench.stages.tick import CELL_M, SIDE_M, Forest
from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.mapping.correction import prepare
from navcore.mapping.point_map import PointMap
from navcore.mapping.views.observation import observe
from navcore.mission.beware_list import NOTHING, default_beware_list
from navcore.perception.labels import with_full_confidence

Result = TypeVar("Result")
TRUNKS = 6500
"""Number of trunks: twice as dense as for the tick, and more."""
LANES, VIEWS = 5, 40
"""Number of lanes through the forest, and of images in a lane."""
MEANWHILE = 5
"""Number of images that enter the map between snapshot and correction."""
ROUNDS = 8
"""Number of measured corrections."""
MOVE_M, TURN_RAD = 0.02, 0.002
"""Largest correction of a pose."""


def correction_table() -> Table:
    """Correct all poses of a map several times; return a table of the durations."""
    drive = _Drive()
    for lane in range(LANES):
        for view in range(VIEWS):
            drive.insert(_pose(view, lane))
    durations: dict[str, list[float]] = {"snapshot": [], "prepare": [], "apply": []}
    count = len(drive.map.points.class_ids)
    for number in range(ROUNDS + 1):
        poses = drive.moved()
        snapshot, taken_ms = _timed(drive.map.snapshot)
        prepared, prepared_ms = _timed(partial(prepare, snapshot, poses))
        for view in range(MEANWHILE):
            drive.insert(_pose(VIEWS + view, LANES - 1))
        _, applied_ms = _timed(partial(drive.map.apply, prepared))
        if number:  # the first one compiles, and touches new memory
            for name, ms in zip(durations, (taken_ms, prepared_ms, applied_ms), strict=True):
                durations[name].append(ms)
    title = (
        f"correction of {len(drive.map.poses)} poses and {count} points; "
        f"{len(drive.map.points.class_ids)} points after {ROUNDS + 1} corrections"
    )
    table = Table("part", "where", "p50 ms", "max", title=title)
    for name, taken in durations.items():
        where = "beside the tick" if name == "prepare" else "in the tick"
        table.add_row(name, where, f"{np.median(taken):.2f}", f"{max(taken):.2f}")
    return table


class _Drive:
    def __init__(self) -> None:
        self._spec = GridSpec.centred(size_m=(SIDE_M, SIDE_M), resolution_m=CELL_M)
        self.map = PointMap(self._spec, MappingConfig())
        self._rng = np.random.default_rng(1)
        self._forest = Forest(np.random.default_rng(0), TRUNKS)

    def insert(self, pose: Pose2) -> None:
        """Enter the image from a pose into the map."""
        frame, rules = self._forest.frame(pose, 0), ObservationConfig()
        labels = with_full_confidence(np.full(frame.depth_m.shape, NOTHING, dtype=np.uint8))
        seen = observe(frame, labels, default_beware_list(), self._spec, rules)
        self.map.insert(seen, frame, labels)
        self.map.explored.integrate_rays(frame, rules)

    def moved(self) -> dict[int, Pose2]:
        """Return all poses, each moved a little."""
        steps = self._rng.uniform(-1, 1, (len(self.map.poses), 3)) * (MOVE_M, MOVE_M, TURN_RAD)
        return {
            pose_id: Pose2(x_m=pose.x_m + x, y_m=pose.y_m + y, yaw_rad=pose.yaw_rad + turn)
            for pose_id, (pose, (x, y, turn)) in enumerate(
                zip(self.map.poses, steps.tolist(), strict=True)
            )
        }


def _pose(view: int, lane: int) -> Pose2:
    return Pose2(x_m=0.45 * view - 10, y_m=9.0 * lane - 50, yaw_rad=0.3 * math.sin(view / 9))


def _timed(call: Callable[[], Result]) -> tuple[Result, float]:
    start = time.thread_time()
    result = call()
    return result, (time.thread_time() - start) * 1e3
