"""Small robot behind the console, in memory: the real values and rules of the navigation in a world
of rectangles."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
import shutil
import tempfile
import threading
import uuid
import weakref
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path as FilePath

import numpy as np
import numpy.typing as npt

from app.console.beware.beware_editor import BewareEditor
from app.console.beware.beware_map import BewareMap
from app.console.beware.colour_rules import LiveColourRules
from app.console.beware.examples import LiveExamples
from app.console.beware.recent_frames import RecentFrames
from app.console.edit_history import AllEdits
from app.console.mission.expiry_dates import ExpiryDates
from app.console.mission.goals import Goals
from app.console.mission.path_preview import Planner, compare, compare_lists, grid_with, pose_at
from app.console.mission.path_settings import PathSettings
from app.console.mission.saved_missions import SavedMissions
from app.console.mission.zone_editor import ZoneEditor
from app.console.site.map_editor import MapEditor
from app.insight.explanation import ExplanationQuery
from app.runtime.control.operator_state import OperatorState
from app.runtime.start.live_perception import LivePerception
from app.runtime.start.segmentation import colour_perception, compose
from app.teaching.service import LiveTeaching
from navcore.config.mapping import MappingConfig
from navcore.config.navigator import NavigatorConfig
from navcore.control.speed_limits import travel_time_s
from navcore.costmap.costmap import Costmap
from navcore.errors import BadConfiguration, NotKnown, Refused
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import BoolGrid, OccupancyGrid
from navcore.grid.growth import growth_into, padded
from navcore.mapping.point_map import PointMap
from navcore.mission.beware_list import BewareList, default_beware_list
from navcore.mission.mission import Mission, Phase
from navcore.mission.zone import Zone
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.fused_segmenter import FusedSegmenter
from navcore.planning.path import NoPath, Path
from navcore.planning.planner import plan
from navcore.planning.string_pulling import taut_corners
from navcore.planning.unseen_parts import Parts, unseen_m, unseen_parts
from navcore.planning.weighted_planner import plan_weighted
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY, RobotProfile
from navcore.safety.gate import Cause, StopReason
from tests.navcore.perception.colour_network import ColourNetwork
from tests.web.fake_insight import FakeInsight
from tests.web.fake_place import FakePlace
from tests.web.fake_sites import FakeSites
from tests.web.fake_world import (
    INTRINSICS,
    MARGIN_M,
    RED_FLOOR,
    SPEC,
    T_BASE_CAMERA,
    box,
    camera_image,
    depth_image,
    inflated,
    layered,
    walls,
)
from tests.web.memory_store import MemoryStore
from web.interface.beware import ListPreview
from web.interface.drafts import PathPreview, Preview, PreviewDraft
from web.interface.operations import MissionAction
from web.interface.snapshots import Cloud, State, TickSnapshot

STEP_M = 0.1


class FakeOperations:
    """Implementation of `web.interface.operations.RobotService`; `step` moves the robot along its
    path."""

    def __init__(
        self, *, robot_urdf: FilePath | None = None, network: ColourNetwork | None = None
    ) -> None:
        """`network` is what classes by example are made with; None for colour rules alone."""
        self._lock = threading.RLock()
        self._intent = OperatorState(mission=Mission(), beware=default_beware_list())
        store, self.calendar_s = MemoryStore(), 1e9
        number = itertools.count(1).__next__
        self.view = FakeView()
        self.goals = Goals(
            self,
            view=self.view,
            spec=lambda: SPEC,
            inflate=lambda grid: Costmap.of(grid, inflated(grid), version=0),
            saved=SavedMissions(store),
        )
        self.zones = ZoneEditor(
            self,
            store=store,
            dates=ExpiryDates(lambda: self.calendar_s, lambda: self.calendar_s),
            new_id=_ids().__next__,
            number=number,
        )
        self.map_posts: list[Callable[[PointMap], None]] = []
        self.point_map = PointMap(SPEC, MappingConfig())
        self.point_map.pose_ids.id_of(Pose2(x_m=-6.0, y_m=0.0, yaw_rad=0.0))
        self.recent = RecentFrames()
        segmenter = (
            ColourSegmenter() if network is None else FusedSegmenter(network, HUSKY.depth_sensor)
        )
        self.examples = LiveExamples(
            self.recent, lambda: network, poses=lambda: self.point_map.poses
        )
        self.beware_map = BewareMap(
            self,
            point_map=self.point_map,
            recent=self.recent,
            segmenter=segmenter,
            config=NavigatorConfig(),
            examples=self.examples,
        )
        self.beware = BewareEditor(
            self,
            store=store,
            segmenter=segmenter,
            colours=LiveColourRules(self.recent),
            follower=self.beware_map,
            examples=self.examples,
            calendar_s=lambda: self.calendar_s,
            number=number,
        )
        self.path_settings = PathSettings(self, store=store, configured=1.0, number=number)
        self.edits = AllEdits(lambda: (self.zones, self.beware, self.map_edits, self.path_settings))
        self.map_edits = MapEditor(
            self,
            point_map=self.point_map,
            detections=lambda: self.insight.detections,
            beware=lambda: self._intent.beware,
            tell=lambda text, place: None,
            number=number,
        )
        self.sites = FakeSites(lambda: self._intent.mission.phase is Phase.DRIVING)
        self._pose = Pose2(x_m=-6.0, y_m=0.0, yaw_rad=0.0)
        self._driven = [(-6.0, 0.0)]
        self._poses = [self._pose, Pose2(x_m=-5.0, y_m=0.0, yaw_rad=0.0)]
        self._stopped_by: str | None = None
        self._counts = {"serial": 0, "grid": 0, "replans": 0}
        self._urdf = robot_urdf
        self.stops: list[str] = []
        self.backed_off = 0
        self.hand: Twist | None = None
        self.hands: list[Twist | None] = []
        self.segmenter_warning: str | None = None
        self.stop_warning: str | None = None
        self.storage_warning: str | None = None
        self.closed: tuple[Zone, ...] = ()
        self._world = {0: walls(), RED_FLOOR: box(-1.5, 0.5, -1.0, 1.0)}
        self._seen = np.ones((SPEC.rows, SPEC.cols), dtype=np.bool_)
        self._seen[:, -30:] = False
        self._see()
        self.insight = FakeInsight(self._case, lambda: self._pose)
        self.teaching = self._teaching()
        self.place = FakePlace(self._move_to, lambda: self._intent.mission.phase)

    def _teaching(self) -> LiveTeaching:
        """Return the real one in a folder that lives as long as this robot."""
        folder = FilePath(tempfile.gettempdir()) / f"taught-{uuid.uuid4().hex}"
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        recent = self.recent
        return LiveTeaching(
            folder,
            newest=lambda: None if recent.newest is None else recent.newest.frame,
            beware=lambda: self._intent.beware,
            perception=LivePerception(colour_perception()),
            compose=functools.partial(compose, sensor=HUSKY.depth_sensor),
        )

    # Reading

    def _move_to(self, pose: Pose2) -> None:
        with self._lock:
            self._pose = pose

    @property
    def profile(self) -> RobotProfile:
        """Profile of the Husky."""
        return HUSKY

    @property
    def robot_urdf(self) -> FilePath | None:
        """URDF file of the test."""
        return self._urdf

    def state(self) -> State:
        """Return the newest snapshot."""
        with self._lock:
            reasons, picture = self._reasons(), self.newest_tick()
            moving = self._intent.mission.goal is not None and not reasons
            return State(
                stamp_s=0.1 * self._counts["serial"],
                scenario="fake hall",
                site=self.sites.chosen,
                site_id=self.sites.chosen_id,
                robot=HUSKY.name,
                phase=self._intent.mission.phase,
                moving=moving or self.hand is not None,
                by_hand=self.hand is not None,
                summary=self._summary(reasons, moving),
                stop_latched=self._stopped_by is not None,
                stop_pressed=self._stopped_by is not None,
                stops=len(self.stops),
                reasons=reasons,
                pose=self._pose,
                place=self.place.status(),
                twist=Twist(v_mps=0.5, w_radps=0.0) if moving else STANDSTILL,
                command=Twist(v_mps=0.5, w_radps=0.0) if moving else STANDSTILL,
                queue=self._intent.mission.queue,
                reached=self._intent.mission.reached,
                reached_count=self._intent.mission.reached_count,
                distance_to_goal_m=self._length(self._path),
                travelled_m=STEP_M * (len(self._driven) - 1),
                unseen_m=picture.unseen_m if picture else None,
                unknown_price=self.path_settings.unknown_price,
                explored_m2=float(self._seen.sum()) * SPEC.resolution_m**2,
                replans=self._counts["replans"],
                tick_ms=12.5,
                frame_age_s=0.05,
                map_age_s=0.05,
                zones_version=self.zones.changes,
                beware_version=self._intent.beware.version,
                beware_enabled=len(self._intent.beware.enabled),
                segmenter="colour rules",
                segmenter_warning=self.segmenter_warning,
                stop_warning=self.stop_warning,
                storage_warning=self.storage_warning,
                loop=self._intent.mission.loop,
                picture_serial=picture.serial if picture else None,
                grid_version=picture.grid_version if picture else None,
                grid_spec=picture.grid_spec if picture else None,
            )

    def newest_tick(self) -> TickSnapshot | None:
        """Return the values of the newest tick."""
        with self._lock:
            return self._picture

    def cloud(self) -> Cloud | None:
        """Return the walls as points."""
        points, rgb, ids = [], [], []
        for class_id, mask in self._world.items():
            cells = SPEC.centres(np.argwhere(mask))
            for height in (0.01,) if class_id else (0.1, 0.4, 0.7, 1.0):
                points.append(np.column_stack([cells, np.full(len(cells), height)]))
                rgb.append(np.tile((200, 30, 30) if class_id else (150, 150, 160), (len(cells), 1)))
                ids.append(np.full(len(cells), class_id))
        return Cloud(
            serial=1,
            points_map=np.vstack(points).astype(np.float32),
            rgb=np.vstack(rgb).astype(np.uint8),
            class_ids=np.concatenate(ids).astype(np.uint8),
        )

    # Mission

    def mission(self, action: MissionAction) -> None:
        """Implement the port."""
        self._change(getattr(Mission, action))

    def back_off(self) -> None:
        """Count the calls."""
        self.backed_off += 1

    def stop(self, source: str) -> None:
        """Implement the port."""
        with self._lock:
            self.stops.append(source)
            self._stopped_by = self._stopped_by or source

    def drive(self, twist: Twist | None) -> None:
        """Record the velocity; it does not expire in this world."""
        with self._lock:
            if twist is not None and self._stopped_by is not None:
                raise Refused("the emergency stop is latched; reset it first")
            if twist is not None and self._intent.mission.phase is Phase.DRIVING:
                self._set_mission(self._intent.mission.pause())
            self.hand = twist
            self.hands.append(twist)

    def reset_stop(self, stops: int | None = None) -> None:
        """Implement the port."""
        with self._lock:
            if stops not in (None, len(self.stops)):
                raise Refused("the stop was pressed again meanwhile; look why, then reset it")
            self._stopped_by = None
            if self._intent.mission.phase is Phase.DRIVING:
                self._set_mission(self._intent.mission.pause())

    def step(self) -> None:
        """Run one tick: the robot moves one step along its path, or arrives at its end."""
        with self._lock:
            goal = self._intent.mission.goal
            if goal is not None and not self._reasons() and len(self._path):
                x, y = self._path[min(1, len(self._path) - 1)]
                yaw = (
                    math.atan2(y - self._pose.y_m, x - self._pose.x_m)
                    if len(self._path) > 1
                    else self._pose.yaw_rad
                )
                self._pose = Pose2(x_m=float(x), y_m=float(y), yaw_rad=yaw)
                self._driven.append((float(x), float(y)))
                if len(self._path) <= 2:
                    self._set_mission(self._intent.mission.arrive())
            self._see()

    def preview(self, draft: PreviewDraft) -> Preview:
        """Implement the port."""
        with self._lock:
            queue = self._intent.mission.queue
            if draft.goal is None and not queue:
                raise Refused("there is no goal to preview a path to; give one")
            goal = draft.goal or (queue[0].x_m, queue[0].y_m)
            grid_with(self._picture.grid, [goal] if draft.start is None else [draft.start, goal])
            pose = self._pose if draft.start is None else pose_at(draft.start)
            zone = (
                None
                if draft.zone is None
                else self.zones.checked(draft.zone, zone_id="draft", version=1)
            )

            return compare(
                self._picture.grid,
                self.zones.stored,
                self._planner(pose, goal, draft.unknown_price),
                draft=zone,
                replaces=draft.replaces,
                in_force=None if draft.unknown_price is None else self._planner(pose, goal),
            )

    def preview_list(self, beware: BewareList) -> ListPreview:
        """Implement the port."""
        with self._lock:
            present, drafted = (
                layered(self._world, listed, self.zones.stored)
                for listed in (self._intent.beware, beware)
            )
            return compare_lists(
                present,
                drafted,
                self.zones.stored,
                lambda goal: self._planner(self._pose, goal),
                self._intent.mission.queue,
            )

    def _planned(
        self, blocked: BoolGrid, pose: Pose2, goal: tuple[float, float], price: float
    ) -> tuple[Path | NoPath, npt.NDArray[np.float64]]:
        ends = SPEC.cell(pose.x_m, pose.y_m), SPEC.cell(*goal)
        if price > 1:
            outcome = plan_weighted(~blocked, ~self._seen, price, *ends)
        else:
            outcome = plan(blocked, *ends)
        if isinstance(outcome, NoPath):
            return outcome, np.empty((0, 2))
        return outcome, SPEC.centres(outcome.cells)

    def _planner(
        self, pose: Pose2, goal: tuple[float, float], unknown_price: float | None = None
    ) -> Planner:
        price = self.path_settings.unknown_price if unknown_price is None else unknown_price

        def plan(grid: OccupancyGrid, zones: tuple[Zone, ...]) -> PathPreview:
            outcome, points = self._planned(inflated(grid), pose, goal, price)
            length = self._length(points)
            time_s = None if length is None else travel_time_s(points, zones, HUSKY)
            return PathPreview(
                outcome=outcome,
                points=points,
                length_m=length,
                time_s=time_s,
                unseen_m=unseen_m(points, self._unseen(points)),
            )

        return plan

    # Runs

    def poses(self) -> tuple[Pose2, ...]:
        """Implement the port."""
        return tuple(self._poses)

    def correct_poses(self, poses: Mapping[int, Pose2]) -> None:
        """Implement the port."""
        for pose_id in poses:
            if pose_id >= len(self._poses):
                raise BadConfiguration(
                    f"pose ID {pose_id} is not on the map, which has {len(self._poses)}"
                )
        for pose_id, pose in poses.items():
            self._poses[pose_id] = pose

    def edit_map(self, edit: Callable[[PointMap], None]) -> None:
        """Edit a map without points."""
        self.map_posts.append(edit)
        edit(self.point_map)

    def runs(self) -> tuple[Mapping[str, object], ...]:
        """Return a past mission, and one that was cut off."""
        cut_off = {"id": "run-0", "unfinished": True, "goals": [[1.0, 0.0]], "goal_count": 5003}
        begun = {"begun_unix_s": 1_700_000_000, "site": "ward", "cancelled": True}
        return (
            {"id": "run-1", "scenario": "fake hall", "success": True, "spl": math.nan, **begun},
            {**cut_off, "goals_reached": 5000},
        )

    def run(self, run_id: str) -> Mapping[str, object]:
        """Return that mission."""
        if run_id != "run-1":
            raise NotKnown("no run has this id")
        return {**self.runs()[0], "series": {"t_s": [0.0, 1.0, 2.0], "speed_mps": [0.0, 0.3, 0.5]}}

    # Inside

    def _case(self) -> ExplanationQuery:
        with self._lock:
            if not self._intent.mission.queue:
                raise Refused("there is no goal, so there is no path to explain; add a goal first")
            goal = self._intent.mission.queue[0]
            return ExplanationQuery(
                occupancy=self._picture.occupancy,
                beware=self._intent.beware,
                zones=self.zones.stored,
                pose=self._pose,
                goal=(goal.x_m, goal.y_m),
                goal_tolerance_m=0.0,
                path=None,
                profile=HUSKY,
                safety_margin_m=MARGIN_M,
                start_relief_m=0.5,
            )

    @property
    def intent(self) -> OperatorState:
        """Present state of the operator."""
        return self._intent

    def change(self, edit: Callable[[OperatorState], OperatorState]) -> OperatorState:
        """Replace the state of the operator and run a tick."""
        with self._lock:
            self._intent = edit(self._intent)
            self._see()
            return self._intent

    def unsee(self, left: float, right: float, low: float, high: float) -> None:
        """Forget that a rectangle of floor was seen."""
        with self._lock:
            self._seen &= ~box(left, right, low, high)
            self._see()

    def block_by_red(self) -> None:
        """Paint the floor red from wall to wall."""
        with self._lock:
            self._world[RED_FLOOR] = box(-1.5, 0.5, -5.9, 5.9)
            self._see()

    def grow(self, x_m: float, y_m: float) -> None:
        """Let the map grow to a point, as it does when the robot or a goal is there."""
        with self._lock:
            old, self._counts["grid"] = self._picture, self._counts["grid"] + 1
            grid = padded(old.grid, [(x_m, y_m)])
            growth = growth_into(old.grid_spec, grid.spec)
            assert growth is not None
            blocked = growth.mask(CellMask.of(old.blocked)).bools
            self.view.picture = dataclasses.replace(
                old,
                occupancy=Costmap.of(grid, blocked, version=self._counts["grid"]),
                seen_mask=growth.mask(old.seen_mask),
                grid_version=self._counts["grid"],
            )

    @property
    def _picture(self) -> TickSnapshot:
        assert self.view.picture is not None
        return self.view.picture

    def _set_mission(self, mission: Mission) -> None:
        self._intent = dataclasses.replace(self._intent, mission=mission)

    def _change(self, edit: Callable[[Mission], Mission]) -> None:
        self.change(lambda state: dataclasses.replace(state, mission=edit(state.mission)))

    def _reasons(self) -> tuple[StopReason, ...]:
        found = []
        if self._stopped_by is not None:
            found.append(
                StopReason(
                    cause=Cause.EMERGENCY_STOP,
                    text=f"Emergency stop by {self._stopped_by}; it holds until it is reset.",
                )
            )
        goal = self._intent.mission.goal
        if goal is not None and not len(self._path):
            text = f"There is no path to the goal {goal.title}: unreachable."
            found.append(StopReason(cause=Cause.NO_PATH, text=text))
        return tuple(found)

    def _summary(self, reasons: tuple[StopReason, ...], moving: bool) -> str:
        queue = self._intent.mission.queue
        if reasons:
            return reasons[0].text
        if moving:
            return f"Driving to {queue[0].title}: following the path."
        if not queue:
            return "Standing; pick a goal to begin."
        goals = "goal waits" if len(queue) == 1 else "goals wait"
        return f"Standing; {len(queue)} {goals} for start."

    def _see(self) -> None:
        counts = self._counts
        counts["serial"] += 1
        grid = layered(self._world, self._intent.beware, self.zones.stored)
        blocked = inflated(grid)
        old = self.view.picture
        if (
            old is None
            or not np.array_equal(old.blocked, blocked)
            or grid.beware.keys() != old.grid.beware.keys()
        ):
            counts["grid"] += 1
        self._path, waypoints = np.empty((0, 2)), np.empty((0, 2))
        if self._intent.mission.queue:
            counts["replans"] += 1
            goal = self._intent.mission.queue[0]
            price = self.path_settings.unknown_price
            outcome, self._path = self._planned(blocked, self._pose, (goal.x_m, goal.y_m), price)
            if isinstance(outcome, Path):
                corners = taut_corners(outcome.cells, CellMask.of(~blocked).plane)
                waypoints = SPEC.centres(corners[1:])
        rgb, labels = camera_image()
        depth_m = depth_image()
        frame = Frame(
            stamp_ns=counts["serial"] * 100_000_000,
            rgb=rgb,
            depth_m=depth_m,
            intrinsics=INTRINSICS,
            T_base_camera=T_BASE_CAMERA,
            pose=self._pose,
            twist=STANDSTILL,
        )
        self.recent.note(frame, 0, self.point_map.poses[0])
        self.view.picture = TickSnapshot(
            serial=frame.stamp_ns,
            pose=self._pose,
            T_map_camera=self._pose.matrix() @ T_BASE_CAMERA,
            intrinsics=INTRINSICS,
            rgb=rgb,
            labels=labels,
            confidence=np.full(labels.shape, 0.9, dtype=np.float32),
            occupancy=Costmap.of(grid, blocked, version=counts["grid"]),
            seen_mask=CellMask.of(self._seen),
            grid_version=counts["grid"],
            path=self._path,
            unseen=self._unseen(self._path),
            waypoints=waypoints,
            driven=np.array(self._driven),
            closed=self.closed,
            depth_m=depth_m,
        )

    def _unseen(self, points: npt.NDArray[np.float64]) -> Parts:
        return unseen_parts(points, CellMask.of(self._seen), SPEC)

    @staticmethod
    def _length(points: npt.NDArray[np.float64]) -> float | None:
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()) if len(points) else None


class FakeView:
    """View of the newest map."""

    picture: TickSnapshot | None = None


def _ids() -> Iterator[str]:
    return (f"z{number}" for number in itertools.count(1))
