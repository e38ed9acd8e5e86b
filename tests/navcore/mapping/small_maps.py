"""Small maps of random frames, and their layers computed again from the points."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.costmap.costmap import layer_grid
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import STANDSTILL, Pose2
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.mapping.point_map import PointMap
from navcore.mapping.views.observation import Observation, observe
from navcore.mission.beware_list import NOTHING, BewareClass, BewareList
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.ground import flat_ground
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame
from tests.navcore.scene import LENS, MOUNT, RED_LIST, SPEC, Box, Paint, picture

SMALL = GridSpec.centred(size_m=(6.0, 6.0), resolution_m=0.1)
TINY_LENS = Intrinsics(width=16, height=12, fx=8.0, fy=8.0, cx=7.5, cy=5.5)
FIRST = BewareClass(name="first", class_id=1, min_confidence=0.0)
SECOND = BewareClass(name="second", class_id=2, min_confidence=0.0)
ALL = BewareList(classes=(FIRST, SECOND))
SURE = BewareList(
    classes=(
        dataclasses.replace(FIRST, min_confidence=0.5),
        dataclasses.replace(SECOND, min_confidence=0.8),
    )
)
Layers = dict[int, BoolGrid]


def random_step(rng: np.random.Generator, *, confident: bool) -> tuple[Frame, Observation]:
    """Return a random frame from a random pose, often the pose before."""
    frame, labels = random_frame(rng, confident=confident)
    return frame, observe(frame, labels, ALL, SMALL, ObservationConfig(min_support=1))


def random_frame(rng: np.random.Generator, *, confident: bool) -> tuple[Frame, Labels]:
    """Return a random frame from a random pose, often the pose before, and random labels."""
    pose = Pose2(
        x_m=float(rng.choice([0.0, 0.1, 1.0])),
        y_m=float(rng.choice([0.0, -1.0])),
        yaw_rad=float(rng.choice([0.0, 0.05, 1.5, math.pi])),
    )
    flat = rng.random() < 0.5
    depth = np.full((12, 16), rng.uniform(0.3, 4.0)) if flat else rng.uniform(0.0, 4.0, (12, 16))
    depth[rng.random(depth.shape) < 0.1] = 0.0
    frame = Frame(
        stamp_ns=0,
        rgb=rng.integers(0, 255, (12, 16, 3), dtype=np.uint8),
        depth_m=depth.astype(np.float32),
        intrinsics=TINY_LENS,
        T_base_camera=MOUNT,
        pose=pose,
        twist=STANDSTILL,
    )
    labels = Labels(
        class_ids=rng.choice([0, 0, 1, 2], (12, 16)).astype(np.uint8),
        confidence=(np.ones((12, 16)) if confident else rng.random((12, 16))).astype(np.float32),
    )
    return frame, labels


def layers(cloud: PointMap, beware: BewareList) -> Layers:
    grid = layer_grid(cloud, beware, ())
    return {NOTHING: grid.geometric, **grid.beware}


def rebuilt(cloud: PointMap, beware: BewareList) -> Layers:
    """Return the same layers, rebuilt from the public points alone."""
    points, spec = cloud.points, cloud.spec
    xyz = points.points_map.astype(np.float64)
    low = np.array([spec.origin_x_m, spec.origin_y_m])
    size = np.array([spec.cols, spec.rows]) * spec.resolution_m
    on_grid = ((xyz[:, :2] >= low - 1e-3) & (xyz[:, :2] <= low + size + 1e-3)).all(axis=1)
    cells = np.floor((xyz[:, :2] - low) / spec.resolution_m).astype(int)
    cols, rows = np.clip(cells, 0, [spec.cols - 1, spec.rows - 1]).T
    made = {}
    for class_id, least in [
        (NOTHING, 0.0),
        *((entry.class_id, entry.min_confidence) for entry in beware.enabled),
    ]:
        mask = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
        chosen = on_grid & (points.class_ids == class_id)
        chosen &= np.greater_equal(points.confidence, np.float32(least))
        mask[rows[chosen], cols[chosen]] = True
        made[class_id] = mask
    return made


def assert_same(first: Layers, second: Layers) -> None:
    assert first.keys() == second.keys()
    for class_id, layer in first.items():
        np.testing.assert_array_equal(layer, second[class_id], err_msg=f"class {class_id}")


def seen(
    *points: tuple[float, float, float], class_id: int = 1, confidence: float = 1.0
) -> Observation:
    """Return an observation of the given points, as if each was measured a metre away."""
    return Observation(
        points_map=np.array(points, dtype=np.float32).reshape(-1, 3),
        class_ids=np.full(len(points), class_id, dtype=np.uint8),
        confidence=np.full(len(points), confidence, dtype=np.float32),
        rgb=np.zeros((len(points), 3), dtype=np.uint8),
        range_m=np.ones(len(points), dtype=np.float32),
        max_range_m=5.0,
        ground_m=flat_ground(LENS.width),
        spec=SMALL,
        box=(0, 0, SMALL.rows, SMALL.cols),
        cells_seen=np.empty(0, dtype=np.int64),
        heights_seen=np.empty(0, dtype=np.uint64),
    )


BLIND = dataclasses.replace(picture(), depth_m=np.zeros_like(picture().depth_m))
"""Frame that measures nothing, so that it clears nothing."""
SPOT = (2.05, 0.05, 0.0)


def drive(*frames: Frame, cloud: PointMap | None = None, beware: BewareList = RED_LIST) -> PointMap:
    cloud = cloud or PointMap(SPEC, MappingConfig())
    for frame in frames:
        cloud.insert(
            observe(
                frame, ColourSegmenter().segment(frame, beware), beware, SPEC, ObservationConfig()
            ),
            frame,
        )
    return cloud


TALL = Box(x=(2.0, 2.6), y=(-0.3, 0.3), z=(0.0, 0.5))
WALL = Box(x=(4.0, 4.2), y=(-3, 3), z=(0.0, 1.0))
PATCH = Paint(x=(1.6, 2.4), y=(-0.2, 0.2))
AWAY = tuple(Pose2(x_m=-0.6 * k, y_m=0.0, yaw_rad=2.5) for k in range(1, 5))
