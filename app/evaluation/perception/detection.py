"""Detection benchmark: straight drives through random worlds of the test split.

Each seed makes one world and one drive through it. An object of the beware list counts once it was
in view within 4 m; it is found when the map holds it, as any enabled class, before the robot is
1.5 m away. A map region of a class with no object of the list within 0.3 m is a false item. The
robot avoids nothing here, because the camera must come near.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
import numpy.typing as npt

from app.evaluation.perception.detection_counts import DetectionCounts, Walks
from app.evaluation.suites import Suite
from app.runtime.start.segmentation import Perception
from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.costmap.costmap import layer_grid
from navcore.geometry.camera import back_project_pixels
from navcore.geometry.transform import Pose2, Twist
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.learning.data.class_names import BEWARE_CLASSES
from navcore.mapping.point_map import PointMap
from navcore.mapping.views.observation import observe
from navcore.mission.beware_list import BewareList
from navcore.mission.zone_cells import rasterise
from navcore.perception.labels import Segmenter
from navcore.robot.camera_stream import CameraStream
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from sim.dataset.camera_effects import apply_camera_effects
from sim.dataset.generate import WORLDS_PER_SHARD, shard_seed
from sim.dataset.renderer import LABELS, PATTERNS, Labels, SceneRenderer
from sim.dataset.room_generator import random_scene
from sim.dataset.scene import BACKGROUND, Scene, Spot
from sim.rendering.lighting import PLAIN, Lighting
from sim.sensors.camera import T_BASE_CAMERA

CELL_M, STEP_M, SPEED_MPS = 0.05, 0.1, 0.8
"""Cell size of the map, distance between images, and speed of the robot."""
IN_VIEW_M, IN_TIME_M = 4.0, 1.5
"""Distance within which an object must be seen, and before which it must be found."""
ENOUGH_PX = 12
"""Number of pixels on an object at which it is in view."""
NEAR_M, FALSE_M = 0.15, 0.3
"""Cells within the first distance of an object belong to it; within the second none is false."""
WALK_M = (4.0, 9.0)
"""Range of the length of a drive."""
POSE_TRIALS, CLEARANCE_M = 60, 0.4
"""Number of drives that are drawn, and the clearance they need from what stands in the world."""
TEST_SHARD = 900
"""Shard of the test split, far behind the shards of any data set."""


@dataclass(slots=True, kw_only=True, eq=False)
class ListedObject:
    """An object of the beware list in a world."""

    name: str
    """Class of the object."""
    cells: BoolGrid
    """(rows, cols) cells that the object covers, dilated by `NEAR_M`."""
    points: npt.NDArray[np.float64]
    """(N, 2) centres of the covered cells, metres of the map frame."""
    in_view: bool = False
    """Whether the object was seen within 4 m, first from beyond 1.5 m."""
    first_m: float | None = None
    """Distance at which the map first held the object, metres; None if it did not in time."""
    found_as: str | None = None
    """Class under which the map held the object in time; None if it did not."""
    closed: bool = False
    """Whether the robot has been within 1.5 m; later detections do not count."""

    def away_m(self, place: Pose2 | Spot) -> float:
        """Return the distance in metres from a place to the nearest covered cell."""
        return float(np.hypot(*(self.points - (place.x_m, place.y_m)).T).min())


def walk_rules() -> tuple[object, ...]:
    """Return what the counts of a walk depend on besides its seed, segmenter and list."""
    world = TEST_SHARD, WALK_M, POSE_TRIALS, CLEARANCE_M, STEP_M, SPEED_MPS
    judged = CELL_M, IN_VIEW_M, IN_TIME_M, ENOUGH_PX, NEAR_M, FALSE_M
    return HUSKY.depth_sensor, MappingConfig(), ObservationConfig(), world, judged


def walk_of_seed(
    segmenter: Segmenter,
    beware: BewareList,
    seed: int,
    size: tuple[int, int] = CameraStream().size,
    *,
    lighting: Lighting = PLAIN,
    turn_radps: float = 0.0,
    on_image: Callable[[Labels], None] = lambda labels: None,
) -> DetectionCounts:
    """Drive once through the world of the test split that a seed makes, with images of `size`
    (columns, rows); return the counts.

    The robot drives straight on; a light that blurs images does so as if it turned at `turn_radps`.
    `on_image` is told the true labels of each image after the segmenter has seen it.
    """
    shard = shard_seed(seed, "test", TEST_SHARD)
    renderer = SceneRenderer(seed=shard, size=size)
    rng = np.random.default_rng((WORLDS_PER_SHARD * shard, 2))
    scene = random_scene(rng, patterns=PATTERNS, prints=renderer.prints)
    renderer.build(scene)
    return walk(
        renderer,
        scene,
        drive_poses(scene, rng),
        rng,
        segmenter,
        beware,
        lighting=lighting,
        turn_radps=turn_radps,
        on_image=on_image,
    )


def walks(
    perception: Perception, beware: BewareList, size: tuple[int, int] = CameraStream().size
) -> Walks:
    """Return the suite of a perception with images of `size` (columns, rows)."""
    return Walks(
        suite=Suite.FINDING,
        names=listed_classes(beware),
        perception=perception,
        beware=beware,
        size=size,
        rules=walk_rules(),
        walk=partial(walk_of_seed, perception.segmenter, beware, size=size),
    )


def listed_classes(beware: BewareList) -> tuple[str, ...]:
    """Return the classes of the data set that a list has switched on."""
    wanted = {entry.detected_as for entry in beware.enabled}
    return tuple(name for name in BEWARE_CLASSES[1:] if name in wanted)


def walk(
    renderer: SceneRenderer,
    scene: Scene,
    poses: Sequence[Pose2],
    rng: np.random.Generator,
    segmenter: Segmenter,
    beware: BewareList,
    *,
    labels: Container[str] | None = None,
    place: Spot | None = None,
    lighting: Lighting = PLAIN,
    turn_radps: float = 0.0,
    on_image: Callable[[Labels], None] = lambda labels: None,
) -> DetectionCounts:
    """Drive through a world that the renderer has built, and count; `labels` are the classes of the
    objects that there are to find, by default those of the list. With a `place` only the object
    there is to be found, and the others are no false items."""
    labels = listed_classes(beware) if labels is None else labels
    spec = GridSpec.centred(
        size_m=(2 * scene.reach_m[0] + 8.0, 2 * scene.reach_m[1] + 8.0), resolution_m=CELL_M
    )
    objects = [listed for listed in _objects(scene, spec) if listed.name in labels]
    sought = objects if place is None else [min(objects, key=lambda one: one.away_m(place))]
    cloud = PointMap(spec, MappingConfig())
    for number, pose in enumerate(poses):
        frame, true_depth_m, truth = picture(
            renderer, scene, pose, rng, number, lighting=lighting, turn_radps=turn_radps
        )
        found = segmenter.segment(frame, beware)
        on_image(truth)
        cloud.insert(observe(frame, found, beware, spec, ObservationConfig()), frame, found)
        _observe(sought, cloud, beware, frame, true_depth_m, truth)
    counts = DetectionCounts(
        false=_false_items(objects, cloud, beware), walked_m=STEP_M * (len(poses) - 1)
    )
    for listed in sought:
        counts.seen[listed.name] += listed.in_view
        counts.found[listed.name] += listed.in_view and listed.found_as is not None
        counts.named[listed.name] += listed.in_view and listed.found_as == listed.name
        if listed.in_view and listed.first_m is not None:
            counts.first_m.append((listed.name, round(listed.first_m, 2)))
    return counts


def picture(
    renderer: SceneRenderer,
    scene: Scene,
    pose: Pose2,
    rng: np.random.Generator,
    number: int = 0,
    *,
    lighting: Lighting = PLAIN,
    turn_radps: float = 0.0,
) -> tuple[Frame, npt.NDArray[np.float32], Labels]:
    """Return the frame of a pose with the errors of the camera, its depth without them, and the
    label of every pixel."""
    rgb, depth_m, labels = renderer.render(pose.matrix() @ T_BASE_CAMERA, scene, lighting)
    true_depth_m = depth_m
    rgb, depth_m = apply_camera_effects(
        rgb,
        depth_m,
        renderer.intrinsics.fx,
        rng,
        like_simulator=scene.like_simulator,
        lighting=lighting,
        turn_radps=turn_radps,
    )
    frame = Frame(
        stamp_ns=int(number * STEP_M / SPEED_MPS * 1e9),
        rgb=np.ascontiguousarray(rgb),
        depth_m=depth_m.astype(np.float32),
        intrinsics=renderer.intrinsics,
        T_base_camera=T_BASE_CAMERA,
        pose=pose,
        twist=Twist(v_mps=SPEED_MPS, w_radps=0.0),
    )
    return frame, true_depth_m, labels


def _objects(scene: Scene, spec: GridSpec) -> Iterator[ListedObject]:
    covered = [
        (piece.label, [piece.pose.to_parent(solid.outline()) for solid in piece.solids])
        for piece in scene.objects
        if piece.label != BACKGROUND
    ]
    covered += [
        (patch.label, [np.array(patch.polygon)])
        for patch in scene.decals
        if patch.label != BACKGROUND
    ]
    for name, polygons in covered:
        cells = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
        for polygon in polygons:
            cells |= rasterise(tuple((float(x), float(y)) for x, y in polygon), spec)
        if cells.any():
            yield ListedObject(
                name=name, cells=_dilated(cells, NEAR_M), points=spec.centres(np.argwhere(cells))
            )


def drive_poses(scene: Scene, rng: np.random.Generator) -> list[Pose2]:
    """Return the poses of the longest free straight drive among those drawn."""
    best: list[Pose2] = []
    for _ in range(POSE_TRIALS):
        x, y = (float(rng.uniform(-reach, reach)) for reach in scene.reach_m)
        yaw, length = float(rng.uniform(-math.pi, math.pi)), float(rng.uniform(*WALK_M))
        steps = np.arange(0.0, length, STEP_M)
        poses = []
        for along in steps:
            pose = Pose2(x_m=x + along * math.cos(yaw), y_m=y + along * math.sin(yaw), yaw_rad=yaw)
            if (
                abs(pose.x_m) > scene.reach_m[0]
                or abs(pose.y_m) > scene.reach_m[1]
                or not _free(scene, pose)
            ):
                break
            poses.append(pose)
        best = max(best, poses, key=len)
    return best


def _free(scene: Scene, pose: Pose2) -> bool:
    return all(
        math.hypot(pose.x_m - spot.x_m, pose.y_m - spot.y_m) > spot.radius_m + CLEARANCE_M
        for spot in scene.blocked
    )


def _observe(
    objects: Iterable[ListedObject],
    cloud: PointMap,
    beware: BewareList,
    frame: Frame,
    depth_m: npt.NDArray[np.float32],
    labels: Labels,
) -> None:
    """Update which objects are in view by ground truth, and which of them the map holds by now."""
    lens, camera = frame.intrinsics, frame.T_map_camera
    rows, cols = np.nonzero(labels > 1)
    optical = back_project_pixels(rows, cols, depth_m[rows, cols], lens)
    points = (optical @ camera[:3, :3].T + camera[:3, 3])[:, :2]
    seen = labels[rows, cols]
    grid = layer_grid(cloud, beware, ())
    names = {entry.class_id: entry.detected_as for entry in beware.enabled}
    for listed in objects:
        if listed.closed:
            continue
        away_m = listed.away_m(frame.pose)
        listed.closed = away_m <= IN_TIME_M
        if listed.closed:
            continue
        if away_m <= IN_VIEW_M and not listed.in_view:
            listed.in_view = _pixels_on(listed, cloud.spec, points[seen == LABELS[listed.name]])
        if listed.found_as is None or listed.found_as != listed.name:
            held = [
                names[class_id]
                for class_id, layer in grid.beware.items()
                if (layer & listed.cells).any()
            ]
            if held:
                listed.first_m = listed.first_m or away_m
                listed.found_as = listed.name if listed.name in held else held[0]


def _pixels_on(listed: ListedObject, spec: GridSpec, points: npt.NDArray[np.float64]) -> bool:
    cols = np.floor((points[:, 0] - spec.origin_x_m) / spec.resolution_m).astype(int)
    rows = np.floor((points[:, 1] - spec.origin_y_m) / spec.resolution_m).astype(int)
    inside = (rows >= 0) & (rows < spec.rows) & (cols >= 0) & (cols < spec.cols)
    return int(listed.cells[rows[inside], cols[inside]].sum()) >= ENOUGH_PX


def _false_items(
    objects: Iterable[ListedObject], cloud: PointMap, beware: BewareList
) -> Counter[str]:
    real = np.zeros((cloud.spec.rows, cloud.spec.cols), dtype=np.bool_)
    for listed in objects:
        real |= listed.cells
    real, found = _dilated(real, FALSE_M - NEAR_M), Counter[str]()
    grid = layer_grid(cloud, beware, ())
    for entry in beware.enabled:
        wrong = grid.beware[entry.class_id] & ~real
        if wrong.any():
            # Cells within a decimetre of each other are one item.
            count, _ = cv2.connectedComponents(_dilated(wrong, 0.05).view(np.uint8), connectivity=8)
            found[entry.detected_as] += count - 1
    return found


def _dilated(mask: BoolGrid, by_m: float) -> BoolGrid:
    side = 2 * round(by_m / CELL_M) + 1
    return cv2.dilate(
        mask.view(np.uint8), cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    ).view(np.bool_)
