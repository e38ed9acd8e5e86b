"""Benchmark of a tick without segmentation: a map of 150 m × 150 m in cells of 5 cm, images of
640 × 480.

The world is an open forest of 2,500 upright trunks, seen by a D455 without the simulator: each ray
is intersected with each near trunk.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt
from rich.table import Table

from app.runtime.stage_timer import TICK, StageTimer
from navcore.config.navigator import NavigatorConfig
from navcore.config.perception import ObservationConfig
from navcore.geometry.camera import Pinhole, column_slope, ray_direction, row_slope
from navcore.geometry.transform import STANDSTILL, Pose2, wrap_angle
from navcore.grid.grid import GridSpec
from navcore.mapping.views.voxels import depth_view, measured_voxels
from navcore.mission.beware_list import NOTHING, BewareList, default_beware_list
from navcore.mission.order import NavigationRequest
from navcore.navigator import Navigator, Stages
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.labels import Labels, Segmenter, with_full_confidence
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from sim.sensors.camera import T_BASE_CAMERA, d455_intrinsics

SIDE_M, CELL_M, TRUNKS = 150.0, 0.05, 2500
"""Side of the map, cell size, and number of trunks."""
SIZE = (640, 480)
"""Columns and rows of the images."""
STEP_M, STEP_RAD = 0.1, 0.15
"""Motion of the robot between images: at 10 Hz, 1 m/s and 1.5 rad/s."""
WARM_UP = 12
"""Number of first ticks that are not measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """Durations of one stage of the tick."""

    what: str
    """Name of the stage in the table."""
    ms: list[float]
    """Duration of the stage in each tick, milliseconds."""


def tick_table(ticks: int) -> Table:
    """Drive through the forest for `ticks` images; return a table of the durations per stage."""
    table = Table(
        "stage",
        "mean ms",
        "p50",
        "p95",
        "p99",
        "max",
        title=f"tick without segmentation, 640×480, {SIDE_M:g} m map",
    )
    for stage in _measured(ticks):
        durations = np.array(stage.ms)
        statistics = [durations.mean(), *np.percentile(durations, [50, 95, 99]), durations.max()]
        table.add_row(stage.what, *(f"{value:.2f}" for value in statistics))
    return table


def _measured(ticks: int) -> list[Stage]:
    spec, timer = GridSpec.centred(size_m=(SIDE_M, SIDE_M), resolution_m=CELL_M), StageTimer()
    navigator = Navigator(
        spec=spec,
        profile=HUSKY,
        segmenter=ColourSegmenter(),
        config=NavigatorConfig(),
        stages=timer.wrap(Stages(segment=_unlabelled)),
    )
    tick = timer.timed(TICK, navigator.tick)
    order = NavigationRequest(goal=(60.0, 60.0), beware=default_beware_list(), zones=())
    forest, pose = Forest(np.random.default_rng(0)), Pose2(x_m=-60.0, y_m=-60.0, yaw_rad=0.8)
    cells_ms = []
    for number in range(ticks + WARM_UP):
        if number == WARM_UP:
            for durations in timer.ms.values():
                durations.clear()
        frame = forest.frame(pose, number)
        route = tick(frame, order).route
        cells_ms.append(_depth_to_cells_s(frame, spec) * 1e3)
        if route is None or len(route.track) < 2:
            raise RuntimeError("the forest has no path; choose another seed")
        pose = _ahead(pose, route.track)
    stages = [Stage(what=name, ms=list(durations)) for name, durations in timer.ms.items()]
    return [Stage(what="depth → cells, by itself", ms=cells_ms[WARM_UP:]), *stages]


def _unlabelled(_segmenter: Segmenter, frame: Frame, _beware: BewareList) -> Labels:
    """Labels of an image that shows nothing on the beware list, made in no time."""
    return with_full_confidence(np.full(frame.depth_m.shape, NOTHING, dtype=np.uint8))


class Forest:
    """Trunks on a plain, and the images that a D455 takes of them."""

    def __init__(self, rng: np.random.Generator, trunks: int = TRUNKS) -> None:
        self._rng, self._lens = rng, d455_intrinsics(SIZE)
        half = SIDE_M / 2 - 3
        self._trunks = np.column_stack(
            [rng.uniform(-half, half, (trunks, 2)), rng.uniform(0.1, 0.4, trunks)]
        )
        ends = np.array([[-60.0, -60.0], [60.0, 60.0]])
        clear = np.hypot(*(self._trunks[:, None, :2] - ends).transpose(2, 0, 1)).min(axis=1) > 3.0
        self._trunks = self._trunks[clear]

    def frame(self, pose: Pose2, number: int) -> Frame:
        """Return the frame from a pose, with depth noise that grows with the squared distance."""
        eye = pose.matrix() @ T_BASE_CAMERA
        near = self._trunks[np.hypot(*(self._trunks[:, :2] - eye[:2, 3]).T) < 9.0]
        lens = self._lens
        depth = _trace(near, eye, lens.pinhole, lens.height, lens.width)
        depth += 0.002 * depth**2 * self._rng.standard_normal(depth.shape, dtype=np.float32)
        rgb = np.full((lens.height, lens.width, 3), 120, dtype=np.uint8)
        rgb.flags.writeable = depth.flags.writeable = False
        return Frame(
            stamp_ns=number * 100_000_000,
            rgb=rgb,
            depth_m=depth,
            intrinsics=lens,
            T_base_camera=T_BASE_CAMERA,
            pose=pose,
            twist=STANDSTILL,
        )


@numba.njit(cache=True)
def _trace(
    trunks: npt.NDArray[np.float64],
    t: npt.NDArray[np.float64],
    lens: Pinhole,
    height: int,
    width: int,
) -> npt.NDArray[np.float32]:
    """Return the depth (H, W) of the floor or the nearest trunk, metres, 0 beyond 8 m."""
    depth = np.zeros((height, width), dtype=np.float32)
    for i in range(height):
        for j in range(width):
            dx, dy, dz = ray_direction(t, column_slope(j, lens), row_slope(i, lens))
            nearest = -t[2, 3] / dz if dz < -1e-9 else np.inf
            for k in range(len(trunks)):
                x, y = t[0, 3] - trunks[k, 0], t[1, 3] - trunks[k, 1]
                square, half, rest = (
                    dx * dx + dy * dy,
                    x * dx + y * dy,
                    x * x + y * y - trunks[k, 2] ** 2,
                )
                root = half * half - square * rest
                if root > 0.0:
                    hit = (-half - math.sqrt(root)) / square
                    if 0.1 < hit < nearest:
                        nearest = hit
            depth[i, j] = nearest if nearest < 8.0 else 0.0
    return depth


def _depth_to_cells_s(frame: Frame, spec: GridSpec) -> float:
    rules = ObservationConfig()
    start = time.perf_counter()
    view = depth_view(frame, spec, rules.max_range_m)
    measured_voxels(
        view, (rules.obstacle_height_m, rules.ceiling_m, -rules.drop_m), rules.min_support
    )
    return time.perf_counter() - start


def _ahead(pose: Pose2, track: npt.NDArray[np.float64]) -> Pose2:
    """Return the pose one step further along the track, turning by `STEP_RAD` at most."""
    toward = track[min(4, len(track) - 1)] - (pose.x_m, pose.y_m)
    turn = wrap_angle(math.atan2(toward[1], toward[0]) - pose.yaw_rad)
    yaw = pose.yaw_rad + max(-STEP_RAD, min(STEP_RAD, turn))
    if abs(turn) > 0.5:
        return Pose2(x_m=pose.x_m, y_m=pose.y_m, yaw_rad=yaw)
    at = track[min(round(STEP_M / CELL_M), len(track) - 1)]
    return Pose2(x_m=float(at[0]), y_m=float(at[1]), yaw_rad=yaw)
