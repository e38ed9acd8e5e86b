"""Benchmark of classes by example: things that no network was trained on, clicked three times.

Each walk is a site of its own: a random world of the test split with two things of one kind of
`sim.models.unseen_items`. The operator's part: three frames around the first thing, a click into
the middle of what it covers there, and eight frames of another drive as background. Then the robot
walks past the second one, as in `detection`: found in time is what the map holds as that class
before the robot is 1.5 m away. The first one is not to be found, for the class was learned from it,
but is no false item either; every other region of the class is. A site whose first thing is seen
from no free place is left out.
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from app.evaluation.perception.detection import (
    CLEARANCE_M,
    TEST_SHARD,
    drive_poses,
    picture,
    walk,
    walk_rules,
)
from app.evaluation.perception.detection_counts import COUNTERS, DetectionCounts, Walks
from app.evaluation.suites import Suite
from app.runtime.start.segmentation import Perception
from navcore.errors import BadConfiguration, Refused
from navcore.geometry.transform import Pose2
from navcore.mission.beware_list import BewareClass, BewareList
from navcore.mission.prototype import Prototype
from navcore.perception.esanet.segmenter import NetworkSegmenter
from navcore.perception.fused_segmenter import FusedSegmenter
from navcore.perception.prototype import background_of, example_of, fitted
from navcore.perception.region_growing import object_at
from navcore.robot.camera_stream import CameraStream
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from sim.dataset.generate import shard_seed
from sim.dataset.renderer import PATTERNS, UNSEEN_LABEL, Labels, SceneRenderer
from sim.dataset.room_generator import random_scene
from sim.dataset.scene import UNSEEN, Scene, SolidObject, Spot
from sim.models.unseen_items import UNSEEN_ITEMS

CLICKS, BACKGROUNDS = 3, 8
"""Number of clicks, and of frames of the background."""
CLICK_M, CLICK_PX = (1.0, 2.4), 80
"""Range of the distance of a click, and the number of pixels that the thing then has."""
TRIALS = 300
"""Number of random places and poses that are tried."""
LIST_ID = 1
"""Class id of the thing."""
Rng = np.random.Generator


def click_and_walk(
    network: NetworkSegmenter, seed: int, size: tuple[int, int] = CameraStream().size
) -> DetectionCounts:
    """Click and walk once on the site of a seed, with images of `size` (columns, rows); return the
    counts by kind."""
    renderer = SceneRenderer(seed=shard_seed(seed, "test", TEST_SHARD), size=size)
    rng = np.random.default_rng((seed, 25))
    site = site_of(renderer, rng, kind=list(UNSEEN_ITEMS)[seed % len(UNSEEN_ITEMS)])
    renderer.build(site.scene)
    classes: tuple[BewareClass, ...] = ()
    refused: tuple[str, ...] = ()
    try:
        prototype = _taught(network, renderer, site, rng)
        if prototype is None:
            return DetectionCounts()
        classes = (BewareClass(name=UNSEEN, class_id=LIST_ID, prototype=prototype),)
    except Refused as refusal:
        refused = (f"{seed}, {site.kind}: {refusal}",)
    here = walk(
        renderer,
        site.scene,
        site.drive,
        rng,
        FusedSegmenter(network, HUSKY.depth_sensor),
        BewareList(classes=classes),
        labels={UNSEEN},
        place=site.second,
    )
    kinds = {
        name: Counter({site.kind: getattr(here, name)[UNSEEN]} if getattr(here, name) else {})
        for name in COUNTERS
    }
    first_m = [(site.kind, away_m) for _, away_m in here.first_m]
    return DetectionCounts(**kinds, first_m=first_m, walked_m=here.walked_m, refused=refused)


def walks(perception: Perception, size: tuple[int, int] = CameraStream().size) -> Walks:
    """Return the suite of a perception with images of `size` (columns, rows); raises
    `BadConfiguration` for one without features."""
    if perception.examples is None:
        raise BadConfiguration(
            f"the suite '{Suite.ONE_CLICK}' needs a network with features; "
            f"{perception.title} has none"
        )
    return Walks(
        suite=Suite.ONE_CLICK,
        names=tuple(UNSEEN_ITEMS),
        perception=perception,
        beware=BewareList(classes=()),
        size=size,
        rules=(*walk_rules(), CLICKS, BACKGROUNDS, CLICK_M, CLICK_PX, TRIALS),
        walk=partial(click_and_walk, perception.examples, size=size),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Site:
    """A world with two things of one kind."""

    kind: str
    scene: Scene
    drive: list[Pose2]
    """Poses of the walk."""
    first: Spot
    """Place of the thing that is clicked."""
    second: Spot
    """Place of the thing that the walk passes."""


def site_of(renderer: SceneRenderer, rng: Rng, *, kind: str) -> Site:
    """Return a random world in which both things have a place: the second beside the far half of
    the walk, the first anywhere."""
    while True:
        scene = random_scene(rng, patterns=PATTERNS, prints=renderer.prints)
        drive = drive_poses(scene, rng)
        tint, by = rng.uniform(-30, 30, 3), rng.uniform(0.7, 1.2)
        _, size_m, usual = UNSEEN_ITEMS[kind]
        red, green, blue = (
            int(np.clip(c * by + t, 10, 250)) for c, t in zip(usual, tint, strict=True)
        )
        radius_m = 0.7 * max(size_m[:2])
        spots: list[Spot] = []
        for beside in (drive[len(drive) // 2 :], None):
            spot = _free_spot(scene, rng, radius_m, beside)
            if spot is None:
                break
            spots.append(spot)
            scene = _with_thing(scene, rng, kind, (red, green, blue), spot)
        else:
            second, first = spots
            return Site(kind=kind, scene=scene, drive=drive, first=first, second=second)


def _free_spot(scene: Scene, rng: Rng, radius_m: float, beside: list[Pose2] | None) -> Spot | None:
    """Return a free place, before one of some given poses; None if there is none."""
    for _ in range(TRIALS):
        if beside:
            pose = beside[int(rng.integers(len(beside)))]
            turn, away = pose.yaw_rad + rng.uniform(-0.9, 0.9), rng.uniform(0.4, 1.4)
            x_m, y_m = pose.x_m + away * math.cos(turn), pose.y_m + away * math.sin(turn)
        else:
            x_m, y_m = (rng.uniform(-reach, reach) for reach in scene.reach_m)
        spot = Spot(x_m=float(x_m), y_m=float(y_m), radius_m=radius_m)
        inside = abs(x_m) < scene.reach_m[0] and abs(y_m) < scene.reach_m[1]
        if inside and _is_free(scene, spot):
            return spot
    return None


def _is_free(scene: Scene, spot: Spot) -> bool:
    return all(
        math.hypot(spot.x_m - other.x_m, spot.y_m - other.y_m) > spot.radius_m + other.radius_m
        for other in scene.blocked
    )


def _with_thing(
    scene: Scene, rng: Rng, kind: str, colour: tuple[int, int, int], spot: Spot
) -> Scene:
    """Return the scene with one more thing, its size a little its own."""
    build, (x, y, z), _ = UNSEEN_ITEMS[kind]
    by_x, by_y, by_z = (float(by) for by in rng.uniform(0.95, 1.05, 3))
    pose = Pose2(x_m=spot.x_m, y_m=spot.y_m, yaw_rad=float(rng.uniform(-math.pi, math.pi)))
    thing = SolidObject(
        label=UNSEEN, solids=build((x * by_x, y * by_y, z * by_z), colour), pose=pose
    )
    return dataclasses.replace(
        scene, objects=(*scene.objects, thing), blocked=(*scene.blocked, spot)
    )


def _taught(
    network: NetworkSegmenter, renderer: SceneRenderer, site: Site, rng: Rng
) -> Prototype | None:
    """Return the prototype of three clicks, None where the thing is seen from no free place; raises
    `Refused` where it cannot be made."""
    clicked = list(views(renderer, site, site.first, rng, CLICKS))
    if not clicked:
        return None
    described = [network.described(frame) for frame, _ in clicked]
    examples = [
        example_of(
            frame,
            cells,
            object_at(frame, *_middle((labels == UNSEEN_LABEL) & (frame.depth_m > 0))),
        )
        for (frame, labels), cells in zip(clicked, described, strict=True)
    ]
    other = drive_poses(site.scene, rng)
    frames = [
        picture(renderer, site.scene, pose, rng)[0]
        for pose in other[:: max(1, len(other) // BACKGROUNDS)]
    ]
    seen = [(frame, cells) for (frame, _), cells in zip(clicked, described, strict=True)]
    seen += [(frame, network.described(frame)) for frame in frames]
    background = [background_of(frame, cells, examples) for frame, cells in seen]
    return fitted(network.identity, examples, np.concatenate(background))


def views(
    renderer: SceneRenderer, site: Site, thing: Spot, rng: Rng, count: int
) -> Iterator[tuple[Frame, Labels]]:
    """Yield up to `count` frames that show a thing, with the label of every pixel."""
    yielded = 0
    for _ in range(TRIALS):
        turn, away = float(rng.uniform(-math.pi, math.pi)), float(rng.uniform(*CLICK_M))
        x_m, y_m = thing.x_m - away * math.cos(turn), thing.y_m - away * math.sin(turn)
        stand = Spot(x_m=x_m, y_m=y_m, radius_m=CLEARANCE_M)
        if not _is_free(site.scene, stand):
            continue
        yaw = turn + float(rng.uniform(-0.3, 0.3))
        frame, _, labels = picture(renderer, site.scene, Pose2(x_m=x_m, y_m=y_m, yaw_rad=yaw), rng)
        if np.count_nonzero(labels == UNSEEN_LABEL) >= CLICK_PX:
            yield frame, labels
            yielded += 1
        if yielded == count:
            return


def _middle(pixels: npt.NDArray[np.bool_]) -> tuple[int, int]:
    """Return the (row, col) of the pixel nearest to the middle of a thing, where one clicks."""
    rows, cols = np.nonzero(pixels)
    nearest = np.argmin(np.hypot(rows - rows.mean(), cols - cols.mean()))
    return int(rows[nearest]), int(cols[nearest])
