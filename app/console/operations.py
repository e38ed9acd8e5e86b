"""The console's port on a running robot: operators' requests go to the robot controller and the
store, snapshots come from the newest tick."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path as FilePath
from typing import Any

from app.console.back_off import BackOff
from app.console.beware.beware_editor import BewareEditor
from app.console.beware.beware_map import BewareMap
from app.console.beware.colour_rules import LiveColourRules
from app.console.beware.examples import LiveExamples
from app.console.beware.recent_frames import RecentFrames
from app.console.edit_history import AllEdits
from app.console.mission.anchored_items import AnchoredItems
from app.console.mission.expiry_dates import ExpiryDates
from app.console.mission.goals import Goals
from app.console.mission.path_settings import PathSettings
from app.console.mission.previews import Previews
from app.console.mission.saved_missions import SavedMissions
from app.console.mission.zone_editor import ZoneEditor
from app.console.site.map_editor import MapEditor
from app.console.site.place_editor import PlaceEditor, require_known
from app.console.site.sites import LiveSites
from app.console.status_message import stands_in_zone, status_message
from app.insight.labelling import LabellingFolder
from app.insight.service import LiveInsight
from app.runtime.control.operator_state import MOVING, OperatorState, PlaceSearch
from app.runtime.control.robot_controller import RobotController
from app.runtime.record.map_keeper import MapKeeper
from app.runtime.record.recorder import Recorder
from app.runtime.start.live_perception import LivePerception
from app.runtime.start.segmenter_choice import SegmenterChoice
from app.storage import Store
from app.storage.site_store import SiteStore
from app.teaching.networks.live_networks import Compose
from app.teaching.networks.versions import START
from app.teaching.service import DEFAULT_CHOICE, LiveTeaching
from navcore.config.navigator import NavigatorConfig
from navcore.config.safety import DEFAULT_SAFETY
from navcore.errors import Refused
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.localisation.fixes import TagMap
from navcore.mission.beware_list import BewareList
from navcore.mission.mission import Mission, Phase
from navcore.navigator import TickResult
from navcore.planning.path import NoPath
from navcore.robot.driver import Command, Robot
from navcore.robot.frame import Frame
from navcore.robot.profile import RobotProfile
from navcore.safety.gate import GateDecision
from web.interface.beware import ListPreview
from web.interface.drafts import Preview, PreviewDraft
from web.interface.meant_site import require_meant_site
from web.interface.operations import MissionAction
from web.interface.snapshots import Cloud, State, TickSnapshot

MOVING_MPS = 1e-3
"""Commanded speed from which the robot is shown as moving, m/s or rad/s."""
TRANSITIONS = {
    "start": Mission.start,
    "pause": Mission.pause,
    "resume": Mission.resume,
    "cancel": Mission.cancel,
    "leave": Mission.leave,
}
"""Transition of the mission for each action of the operator."""


class LiveOperations:
    """Satisfies the console's port `RobotService` for a running robot."""

    def __init__(
        self,
        *,
        robot: Robot,
        controller: RobotController,
        store: Store,
        recorder: Recorder,
        robot_urdf: FilePath | None,
        perception: LivePerception,
        data: FilePath,
        config: NavigatorConfig,
        compose: Compose,
        keeper: MapKeeper | None = None,
        has_own_map: bool = True,
        world_tags: TagMap | None = None,
        new_beware: BewareList | None = None,
        choice: SegmenterChoice = DEFAULT_CHOICE,
        network: str = START,
        stop_warning: Callable[[], str | None] = lambda: None,
        storage_warning: Callable[[], str | None] = lambda: None,
    ) -> None:
        """`data`: folder of what operators correct and teach.

        `keeper` keeps the map on disk, in the folder of the site if the site `has_own_map`.
        `new_beware`: beware list of a new site, by default the shipped one.
        `choice`: options of the segmenter; `network`: version of it that is in use; `compose` makes
        another perception. `stop_warning`: why the stop would not hold over a restart;
        `storage_warning`: what else would be lost by one."""
        self._robot, self._controller, self._store, self._recorder = (
            robot,
            controller,
            store,
            recorder,
        )
        self._urdf, self._perception = robot_urdf, perception
        self._stop_warning, self._storage_warning = stop_warning, storage_warning
        self._verdict = GateDecision(twist=STANDSTILL, reasons=())
        self.keeper = keeper or MapKeeper(store.site.map_file, {})
        """Keeps the map on disk."""
        self._edits_before, self._new_beware = 0, new_beware
        self._number, self._recent = itertools.count(1).__next__, RecentFrames()
        self._dates = ExpiryDates()
        self._config = config
        self._examples = LiveExamples(
            self._recent,
            lambda: perception.now.examples,
            poses=lambda: controller.navigator.map.poses,
            config=config.perception,
        )
        self._beware_map = BewareMap(
            controller,
            point_map=controller.navigator.map,
            recent=self._recent,
            segmenter=perception,
            config=config,
            examples=self._examples,
        )
        self._previews = Previews(controller, view=recorder, beware_map=self._beware_map)
        self._anchored = AnchoredItems(
            lambda: self.zones, lambda: controller.intent.mission, controller.change_mission
        )
        self._edit(store.site)
        self.sites = LiveSites(
            store,
            controller=controller,
            view=recorder,
            keeper=self.keeper,
            user=self,
            config=config.map,
            world=recorder.scenario,
            has_own_map=has_own_map,
            world_tags=world_tags,
            new_beware=new_beware,
        )
        self.place = PlaceEditor(controller, lambda text: self.insight.note_place([text]))
        self._back_off = BackOff(
            controller,
            drive=self._driving,
            resume=lambda intent: self._after("resume", intent),
            pose=self._odometry,
        )
        self.map_edits = self._map_editor()
        self.edits = AllEdits(lambda: (self.zones, self.beware, self.map_edits, self.path_settings))
        self.insight = LiveInsight(
            controller=controller,
            recorder=recorder,
            labelling=LabellingFolder(data / "labelling"),
            config=config,
            clock=robot,
            store=store.events,
        )
        self.teaching = LiveTeaching(
            data / "teaching",
            newest=self._newest_frame,
            beware=lambda: controller.intent.beware,
            perception=perception,
            choice=choice,
            used=network,
            compose=compose,
        )

    def _newest_frame(self) -> Frame | None:
        """Return the frame of the newest tick, placed in the map; None before the first."""
        decision = self._controller.tick_state.decision
        return None if decision is None else decision.frame

    def _edit(self, site: SiteStore) -> None:
        """Edit the contents of a site."""
        controller = self._controller
        self.goals = Goals(
            controller,
            view=self._recorder,
            spec=lambda: controller.navigator.map.spec,
            inflate=controller.navigator.inflate_draft,
            saved=SavedMissions(site, self._anchored),
            site_id=site.id,
        )
        self.zones = ZoneEditor(
            controller,
            store=site,
            watcher=self._recorder,
            dates=self._dates,
            anchors=self._anchored,
            number=self._number,
        )
        self.beware = BewareEditor(
            controller,
            store=site,
            segmenter=self._perception,
            colours=LiveColourRules(self._recent, self._config.perception),
            follower=self._beware_map,
            examples=self._examples,
            defaults=self._new_beware,
            number=self._number,
        )

        self.path_settings = PathSettings(
            controller,
            store=site,
            configured=self._config.planning.unknown_price,
            number=self._number,
        )

    def _map_editor(self) -> MapEditor:
        """Return an editor of the map of the present site."""
        return MapEditor(
            self._controller,
            point_map=self._controller.navigator.map,
            detections=lambda: self.insight.detections,
            beware=lambda: self._controller.intent.beware,
            tell=lambda text, place: self.insight.note_map(text, place),
            number=self._number,
        )

    @contextmanager
    def leaving_site(self, keep_map: Callable[[], None]) -> Iterator[None]:
        """Hold every edit of the present site, and call `keep_map` once none changes its map any
        more; after the block they are refused."""
        with self.beware.retired(), self.map_edits.retired(), self.path_settings.retired():
            keep_map()  # by a tick, which may have to move the zones first
            with self.zones.retired():
                self._anchored.leave()
                try:
                    yield
                except BaseException:
                    self._anchored.begin(is_new=False)
                    raise

    def enter_site(self, site: SiteStore) -> None:
        """Edit the contents of another site from now on."""
        self._edits_before += self.zones.changes + 1
        self._edit(site)
        self.map_edits = self._map_editor()
        self._recorder.watch_zones(self.zones.stored)
        self._forget_map()
        # The tick that runs now still notes what it saw on the map before.
        self._controller.edit_map(lambda _: self._begin_map())

    def _begin_map(self) -> None:
        """Begin on the map of another site, in the thread of the ticks."""
        self._forget_map()
        self._anchored.begin(is_new=True)
        self._recorder.forget_path()

    def _forget_map(self) -> None:
        """Forget what was seen on another map."""
        self.insight.forget_place()
        self._recent.forget()

    @property
    def profile(self) -> RobotProfile:
        """Profile of the platform."""
        return self._controller.profile

    @property
    def robot_urdf(self) -> FilePath | None:
        """URDF file of the robot for the 3D view; None without one."""
        return self._urdf

    def note_verdict(self, verdict: GateDecision) -> None:
        """Called by the command thread after each command."""
        self._verdict = verdict
        self._recorder.note_verdict(verdict)
        self.insight.note_verdict(verdict)

    def note_decision(self, decision: TickResult) -> None:
        """Called by the think thread after each tick."""
        navigator = self._controller.navigator
        point_map, pose_ids = navigator.map, navigator.map.pose_ids
        # First, so that zones and goals follow the map whatever fails below.
        has_moved = decision.correction is not None or decision.taken_back
        moved = self._anchored.note_tick(pose_ids, has_moved=has_moved)
        self._recorder.note_decision(decision)
        self.insight.note_decision(decision)
        if decision.taken_back:
            self._recent.forget()
        if decision.place.is_known and (at := pose_ids.known(decision.frame.pose)) is not None:
            self._recent.note(decision.frame, at, pose_ids[at], point_map.edits.erasures)
            self.teaching.note(decision.frame)
        self.insight.note_place(moved)
        request = self._controller.tick_state.request
        names = {} if request is None else request.beware.names
        self.keeper.note_tick(point_map, names, decision.frame.stamp_ns, held=navigator.held_map)

    # Snapshots

    def state(self) -> State:
        """Return the newest snapshot."""
        intent, tick_state, verdict = (
            self._controller.intent,
            self._controller.tick_state,
            self._verdict,
        )
        decision, now_ns = tick_state.decision, self._robot.now_ns()
        reasons, picture = tuple(self._controller.reasons(now_ns)), self._recorder.picture
        moving = abs(verdict.twist.v_mps) > MOVING_MPS or abs(verdict.twist.w_radps) > MOVING_MPS
        by_hand = self._controller.hand(now_ns) is not None
        return State(
            stamp_s=now_ns / 1e9,
            scenario=self._recorder.scenario,
            site=self.sites.chosen,
            site_id=intent.site_id,
            robot=self.profile.name,
            phase=intent.mission.phase,
            moving=moving,
            by_hand=by_hand,
            backs_off=self._back_off.is_running,
            summary=status_message(intent, decision, reasons, moving=moving, by_hand=by_hand),
            stop_latched=intent.stopped_by is not None or self._controller.sensors_in_doubt,
            stop_pressed=intent.stopped_by is not None,
            stops=intent.stops,
            stop_warning=self._stop_warning(),
            storage_warning=self._storage_warning(),
            reasons=reasons,
            pose=self._recorder.pose,
            place=self.place.status(),
            twist=decision.frame.twist if decision else STANDSTILL,
            command=verdict.twist,
            queue=intent.mission.queue,
            reached=intent.mission.reached,
            reached_count=intent.mission.reached_count,
            distance_to_goal_m=_length_m(decision)
            if intent.mission.phase is not Phase.IDLE
            else None,
            travelled_m=self._recorder.travelled_m,
            unseen_m=picture.unseen_m if picture else None,
            unknown_price=self.path_settings.unknown_price,
            explored_m2=self._recorder.explored_m2,
            replans=self._recorder.replans,
            images=self._recorder.images,
            tick_ms=self._controller.timer.tick_ms,
            frame_age_s=(now_ns - tick_state.frame_ns) / 1e9
            if tick_state.frame_ns is not None
            else None,
            map_age_s=(now_ns - decision.frame.stamp_ns) / 1e9 if decision else None,
            in_zone=stands_in_zone(decision),
            zones_version=self._edits_before + self.zones.changes,
            beware_version=intent.beware.version,
            beware_enabled=len(intent.beware.enabled),
            segmenter=self._perception.title,
            segmenter_warning=self._perception.warning,
            loop=intent.mission.loop,
            goes_on=intent.mission.goes_on,
            picture_serial=picture.serial if picture else None,
            grid_version=picture.grid_version if picture else None,
            grid_spec=picture.grid_spec if picture else None,
        )

    def newest_tick(self) -> TickSnapshot | None:
        """Return the values of the newest tick; None before the first."""
        return self._recorder.picture

    def cloud(self) -> Cloud | None:
        """Return the points of the map; None before the first tick."""
        return self._recorder.cloud

    # Mission, teleoperation and emergency stop

    def mission(self, action: MissionAction) -> None:
        """Apply a transition of the mission."""
        self._controller.change(lambda intent: self._after(action, intent))

    def _after(self, action: MissionAction, intent: OperatorState) -> OperatorState:
        """Return the operator's state after a transition of the mission."""
        require_meant_site()
        if action in ("start", "resume", "leave"):
            _require_released(intent)
        if action in ("start", "resume"):
            require_known(self._controller.place)
        mission = intent.mission
        drives = mission.phase in MOVING or mission.goes_on
        # A robot that looks for its place, or backs off, can be paused without a mission.
        moves = intent.searching or self._back_off.is_running
        if action != "pause" or drives or not moves:
            mission = TRANSITIONS[action](mission)
        # Without its command, a robot that backs off ends that.
        return dataclasses.replace(intent, mission=mission, search=PlaceSearch.NONE, by_hand=None)

    def drive(self, twist: Twist | None) -> None:
        """Drive by hand for the lifetime of a command; a driving mission is paused and stays so."""
        self._controller.change(self._driving(twist))

    def _driving(self, twist: Twist | None) -> Callable[[OperatorState], OperatorState]:
        """Return the edit by which an operator drives by hand, as of now."""
        command = None if twist is None else Command(twist=twist, stamp_ns=self._robot.now_ns())

        def edit(intent: OperatorState) -> OperatorState:
            if command is None:
                return dataclasses.replace(intent, by_hand=None)
            _require_released(intent)
            mission = intent.mission.pause() if intent.mission.phase in MOVING else intent.mission
            return dataclasses.replace(
                intent, by_hand=command, mission=mission, search=PlaceSearch.NONE
            )

        return edit

    def keep_run(self) -> None:
        """Store what the present run has come to, for the case that the console does not end in
        order."""
        self._recorder.keep_run()

    def back_off(self) -> None:
        """Drive half a metre straight back; a driving mission goes on afterwards."""
        self._back_off.start()

    def _odometry(self) -> Pose2:
        """Return the pose by odometry of the newest image, which waits for no tick; raises
        `Refused` where the images have stopped."""
        frame = self._robot.newest_frame()
        life_ns = DEFAULT_SAFETY.gate.frame_life_ns
        if frame is None or self._robot.now_ns() - frame.stamp_ns > life_ns:
            raise Refused("the camera sends no images; without them the robot does not back off")
        return frame.pose

    def close(self) -> None:
        """End the threads of this object."""
        self._back_off.stop()
        self.teaching.close()

    def stop(self, source: str) -> None:
        """Latch the emergency stop and pause the mission in one step."""

        def edit(intent: OperatorState) -> OperatorState:
            return dataclasses.replace(
                intent,
                stopped_by=intent.stopped_by or source,
                stops=intent.stops + 1,
                mission=intent.mission.halt(),
                by_hand=None,
                search=PlaceSearch.NONE,
            )

        self._controller.change(edit)
        # The command thread would send this within its period; the wheels need not wait for it.
        self._robot.send(STANDSTILL)

    def reset_stop(self, stops: int | None = None) -> None:
        """Release the emergency stop, and accept the pose if odometry has jumped, and the camera's
        clock; the mission stays paused. `stops`: number of stops that the operator has seen; raises
        `Refused` after a newer one."""

        def edit(intent: OperatorState) -> OperatorState:
            if stops not in (None, intent.stops):
                raise Refused("the stop was pressed again meanwhile; look why, then reset it")
            doubted = self._controller.sensors_in_doubt and intent.mission.phase in MOVING
            return dataclasses.replace(
                intent,
                stopped_by=None,
                mission=intent.mission.pause() if doubted else intent.mission,
            )

        self._controller.change(edit)
        self._controller.trust_pose()

    # Poses of the map

    def poses(self) -> tuple[Pose2, ...]:
        """Return the past poses in the order of their pose IDs."""
        return self._controller.navigator.map.poses

    def correct_poses(self, poses: Mapping[int, Pose2]) -> None:
        """Correct past poses, by pose ID; the map follows."""
        site_id = self._controller.intent.site_id
        require_meant_site()
        self._controller.correct_poses(poses, site_id=site_id)

    # Previews and past runs

    def preview(self, draft: PreviewDraft) -> Preview:
        """Plan on the newest map with the draft and without it; nothing is applied."""
        return self._previews.draft(draft, self.zones, self.path_settings)

    def preview_list(self, beware: BewareList) -> ListPreview:
        """Compare another beware list with the one in force on the newest map; nothing is
        applied."""
        return self._previews.beware_list(
            beware, self.beware.list, self.zones.stored, self.path_settings
        )

    def runs(self) -> tuple[Mapping[str, object], ...]:
        """Return the reports of past runs, newest first, without their time series."""
        return self._store.runs()

    def run(self, run_id: str) -> Mapping[str, Any]:
        """Return the whole report of a run."""
        return self._store.run(run_id)


def _require_released(intent: OperatorState) -> None:
    """Raise `Refused` while the emergency stop is latched."""
    if intent.stopped_by is not None:
        raise Refused(f"the emergency stop by {intent.stopped_by} is latched; reset it first")


def _length_m(decision: TickResult | None) -> float | None:
    """Return the length of the planned path in metres; None without one."""
    if decision is None or decision.route is None or isinstance(decision.route.outcome, NoPath):
        return None
    return decision.route.outcome.length * decision.occupancy.spec.resolution_m
