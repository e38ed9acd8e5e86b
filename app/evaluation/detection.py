"""What the planners see of the things on the beware list: walks through random worlds that no
network was trained on.

A thing counts once it was in view within 4 m; it is found when the map holds it, as any enabled
class of the list, before the robot is 1.5 m away. What is on the map as a thing of the list where
none is within 0.3 m is a false item. The robot that walks here avoids nothing: that the camera
comes near is the point.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from rich.console import Console as Terminal
from rich.progress import track
from rich.table import Table

from navcore.config.mapping import MappingConfig
from navcore.config.perception import ObservationConfig
from navcore.costmap.costmap import layer_grid
from navcore.geometry.transform import Pose2, Twist
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.learning.data.class_names import BEWARE_CLASSES
from navcore.mapping.observation import observe
from navcore.mapping.point_map import PointMap
from navcore.mission.beware_list import BewareList
from navcore.mission.zone import rasterise
from navcore.perception.labels import Segmenter
from navcore.robot.frame import Frame
from sim.dataset.camera_effects import apply_camera_effects
from sim.dataset.generate import WORLDS_PER_SHARD, shard_seed
from sim.dataset.renderer import PATTERNS, Labels, SceneRenderer
from sim.dataset.room_generator import random_scene
from sim.dataset.scene import BACKGROUND, Scene
from sim.sensors.camera import T_BASE_CAMERA

CELL_M, STEP_M, SPEED_MPS = 0.05, 0.1, 0.8
IN_VIEW_M, IN_TIME_M = 4.0, 1.5
ENOUGH_PX = 12
"""A thing is in view when so many pixels show it."""
NEAR_M, FALSE_M = 0.15, 0.3
"""Cells as near to a thing as the first are taken for it; none as near as the second to any thing
is false."""
WALK_M = (4.0, 9.0)


@dataclass(slots=True, kw_only=True, eq=False)
class Thing:
    """One thing of the list in a world."""

    name: str
    """Its class."""
    cells: BoolGrid
    """(rows, cols) that it covers."""
    places: npt.NDArray[np.float64]
    """(N, 2) the middles of these, metres."""
    in_view: bool = False
    """Whether it was seen within 4 m, and not first from nearer than 1.5 m."""
    found_as: str | None = None
    """The class under which it was on the map in time; None when it was not."""
    closed: bool = False
    """The robot was 1.5 m away; nothing counts any more."""


@dataclass(slots=True, kw_only=True)
class Findings:
    """What came of some walks."""

    seen: Counter[str] = field(default_factory=Counter)
    """Things in view within 4 m, by class."""
    found: Counter[str] = field(default_factory=Counter)
    """Of these, on the map in time as anything of the list."""
    named: Counter[str] = field(default_factory=Counter)
    """Of these, under their own name."""
    false: Counter[str] = field(default_factory=Counter)
    """False items, by the class they were taken for."""
    walked_m: float = 0.0
    """In all."""

    def summary(self) -> dict[str, Any]:
        """The figures."""
        total = max(self.seen.total(), 1)
        return {
            "things_in_view": self.seen.total(),
            "found_in_time": round(self.found.total() / total, 4),
            "found_by_class": {
                name: f"{self.found[name]}/{self.seen[name]}"
                for name in BEWARE_CLASSES
                if self.seen[name]
            },
            "named_rightly": round(self.named.total() / total, 4),
            "false_items": self.false.total(),
            "false_items_by_class": dict(self.false),
            "false_items_per_10_m": round(10 * self.false.total() / max(self.walked_m, 1e-9), 3),
            "walked_m": round(self.walked_m, 1),
        }


def measure_finding(segmenter: Segmenter, beware: BewareList, *, seed: int, walks: int) -> Findings:
    """Walk once through each of so many worlds of the test split that `seed` makes."""
    findings = Findings()
    shard = shard_seed(seed, "test", 900)  # far behind the shards of any data set
    with SceneRenderer(seed=shard, size=(424, 240), renderer="auto") as studio:
        for number in track(range(walks), description="walking"):
            rng = np.random.default_rng((WORLDS_PER_SHARD * shard + number, 2))
            scene = random_scene(rng, patterns=PATTERNS, prints=studio.prints)
            studio.build(scene)
            _walk(studio, scene, rng, segmenter, beware, findings)
    return findings


def run_finding(
    segmenter: Segmenter, beware: BewareList, *, seed: int, walks: int, out: Path | None
) -> dict[str, Any]:
    """Measure, print a table, and write `finding.json` into `out`."""
    findings = measure_finding(segmenter, beware, seed=seed, walks=walks)
    summary = findings.summary()
    table = Table(
        "class",
        "in view ≤ 4 m",
        "found ≥ 1.5 m away",
        "by its name",
        "false items",
        title="things found in time",
    )
    for name in BEWARE_CLASSES[1:]:
        table.add_row(
            name,
            *(
                str(counts[name])
                for counts in (findings.seen, findings.found, findings.named, findings.false)
            ),
        )
    terminal = Terminal()
    terminal.print(table)
    terminal.print(
        f"{summary['found_in_time']:.1%} of {summary['things_in_view']} things found in time, "
        f"{summary['false_items_per_10_m']:.2f} false items per 10 m, {summary['walked_m']:g} m walked"
    )
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        (out / "finding.json").write_text(json.dumps(summary, indent=1), encoding="utf-8")
    return summary


def _walk(
    studio: SceneRenderer,
    scene: Scene,
    rng: np.random.Generator,
    segmenter: Segmenter,
    beware: BewareList,
    findings: Findings,
) -> None:
    spec = GridSpec.centred(
        size_m=(2 * scene.reach_m[0] + 8.0, 2 * scene.reach_m[1] + 8.0), resolution_m=CELL_M
    )
    things, cloud = list(_things(scene, spec)), PointMap(spec, MappingConfig())
    poses = _poses(scene, rng)
    for number, pose in enumerate(poses):
        rgb, depth_m, labels = studio.render(pose.matrix() @ T_BASE_CAMERA, scene)
        true_depth_m = depth_m
        rgb, depth_m = apply_camera_effects(
            rgb, depth_m, studio.intrinsics.fx, rng, like_simulator=scene.like_simulator
        )
        frame = Frame(
            stamp_ns=int(number * STEP_M / SPEED_MPS * 1e9),
            rgb=np.ascontiguousarray(rgb),
            depth_m=depth_m.astype(np.float32),
            intrinsics=studio.intrinsics,
            T_base_camera=T_BASE_CAMERA,
            pose=pose,
            twist=Twist(v_mps=SPEED_MPS, w_radps=0.0),
        )
        found = segmenter.segment(frame, beware)
        cloud.insert(observe(frame, found, beware, spec, ObservationConfig()), frame, found)
        _look(things, cloud, beware, frame, true_depth_m, labels)
    for thing in things:
        findings.seen[thing.name] += thing.in_view
        findings.found[thing.name] += thing.in_view and thing.found_as is not None
        findings.named[thing.name] += thing.in_view and thing.found_as == thing.name
    findings.false += _false_items(things, cloud, beware)
    findings.walked_m += STEP_M * (len(poses) - 1)


def _things(scene: Scene, spec: GridSpec) -> Iterator[Thing]:
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
            yield Thing(
                name=name, cells=_grown(cells, NEAR_M), places=spec.centres(np.argwhere(cells))
            )


def _poses(scene: Scene, rng: np.random.Generator) -> list[Pose2]:
    """A straight walk over free ground, or the longest of those that were tried."""
    best: list[Pose2] = []
    for _ in range(60):
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
        math.hypot(pose.x_m - spot.x_m, pose.y_m - spot.y_m) > spot.radius_m + 0.4
        for spot in scene.blocked
    )


def _look(
    things: Iterable[Thing],
    cloud: PointMap,
    beware: BewareList,
    frame: Frame,
    depth_m: npt.NDArray[np.float32],
    labels: Labels,
) -> None:
    """Note which things are in view by the truth, and which of them the map holds by now."""
    lens, camera = frame.intrinsics, frame.T_map_camera
    rows, cols = np.nonzero(labels > 1)
    z = depth_m[rows, cols]
    optical = np.column_stack([(cols - lens.cx) * z / lens.fx, (rows - lens.cy) * z / lens.fy, z])
    places = (optical @ camera[:3, :3].T + camera[:3, 3])[:, :2]
    kinds = labels[rows, cols] - 1
    grid = layer_grid(cloud, beware, ())
    names = {entry.class_id: entry.name for entry in beware.enabled}
    for thing in things:
        if thing.closed:
            continue
        away_m = float(np.hypot(*(thing.places - (frame.pose.x_m, frame.pose.y_m)).T).min())
        if away_m <= IN_VIEW_M and not thing.in_view:
            thing.in_view = away_m > IN_TIME_M and _pixels_on(
                thing, cloud.spec, places[kinds == BEWARE_CLASSES.index(thing.name)]
            )
        if thing.found_as is None or thing.found_as != thing.name:
            held = [
                names[class_id]
                for class_id, layer in grid.beware.items()
                if (layer & thing.cells).any()
            ]
            if held:
                thing.found_as = thing.name if thing.name in held else held[0]
        thing.closed = away_m <= IN_TIME_M


def _pixels_on(thing: Thing, spec: GridSpec, places: npt.NDArray[np.float64]) -> bool:
    cols = np.floor((places[:, 0] - spec.origin_x_m) / spec.resolution_m).astype(int)
    rows = np.floor((places[:, 1] - spec.origin_y_m) / spec.resolution_m).astype(int)
    inside = (rows >= 0) & (rows < spec.rows) & (cols >= 0) & (cols < spec.cols)
    return int(thing.cells[rows[inside], cols[inside]].sum()) >= ENOUGH_PX


def _false_items(things: Iterable[Thing], cloud: PointMap, beware: BewareList) -> Counter[str]:
    real = np.zeros((cloud.spec.rows, cloud.spec.cols), dtype=np.bool_)
    for thing in things:
        real |= thing.cells
    real, found = _grown(real, FALSE_M - NEAR_M), Counter[str]()
    grid = layer_grid(cloud, beware, ())
    for entry in beware.enabled:
        wrong = grid.beware[entry.class_id] & ~real
        if wrong.any():
            # Cells that lie within a decimetre of each other are one item.
            count, _ = cv2.connectedComponents(_grown(wrong, 0.05).view(np.uint8), connectivity=8)
            found[entry.name] += count - 1
    return found


def _grown(mask: BoolGrid, by_m: float) -> BoolGrid:
    side = 2 * round(by_m / CELL_M) + 1
    return cv2.dilate(
        mask.view(np.uint8), cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    ).view(np.bool_)
