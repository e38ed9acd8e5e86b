"""Sites of the benchmark of prints: a print of a thing on the floor of an empty random world, or
the thing itself in its place.

All comes from a seed and the kind of the thing, so that a kept seed renders the same print again.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from app.evaluation.perception.detection import TEST_SHARD, picture
from navcore.geometry.arrays import Bools
from navcore.geometry.camera import back_project_pixels, pixel_rays, project
from navcore.geometry.transform import Pose2, invert, transform_points
from navcore.robot.camera_stream import CameraStream
from navcore.robot.frame import Frame
from sim.dataset.generate import shard_seed
from sim.dataset.prints import PRINT_KINDS, PRINT_MARGIN, RenderedPrint, thing_solids
from sim.dataset.renderer import LABELS, PATTERNS, PRINTS_OF_EACH, Labels, SceneRenderer
from sim.dataset.room_generator import empty_scene
from sim.dataset.scene import Poster, Scene, SolidObject
from sim.models.items import ITEM_SIZES
from sim.models.person import DEFAULT_APPEARANCE, PERSON
from sim.models.solids import quaternion
from sim.models.textures import PRINT_PX
from sim.sensors.camera import T_BASE_CAMERA, d455_intrinsics

KINDS = tuple(kind for kind in PRINT_KINDS if kind in LABELS)
"""Kinds of things that a print can show and that the network knows."""
FARTHEST_M = 4.0
"""Largest distance from the camera to the place of a thing; every world has room for it."""
BEHIND_M = 0.25
"""Least distance from that place to the bound of the positions of a robot behind it."""
PRINTED_SCALE = (0.8, 1.25)
"""Range of the length of the thing on a print, relative to its length in reality."""
STRETCH = (1.0, 2.0)
"""Range of the length of a print along the line of sight, relative to its width: a robot sees a
print on the floor foreshortened, and one that is stretched looks more like the thing."""
CUT_OUT_SHARE, ANAMORPHIC_SHARE = 0.35, 0.35
"""Shares of the prints that are cut out along the outline of the thing, and of those that are also
drawn so that they look like the thing from one viewpoint. The others are square, with the floor of
their picture around it and a white frame."""
VIEWPOINT_M = (1.2, 3.0)
"""Range of the distance of that viewpoint along the floor from the place of the thing."""
LONGEST_M = 2.0
"""Longest print that is drawn for a viewpoint; a thing as high as the camera would need one without
an end, so one that is cut out is taken in its place."""
FINE_PX = (1696, 960)
"""Columns and rows of the image from which such a print is drawn."""
UPRIGHT_RAD = -math.pi / 2
"""Yaw of a print whose upper edge lies farthest from a robot that looks along +x of the map."""
SMALLEST_SLOPE = 0.02
"""Fall of a line of sight per metre below which it is not followed to the floor."""
ASKEW_RAD = 0.5
"""Largest angle between the upper edge of a print and what the camera sees as level."""
FLAT_M = 0.01
"""Height up to which a point belongs to a print; decals and prints lie a few millimetres high."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FloorPrint:
    """A print that lies on the floor."""

    picture: RenderedPrint
    """What it shows."""
    pose: Pose2
    """T_map_print: its x to the right and y to the upper edge, as one reads it."""
    size_m: tuple[float, float]
    """Width and height."""
    cut_out: bool
    """Whether only the thing is printed, without a sheet around it."""

    def poster(self) -> Poster:
        """Return the print as a part of a world."""
        return Poster(
            texture=self.picture.number,
            at_m=(self.pose.x_m, self.pose.y_m, 0.0),
            turn=tuple(quaternion(self.pose.yaw_rad)),
            size_m=self.size_m,
            cut_out=self.cut_out,
        )

    def outlined(self, frame: Frame, depth_m: npt.NDArray[np.float32]) -> Bools:
        """Return the (H, W) pixels of a frame that show the thing on the print; `depth_m` is the
        (H, W) depth without errors."""
        rows, cols = np.arange(depth_m.shape[0])[:, None], np.arange(depth_m.shape[1])
        points = back_project_pixels(rows, cols, depth_m, frame.intrinsics).reshape(-1, 3)
        at_m = transform_points(frame.T_map_camera, points)
        x, y = self.pose.from_parent(at_m[:, :2]).T / np.array(self.size_m)[:, None]
        height, width = self.picture.outline.shape
        col = np.floor(width * (x + 0.5)).astype(np.int64)
        row = np.floor(height * (0.5 - y)).astype(np.int64)
        shown = (np.abs(at_m[:, 2]) < FLAT_M) & (np.abs(x) < 0.5) & (np.abs(y) < 0.5)
        shown[shown] = self.picture.outline[row[shown], col[shown]]
        return np.asarray(shown.reshape(depth_m.shape))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Site:
    """A world with a place for one thing, before a robot that looks along +x of the map."""

    seed: int
    """Seed of the world."""
    kind: str
    """Kind of the thing."""
    scene: Scene
    """The world without the thing."""
    x_m: float
    """Place of the thing, x of the map; its y is 0."""

    def pose(self, away_m: float) -> Pose2:
        """Return the pose of a robot whose camera is so many metres before the place of the
        thing, measured along the floor."""
        return Pose2(x_m=self.x_m - away_m - float(T_BASE_CAMERA[0, 3]), y_m=0.0, yaw_rad=0.0)

    def rng(self, part: int) -> np.random.Generator:
        """Return the random generator of one part of what is drawn."""
        return np.random.default_rng((self.seed, 27, PRINT_KINDS.index(self.kind), part))


def site_rules() -> tuple[object, ...]:
    """Return what a site depends on besides its seed and kind."""
    place = TEST_SHARD, FARTHEST_M, BEHIND_M
    sheet = CUT_OUT_SHARE, ANAMORPHIC_SHARE, PRINTED_SCALE, STRETCH, ASKEW_RAD
    drawn = VIEWPOINT_M, LONGEST_M, FINE_PX, SMALLEST_SLOPE, FLAT_M
    return place, sheet, drawn


def renderer_of(seed: int, size: tuple[int, int] = CameraStream().size) -> SceneRenderer:
    """Return the renderer of a seed, with its prints, for images of `size` (columns, rows)."""
    return SceneRenderer(seed=shard_seed(seed, "test", TEST_SHARD), size=size)


def site_of(seed: int, kind: str) -> Site:
    """Return the site of a seed for one of the `KINDS`; its camera errors are those of the
    simulator."""
    rng = np.random.default_rng((seed, 27, PRINT_KINDS.index(kind)))
    scene = dataclasses.replace(empty_scene(rng, patterns=PATTERNS), like_simulator=True)
    reach_m = scene.reach_m[0]
    return Site(
        seed=seed,
        kind=kind,
        scene=scene,
        x_m=float(rng.uniform(FARTHEST_M - reach_m, reach_m - BEHIND_M)),
    )


def with_print(site: Site, renderer: SceneRenderer) -> tuple[Scene, FloorPrint]:
    """Return the world with a print of the thing, and the print; `renderer` is that of the seed and
    keeps no world that it has built."""
    rng = site.rng(1)
    draw = float(rng.random())
    sheet = _anamorphic(site, renderer, rng) if draw < ANAMORPHIC_SHARE else None
    if sheet is None:
        is_cut_out = draw < ANAMORPHIC_SHARE + CUT_OUT_SHARE
        sheet = _upright(site, renderer, rng, cut_out=is_cut_out)
    return dataclasses.replace(site.scene, posters=(sheet.poster(),)), sheet


def _upright(
    site: Site, renderer: SceneRenderer, rng: np.random.Generator, *, cut_out: bool
) -> FloorPrint:
    """Return a rendered print, nearly upright as the robot sees it."""
    length_m = DEFAULT_APPEARANCE.height_m if site.kind == PERSON else max(ITEM_SIZES[site.kind])
    width_m = (1 + 2 * PRINT_MARGIN) * length_m * float(rng.uniform(*PRINTED_SCALE))
    askew_rad = float(rng.uniform(-ASKEW_RAD, ASKEW_RAD))
    return FloorPrint(
        picture=renderer.print_of(site.kind, int(rng.integers(PRINTS_OF_EACH))),
        pose=Pose2(x_m=site.x_m, y_m=0.0, yaw_rad=askew_rad + UPRIGHT_RAD),
        size_m=(width_m, width_m * float(rng.uniform(*STRETCH))),
        cut_out=cut_out,
    )


def _anamorphic(site: Site, renderer: SceneRenderer, rng: np.random.Generator) -> FloorPrint | None:
    """Return a print that looks like the thing of the site from one viewpoint; None for a thing
    that needs too long a print."""
    scene, lens = with_thing(site), d455_intrinsics(FINE_PX)
    T_map_camera = site.pose(float(rng.uniform(*VIEWPOINT_M))).matrix() @ T_BASE_CAMERA
    renderer.build(scene)
    rgb, _, labels = renderer.render(T_map_camera, scene, lens=lens)
    shown = labels == LABELS[site.kind]
    rows, cols = np.nonzero(shown)
    rays = pixel_rays(rows, cols, lens) @ T_map_camera[:3, :3].T
    if not len(rays) or rays[:, 2].max() > -SMALLEST_SLOPE:
        return None
    at_m = T_map_camera[:2, 3] - T_map_camera[2, 3] * rays[:, :2] / rays[:, 2:]
    low, high = at_m.min(axis=0), at_m.max(axis=0)
    (x_m, y_m), (length_m, width_m) = (low + high) / 2, high - low
    if length_m > LONGEST_M:
        return None
    share = (np.arange(PRINT_PX) + 0.5) / PRINT_PX
    # Rows begin at the far edge, columns at the left one.
    x, y = np.meshgrid(high[0] - share * length_m, high[1] - share * width_m, indexing="ij")
    floor = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    pixels = project(transform_points(invert(T_map_camera), floor), lens).astype(np.float32)
    col, row = pixels.T.reshape(2, PRINT_PX, PRINT_PX)
    image = cv2.remap(rgb, col, row, cv2.INTER_LINEAR)
    outline = cv2.remap(shown.view(np.uint8), col, row, cv2.INTER_NEAREST) > 0
    return FloorPrint(
        picture=renderer.add_print(np.asarray(image, dtype=np.uint8), np.asarray(outline)),
        pose=Pose2(x_m=float(x_m), y_m=float(y_m), yaw_rad=UPRIGHT_RAD),
        size_m=(float(width_m), float(length_m)),
        cut_out=True,
    )


def with_thing(site: Site) -> Scene:
    """Return the world with the thing itself, of any shape, colours and heading."""
    rng = site.rng(2)
    solids = thing_solids(rng, site.kind)
    pose = Pose2(x_m=site.x_m, y_m=0.0, yaw_rad=float(rng.uniform(-math.pi, math.pi)))
    thing = SolidObject(label=site.kind, solids=solids, pose=pose)
    return dataclasses.replace(site.scene, objects=(*site.scene.objects, thing))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sight:
    """What lies at a site, and how its pixels are known."""

    scene: Scene
    """The world with it."""
    outlined: Callable[[Frame, npt.NDArray[np.float32], Labels], Bools]
    """Returns its (H, W) pixels in a frame, by the depth without errors and the true labels."""

    def view(
        self, renderer: SceneRenderer, pose: Pose2, rng: np.random.Generator
    ) -> tuple[Frame, Bools]:
        """Return the frame of a pose with the errors of the camera, and the (H, W) pixels of what
        lies there; the renderer has built the scene."""
        frame, depth_m, labels = picture(renderer, self.scene, pose, rng)
        return frame, self.outlined(frame, depth_m, labels)


def sights(site: Site, renderer: SceneRenderer) -> tuple[Sight, Sight]:
    """Return the print and the thing at a site."""
    printed, sheet = with_print(site, renderer)
    number = LABELS[site.kind]
    return (
        Sight(scene=printed, outlined=lambda frame, depth_m, _: sheet.outlined(frame, depth_m)),
        Sight(scene=with_thing(site), outlined=lambda _, __, labels: labels == number),
    )
