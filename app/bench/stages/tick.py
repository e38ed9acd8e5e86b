"""Benchmark of a tick without segmentation: a map of 150 m × 150 m in cells of 5 cm, by default
images of 640 × 480, people in view.

The world is an open forest of 2,500 upright trunks, seen by a D455 without the simulator: each ray
is intersected with each near trunk. Three people walk to and fro before the robot. The stages are
those that drive, but for the labels, which show nothing. Durations are processor time of the tick's
only thread, and of each tick the least of several equal drives.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from rich.table import Table

from app.bench.quiet import QuietGuard
from app.runtime.control.stage_timer import TICK, StageTimer
from navcore.compiled import compiled
from navcore.config.navigator import NavigatorConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.geometry.arrays import Floats
from navcore.geometry.camera import Pinhole, column_slope, ray_direction, row_slope
from navcore.geometry.transform import STANDSTILL, Pose2, wrap_angle
from navcore.grid.grid import GridSpec
from navcore.mapping.views.voxels import depth_view, measured_voxels
from navcore.mission.beware_list import NOTHING, BewareList, default_beware_list
from navcore.mission.order import NavigationRequest
from navcore.navigator import Navigator
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.labels import Labels, Segmenter, with_full_confidence
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from navcore.safety.collision_monitor import RecentObstacles
from navcore.stages import Stages
from navcore.warmup import warm_up
from sim.sensors.camera import T_BASE_CAMERA, d455_intrinsics

SIDE_M, CELL_M, TRUNKS = 150.0, 0.05, 2500
"""Side of the map, cell size, and number of trunks."""
SIZE = (640, 480)
"""Columns and rows of the images by default."""
STEP_M, STEP_RAD = 0.1, 0.15
"""Motion of the robot between images: at 10 Hz, 1 m/s and 1.5 rad/s."""
PEOPLE, PERSON_RADIUS_M, PERSON_STEP_M = 3, 0.25, 0.14
"""Number of people, radius of a body, and largest step between images: at 10 Hz, 1.4 m/s."""
WARM_UP = 12
"""Number of first ticks that are not measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """Durations of one drive through the forest."""

    ms: dict[str, Floats]
    """Durations in milliseconds of each stage, in the order of the ticks."""
    people: float
    """Mean number of people that the robot followed."""


def tick_table(ticks: int, size: tuple[int, int] = SIZE) -> Table:
    """Drive through the forest for `ticks` images of `size` (columns, rows), several times; return
    a table of the durations per stage."""
    drives, guard = list[Drive](), QuietGuard()

    def drive() -> float:
        drives.append(_drive(ticks, size))
        return float(np.median(drives[-1].ms[TICK]))

    warm_up()  # loads the compiled code, also what few ticks call
    _drive(1, size)
    guard.fastest(drive)
    table = Table("stage", "n", "mean ms", "p50", "p95", "p99", "max")
    table.title = (
        f"tick without segmentation, {size[0]}×{size[1]}, {SIDE_M:g} m map, "
        f"{drives[0].people:.1f} people followed; least of {len(drives)} drives, {guard.verdict}"
    )
    for stage in drives[0].ms:
        least = np.min([drive.ms[stage] for drive in drives], axis=0)
        statistics = [least.mean(), *np.percentile(least, [50, 95, 99]), least.max()]
        table.add_row(stage, str(len(least)), *(f"{value:.3f}" for value in statistics))
    return table


def _drive(ticks: int, size: tuple[int, int]) -> Drive:
    spec = GridSpec.centred(size_m=(SIDE_M, SIDE_M), resolution_m=CELL_M)
    timer = StageTimer(time.thread_time)
    navigator = Navigator(
        spec=spec,
        profile=HUSKY,
        segmenter=ColourSegmenter(),
        config=NavigatorConfig(),
        stages=timer.wrap(Stages(segment=_unlabelled)),
    )
    tick = timer.timed(TICK, navigator.tick)
    order = NavigationRequest(goal=(60.0, 60.0), beware=default_beware_list(), zones=())
    forest = Forest(np.random.default_rng(0), size=size)
    pose = Pose2(x_m=-60.0, y_m=-60.0, yaw_rad=0.8)
    beside = {_CELLS: list[float](), _CONTACT: list[float]()}
    people, obstacles = 0, RecentObstacles()
    for number in range(ticks + WARM_UP):
        if number == WARM_UP:
            for durations in (*timer.ms.values(), *beside.values()):
                durations.clear()
        forest.walk(pose, number)
        frame = forest.frame(pose, number)
        result = tick(frame, order)
        start = time.thread_time()
        _depth_to_cells(frame, spec)
        between = time.thread_time()
        obstacles = obstacles.after(frame, HUSKY)
        beside[_CELLS].append((between - start) * 1e3)
        beside[_CONTACT].append((time.thread_time() - between) * 1e3)
        if result.route is None or len(result.route.track) < 2:
            raise RuntimeError("the forest has no path; choose another seed")
        if not result.place.is_known:
            raise RuntimeError("the robot has lost its place, so no map is updated any more")
        people += len(result.people) if number >= WARM_UP else 0
        pose = _ahead(pose, result.route.track)
    stages = {stage: np.array(durations) for stage, durations in (timer.ms | beside).items()}
    return Drive(
        ms={stage: durations for stage, durations in stages.items() if len(durations)},
        people=people / ticks,
    )


_CELLS, _CONTACT = "depth → cells, by itself", "collision monitor, beside the tick"


def _unlabelled(_segmenter: Segmenter, frame: Frame, _beware: BewareList) -> Labels:
    """Labels of an image that shows nothing on the beware list, made in no time."""
    return with_full_confidence(np.full(frame.depth_m.shape, NOTHING, dtype=np.uint8))


class Forest:
    """Trunks and people on a plain, and the images that a D455 takes of them."""

    def __init__(
        self,
        rng: np.random.Generator,
        trunks: int = TRUNKS,
        size: tuple[int, int] = SIZE,
    ) -> None:
        self._rng, self._lens = rng, d455_intrinsics(size)
        half = SIDE_M / 2 - 3
        self._trunks = np.column_stack(
            [rng.uniform(-half, half, (trunks, 2)), rng.uniform(0.1, 0.4, trunks)]
        )
        ends = np.array([[-60.0, -60.0], [60.0, 60.0]])
        clear = np.hypot(*(self._trunks[:, None, :2] - ends).transpose(2, 0, 1)).min(axis=1) > 3.0
        self._trunks = self._trunks[clear]
        self._people = np.zeros((0, 3))

    def walk(self, pose: Pose2, number: int) -> None:
        """Let each person take a step towards a point before the robot that sways from side to
        side."""
        turns = 0.08 * number + np.arange(PEOPLE)
        ahead = np.column_stack([2.5 + np.arange(PEOPLE), 1.2 * np.sin(turns)])
        aims = pose.to_parent(ahead)
        if not len(self._people):
            self._people = np.column_stack([aims, np.full(PEOPLE, PERSON_RADIUS_M)])
        steps = aims - self._people[:, :2]
        distance = np.linalg.norm(steps, axis=1, keepdims=True)
        self._people[:, :2] += steps * np.minimum(1.0, PERSON_STEP_M / np.maximum(distance, 1e-9))

    def frame(self, pose: Pose2, number: int) -> Frame:
        """Return the frame from a pose, with depth noise that grows with the squared distance."""
        eye = pose.matrix() @ T_BASE_CAMERA
        upright = np.vstack([self._trunks, self._people])
        near = upright[np.hypot(*(upright[:, :2] - eye[:2, 3]).T) < 9.0]
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


@compiled
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


def _depth_to_cells(frame: Frame, spec: GridSpec) -> None:
    rules = ObservationConfig()
    view = depth_view(frame, spec, rules.max_range_m)
    measured_voxels(
        view, (rules.obstacle_height_m, rules.ceiling_m, -rules.drop_m), rules.min_support
    )


def _ahead(pose: Pose2, track: npt.NDArray[np.float64]) -> Pose2:
    """Return the pose one step further along the track, turning by `STEP_RAD` at most."""
    toward = track[min(4, len(track) - 1)] - (pose.x_m, pose.y_m)
    turn = wrap_angle(math.atan2(toward[1], toward[0]) - pose.yaw_rad)
    yaw = pose.yaw_rad + max(-STEP_RAD, min(STEP_RAD, turn))
    if abs(turn) > 0.5:
        return Pose2(x_m=pose.x_m, y_m=pose.y_m, yaw_rad=yaw)
    at = track[min(round(STEP_M / CELL_M), len(track) - 1)]
    return Pose2(x_m=float(at[0]), y_m=float(at[1]), yaw_rad=yaw)
