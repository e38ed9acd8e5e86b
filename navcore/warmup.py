"""Warm-up: compiles all kernels before the robot needs them, in one process or in two at once."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np

from navcore.config.localisation.relocalisation import PlaceSearchConfig, RelocalisationConfig
from navcore.config.mapping import MappingConfig
from navcore.config.navigator import NavigatorConfig
from navcore.control.collision.footprint_distance import contact_slack
from navcore.control.manoeuvre.manoeuvre import ManoeuvreProblem, manoeuvre_along
from navcore.control.motion_primitives import errors_to_path
from navcore.control.motions import dynamic_window
from navcore.control.people.people_state import NO_PEOPLE
from navcore.control.people.social import clear_of_people, waiting_index
from navcore.costmap.live_costmap import LiveCostmap
from navcore.geometry.camera import Intrinsics, pixel_rays
from navcore.geometry.kinematics import arc_position
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.grid.bitplane import plane_of
from navcore.grid.flood_fill import crossings
from navcore.grid.grid import GridSpec
from navcore.localisation.excluded import excluded_pixels
from navcore.localisation.relocalisation.place_map import place_map_of
from navcore.localisation.relocalisation.place_search import search_places
from navcore.localisation.relocalisation.submap import Submap
from navcore.localisation.scans.matching import lines_blocked_share, search
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.localisation.scans.scan_map import ScanMap
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.near_look import has_near_look
from navcore.mapping.points.point_table import POINT
from navcore.mapping.views.extent import measured_bounds
from navcore.mission.beware_list import NOTHING, BewareClass, BewareList, default_beware_list
from navcore.mission.order import NavigationRequest
from navcore.mission.zone import Zone
from navcore.navigator import Navigator, TickResult
from navcore.perception.colour_pattern import FloorGrid
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.depth_filter import heights_above_floor
from navcore.perception.labels import Labels, LabelSource, Segmenter
from navcore.perception.overhang_filter import overhung_regions
from navcore.perception.people.track import Track
from navcore.planning.gap_viewpoint import viewpoint_before_gap
from navcore.planning.global_planner import GlobalPlanner
from navcore.planning.weighted_planner import plan_weighted
from navcore.robot.frame import Frame
from navcore.robot.laser_scan import LaserScan
from navcore.robot.profile import HUSKY
from navcore.safety.collision_monitor import RecentObstacles, time_to_contact

WALL_M = 2.0
"""Distance in metres from the first pose to the wall, which has a low object at its foot."""

_SPEC = GridSpec.centred(size_m=(16.0, 16.0), resolution_m=0.05)
_CONFIG = NavigatorConfig(map=MappingConfig(budget_mb=0.01))
_BEWARE, _GOAL = default_beware_list(), (1.0, 1.0)


def _square(x_m: float) -> Zone:
    corners = ((x_m - 1.0, -1.0), (x_m + 1.0, -1.0), (x_m + 1.0, 1.0), (x_m - 1.0, 1.0))
    return Zone(id="square", name="square", polygon=corners)


_HERE, _AHEAD = _square(0.0), _square(2.2)
_PERSON = Track(
    id=1, x_m=2.0, y_m=0.0, vx_mps=0.0, vy_mps=0.0, radius_m=0.3, age_s=0.0, last_seen_ns=0
)


def warm_up(segmenter: Segmenter | None = None) -> None:
    """Drive a simulated robot towards a synthetic wall, which loads the compiled code from its
    cache or compiles it.

    The given segmenter runs too, by default the colour rules: a network's first images take
    longest.
    """
    beware = default_beware_list()
    for number in range(2):
        (segmenter or ColourSegmenter()).segment(_image(stamp_ns=number, x_m=0.5 * number), beware)
    warm_kernels()


@cache
def warm_kernels() -> None:
    """Call every kernel; those of path planning last, which another process may have compiled
    meanwhile."""
    navigator = Navigator(spec=_SPEC, profile=HUSKY, segmenter=_UnsureSegmenter(), config=_CONFIG)
    way_m = (0.0, 0.5, 0.45, 0.4, 0.35, 0.3, 0.25)
    frames = [_image(stamp_ns=number, x_m=x_m) for number, x_m in enumerate(way_m)]
    idle = NavigationRequest(goal=None, beware=_BEWARE, zones=())
    for frame in frames[:4]:
        decision = navigator.tick(frame, idle)
    _look_closely(frame, decision)
    _search_a_place()
    for frame in frames[4:]:
        decision = navigator.tick(frame, dataclasses.replace(idle, goal=_GOAL))
    navigator.tick(frame, dataclasses.replace(idle, leave=True, zones=(_HERE,)))
    # A goal beyond the map makes it grow.
    decision = navigator.tick(frame, dataclasses.replace(idle, goal=(20.0, 0.0)))
    navigator.preview(decision.occupancy, frame.pose, _GOAL)
    _correct_a_map(navigator.map)
    warm_planning()


def warm_planning() -> None:
    """Call the kernels of path planning and of manoeuvres, about half of all; `warm_kernels` calls
    no others."""
    _plan_paths()
    _manoeuvre()


def _plan_paths() -> None:
    """Plan on an empty map, round a zone, and out of one."""
    point_map = PointMap(_SPEC, _CONFIG.map)
    live = LiveCostmap(
        point_map, vehicle_width_m=HUSKY.width_m, safety_margin_m=_CONFIG.safety_margin_m
    )
    planner = GlobalPlanner(live.space, point_map.explored, HUSKY, _CONFIG)
    pose = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    for zones, leave in (((), False), ((_AHEAD,), False), ((), False), ((_HERE,), True)):
        request = NavigationRequest(
            goal=None if leave else _GOAL, leave=leave, beware=_BEWARE, zones=zones
        )
        costmap = live.follow(_BEWARE, zones)
        planner.route(costmap, pose, request, (), GlobalPlanner.plan)
        planner.preview(costmap, pose, _GOAL)
    # From outside the zone, in which the goal lies.
    viewpoint_before_gap(
        costmap,
        _SPEC.cell(-3.0, 0.0),
        _SPEC.cell(*_GOAL),
        vehicle_width_m=0.7,
        relief_cells=9.0,
        body_m=_CONFIG.map.body_m,
    )
    plane = costmap.free.plane
    crossings(plane, np.zeros_like(plane), plane, plane_of(_SPEC.cell(*_GOAL), like=plane))
    free = np.ones((4, 4), dtype=np.bool_)
    plan_weighted(free, ~free, 2.0, (0, 0), (3, 3))


def _manoeuvre() -> None:
    """Move where it is tight, and where people are in the way."""
    tight = ManoeuvreProblem(
        obstacles=np.array([[WALL_M, 0.0]]),
        cell_radius_m=0.04,
        unseen=np.empty((0, 2)),
        unseen_clearance_m=0.0,
        profile=HUSKY,
        clearance_m=0.06,
    )
    path = np.array([[0.0, 0.0], [0.5, 0.5], [1.0, 1.0]])
    manoeuvre_along(path, tight, Pose2(x_m=0.4, y_m=0.0, yaw_rad=0.0))
    poses = np.zeros((1, 2, 3))
    person = dataclasses.replace(NO_PEOPLE, walking=np.array([[3.0, 0.0, 0.0, 1.0, 0.3]]))
    clear_of_people(person, poses, poses[..., 0].copy(), HUSKY, _CONFIG.people)
    waiting_index(person, poses[0], poses[0, :, 0].copy(), HUSKY, _CONFIG.people)
    errors_to_path(path, poses, horizon_m=1.0, tangent_m=0.2)
    arc_position(0.5, 0.1, 0.2)
    contact_slack(path, path[:, 0].copy(), poses, 0.5, 0.3)
    dynamic_window.warm(HUSKY)


def _look_closely(frame: Frame, decision: TickResult) -> None:
    """Call what a drive towards a wall seldom or never reaches in a frame."""
    measured_bounds(frame.depth_m, frame.T_map_camera, frame.intrinsics.pinhole, 5.0)
    FloorGrid.of(frame, _CONFIG.perception.colour)
    rules = _CONFIG.map
    has_near_look(np.zeros(1, dtype=POINT), frame, rules.clearing, rules.fading.rules)
    # On rising ground, and then without it.
    contacts = RecentObstacles().after(_image(stamp_ns=0, x_m=-WALL_M, floor_z_m=0.04), HUSKY)
    contacts = contacts.after(frame, HUSKY).after(frame, HUSKY)
    time_to_contact(contacts.points, Twist(v_mps=0.5, w_radps=0.1), HUSKY)
    excluded_pixels(frame, decision.labels, (_PERSON,))
    overhung_regions(
        _UnsureSegmenter().segment(frame, _BEWARE).class_ids,
        frame,
        heights_above_floor(frame),
        _BEWARE,
        HUSKY.depth_sensor,
    )


def _search_a_place() -> None:
    """Search some points in a map of the same points, as a lost robot does."""
    points = np.array([[0.3 * k, 0.1 * (k % 3)] for k in range(20)])
    normals = np.tile([0.0, 1.0], (20, 1))
    rules = RelocalisationConfig(search=PlaceSearchConfig(least_points=5))
    seen = Submap(
        points=points.copy(),
        normals=normals.copy(),
        origins=points + 1.0,
        T_odom_base=Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0),
    )
    scan = Scan(
        points_base=points.copy(),
        variance_m2=np.full(len(points), 1e-4),
        normals=normals.copy(),
        origin=np.zeros(2),
    )
    shown = (Keyframe(pose_id=0, T_map_base=seen.T_odom_base, scan=scan),)
    search_places(seen, place_map_of(points, normals, rules.search, shown), rules)
    seen_again = ScanMap()
    seen_again.put(shown[0])
    search(scan, seen_again, seen.T_odom_base)
    lines_blocked_share(scan, seen_again, seen.T_odom_base)


def _correct_a_map(point_map: PointMap) -> None:
    """Correct the poses of a map, as a loop closure does, and erase and put back, as operators
    do."""
    moved = Pose2(x_m=0.1, y_m=0.05, yaw_rad=0.02)
    for _ in range(2):
        point_map.correct({pose_id: moved @ pose for pose_id, pose in enumerate(point_map.poses)})
    everywhere = np.arange(point_map.spec.rows * point_map.spec.cols)
    point_map.edits.put_back(point_map.edits.erase(everywhere, [NOTHING]))


class _UnsureSegmenter:
    """Labels red pixels as a low object with little confidence, so that the kernels for a network's
    labels are compiled too."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Return the same class for all red pixels."""
        low = max(entry.class_id for entry in beware.classes if entry.max_height_m)
        class_ids = np.where(frame.rgb[..., 0] > 0, np.uint8(low), np.uint8(NOTHING))
        return Labels(
            class_ids=class_ids,
            confidence=np.where(class_ids > 0, np.float32(0.7), np.float32(1.0)),
        )

    def source_of(self, entry: BewareClass) -> LabelSource:
        """Return that no class is detected."""
        return LabelSource.NOTHING


def _image(*, stamp_ns: int, x_m: float, floor_z_m: float = 0.0) -> Frame:
    """Return the image of a wall, grey above and red at its foot, with the floor before it."""
    lens, mount = (
        Intrinsics(width=160, height=120, fx=80.0, fy=80.0, cx=79.5, cy=59.5),
        HUSKY.camera.T_base_camera,
    )
    columns, rows = np.meshgrid(np.arange(lens.width), np.arange(lens.height))
    rays = pixel_rays(rows, columns, lens) @ mount[:3, :3].T
    with np.errstate(divide="ignore"):
        floor_m = np.where(rays[..., 2] < 0, (mount[2, 3] - floor_z_m) / -rays[..., 2], np.inf)
    wall_m = (WALL_M - x_m - mount[0, 3]) / rays[..., 0]
    depth_m = np.minimum(floor_m, wall_m).astype(np.float32)
    rgb = np.zeros((*depth_m.shape, 3), dtype=np.uint8)
    rgb[(wall_m < floor_m) & (rows > lens.height // 2), 0] = 200
    # Read-only like real ones: to the compiler that is a type of its own.
    depth_m.flags.writeable = rgb.flags.writeable = False
    pose = Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0)
    return Frame(
        stamp_ns=stamp_ns,
        rgb=rgb,
        depth_m=depth_m,
        intrinsics=lens,
        T_base_camera=mount,
        pose=pose,
        twist=STANDSTILL,
        scan=LaserScan(
            ranges_m=np.full(720, WALL_M, dtype=np.float32), x_m=0.0, max_range_m=2 * WALL_M
        ),
    )
