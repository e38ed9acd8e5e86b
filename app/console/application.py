"""The operator console of a simulated or recorded robot: composes its parts, and ends them in the
right order."""

from __future__ import annotations

import dataclasses
import functools
import logging
import signal
import socket
import sys
import threading
import time
import uuid
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType

import cv2

from app.console.backend import BackEnd, recorded, simulated
from app.console.mission.path_settings import stored_unknown_price
from app.console.operations import LiveOperations
from app.console.site.placing import numbered, settle
from app.console.site.site_map import keep_list, list_of_start, map_of
from app.console.site.sites import SESSION_PERIOD_S, expected_place, mission_of
from app.console.status_message import storage_warning
from app.console.stop_latch import PERIOD_S as STOP_PERIOD_S
from app.console.stop_latch import StopLatch, read_latch
from app.replay.carried_camera import for_recordings
from app.runtime.control.background import Background, ThreadBackground
from app.runtime.control.loop import ControlLoop, PeriodicThread, lower_other_priorities
from app.runtime.control.operator_state import OperatorState
from app.runtime.control.robot_controller import RobotController
from app.runtime.control.stage_timer import StageTimer
from app.runtime.fault_injection import FaultInjector
from app.runtime.record.map_keeper import MapKeeper
from app.runtime.record.map_persistence import load_map, names_in
from app.runtime.record.recorder import Recorder
from app.runtime.start.camera_choice import choose_stream
from app.runtime.start.live_perception import LivePerception
from app.runtime.start.preparation import prepared_perception
from app.runtime.start.progress_lines import (
    STARTING_ROBOT,
    WARMING_UP,
    Progress,
    announced,
    on_stderr,
)
from app.runtime.start.segmentation import Perception
from app.runtime.start.segmenter_choice import SegmenterChoice
from app.storage import Store
from app.storage.site_store import SiteStore
from app.teaching.networks.live_networks import composed_at_start
from app.teaching.service import versions_in
from navcore.config.navigator import NavigatorConfig, config_for, load_config
from navcore.files import remove_drafts
from navcore.mapping.point_map import PointMap
from navcore.mission.beware_list import BewareList
from navcore.mission.mission import Mission
from navcore.navigator import Navigator
from navcore.robot.camera_stream import CameraStream
from navcore.robot.profile import HUSKY, RobotProfile
from navcore.stages import Stages
from navcore.warmup import warm_up
from sim.robot.chassis import chassis_for
from sim.robot.odometry_grade import OdometryGrade
from sim.sensors.gnss_settings import GnssKind
from web.auth.access import Access
from web.auth.presence import Unattended
from web.auth.users import first_admin
from web.port import reserve
from web.server import ConsoleServer
from web.starting import StartingPage

log = logging.getLogger(__name__)
EXPIRY_S = 1.0
"""Time between two checks of the zones' expiry, seconds."""
RUN_PERIOD_S = 60.0
"""Time between two looks at a run whose report is stored while it goes on, seconds."""
MOST_FILES = 65_536
"""Number of files that may be open at once, as far as the system allows."""
STOP_FILE = "stopped"
"""File of the data folder that exists while the emergency stop is latched."""
SIGNAL_S = 0.5
"""Longest time until a signal that came to another thread is handled, seconds."""
LOOPBACK = ("127.0.0.1", "localhost", "::1")
"""Addresses that need no login."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunningConsole:
    """A running console."""

    url: str
    """URL of the console page."""
    operations: LiveOperations
    """The console's operations on the robot."""
    admin: tuple[str, str] | None = None
    """Name and password of the admin account that was just created; None when there was one. Only
    the hash of the password is stored."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ConsoleOptions:
    """Options of a console."""

    scenario: str
    """Name of a built-in world, or a world file."""
    recording: Path | None = None
    """Folder of a recording that is played instead of the simulation; None for the simulation."""
    level: bool = False
    """Whether the recording's frame has z up and the floor at 0, so that no floor is fitted."""
    data: Path
    """Data folder."""
    host: str = "127.0.0.1"
    """Address to listen on; any but loopback requires a login."""
    port: int = 8000
    """TCP port; 0 for a free one."""
    seed: int = 0
    """Seed of the simulator."""
    odometry: OdometryGrade = OdometryGrade.TYPICAL
    """How good the simulated robot's odometry is."""
    gnss: GnssKind | None = None
    """GNSS receiver of the simulated robot; None for that of the world."""
    camera: CameraStream | None = None
    """Size and rate of the simulated camera's images; None for what this machine can follow, with
    the robot's own on a slow one."""
    robot: RobotProfile = HUSKY
    """Body, limits and sensors of the robot."""
    choice: SegmenterChoice = field(default_factory=SegmenterChoice)
    """Options of the segmenter."""
    prior: Path | None = None
    """Nav2 map whose obstacles count until they are seen free; None without one."""
    site: str | None = None
    """Site to use, made if it is new; None for the one last used in this world."""
    kept: Path | None = None
    """Map file that is loaded at the start, if it exists, and kept instead of that of the site;
    None for that of the site."""
    beware: BewareList | None = None
    """Beware list that is put in force at the site; None for the site's own."""
    navigation: Path | None = None
    """Configuration file of the navigation, see `load_config`; None for the defaults."""
    login: bool = False
    """Whether a login is required on loopback too."""
    allowed_hosts: tuple[str, ...] = ()
    """Further names under which browsers reach the console; with one a login is required."""
    proxy: str | None = None
    """Address of a TLS proxy before the console; with one a login is required."""
    unattended: Unattended = "go on"
    """Behaviour of a mission when the user in control has gone silent."""


@contextmanager
def console(
    options: ConsoleOptions,
    *,
    listener: socket.socket | None = None,
    starting: StartingPage | None = None,
) -> Iterator[RunningConsole]:
    """Start robot, control loop and server; at the end, the loop stops first, so that the robot
    stands before anything else ends. `starting` is told each step, and ended before the server
    takes over its port."""

    def say(progress: Progress) -> None:
        on_stderr(progress)
        if starting is not None:
            starting.say(progress.step, progress.text(), progress.share, is_over=progress.is_over)

    cv2.setNumThreads(1)
    with ExitStack() as stack:
        listener = stack.enter_context(listener or reserve(options.host, options.port))
        config = (
            config_for(options.robot)
            if options.navigation is None
            else load_config(options.navigation, options.robot)
        )
        if options.recording is not None and options.navigation is None:
            config = for_recordings(config)
        store = Store(options.data)
        stack.callback(store.close)
        composing = functools.partial(
            prepared_perception,
            sensor=options.robot.depth_sensor,
            config=config.perception,
            say=say,
        )
        composed = composed_at_start(
            versions_in(options.data / "teaching"), options.choice, composing
        )
        perception = LivePerception(composed.perception)
        with announced(WARMING_UP, say=say):
            warm_up(perception)
        with announced(STARTING_ROBOT, say=say):
            back_end = _back_end(options, config, composed.perception)
        robot = back_end.robot
        stack.callback(robot.close)
        began_ns = robot.now_ns()
        faults = FaultInjector(lambda: back_end.faults, lambda: (robot.now_ns() - began_ns) / 1e9)
        faults.take_time(time.sleep)
        stages = faults.wrap(Stages()) if back_end.faults else Stages()
        background = ThreadBackground()
        background.start()
        stack.callback(background.stop)
        site = store.sites.of_start(options.site, back_end.name)
        beware = list_of_start(site, back_end.beware, options.beware)
        controller = _controller_of(
            site,
            beware,
            back_end,
            options.robot,
            perception,
            config,
            stages,
            background,
            stopped_by=read_latch(options.data / STOP_FILE),
        )
        point_map = controller.navigator.map
        point_map.pose_ids.name_numberings(lambda: uuid.uuid4().hex)
        keeper = _load_map(point_map, site, options, beware)
        # Not before all is loaded: a start that is refused stores nothing.
        with store.using(site, back_end.name):
            keep_list(site, back_end.beware, beware)
            pose_ids = point_map.pose_ids
            settle(site, numbered(pose_ids.loaded_numbering, pose_ids.array()))
        controller.change(
            lambda intent: dataclasses.replace(intent, mission=mission_of(site), zones=site.zones())
        )
        expected = expected_place(site) if options.kept is None else None
        controller.navigator.adopt_map(expected)
        recorder = Recorder(
            controller=controller, store=store, referee=back_end.referee, scenario=back_end.name
        )
        recorder.watch_zones(controller.intent.zones)
        latch = StopLatch(options.data / STOP_FILE, controller)
        operations = LiveOperations(
            robot=robot,
            controller=controller,
            store=store,
            recorder=recorder,
            robot_urdf=chassis_for(options.robot).urdf(),
            perception=perception,
            data=options.data,
            config=config,
            keeper=keeper,
            has_own_map=options.kept is None,
            world_tags=back_end.tags,
            new_beware=back_end.beware,
            choice=options.choice,
            network=composed.used,
            compose=composing,
            stop_warning=lambda: latch.warning,
            storage_warning=lambda: storage_warning(
                keeper.failure, zones_thread.failure, session_thread.failure
            ),
        )
        # The last one is called first: what is to be stored waits for no network that is prepared.
        stack.callback(operations.close)
        stack.callback(
            lambda: keeper.finish(
                point_map, controller.intent.beware.names, controller.navigator.held_map
            )
        )
        stack.callback(recorder.close)
        stack.callback(operations.sites.keep_session)
        stack.callback(latch.keep)
        zones_thread = PeriodicThread(
            lambda: operations.zones.expire(), period_s=EXPIRY_S, name="expiry of zones"
        )
        session_thread = PeriodicThread(
            operations.sites.keep_session, period_s=SESSION_PERIOD_S, name="session to disk"
        )
        for thread in (
            PeriodicThread(latch.keep, period_s=STOP_PERIOD_S, name="stop to disk"),
            PeriodicThread(
                operations.keep_run, period_s=RUN_PERIOD_S, name="report of the run to disk"
            ),
            zones_thread,
            session_thread,
        ):
            thread.start()
            stack.callback(thread.stop)
        keeper.start()
        stack.callback(keeper.stop)
        operations.insight.start()
        stack.callback(operations.insight.stop)
        is_reached = bool(options.allowed_hosts) or options.proxy is not None
        locked = options.login or is_reached or options.host not in LOOPBACK
        server = ConsoleServer(
            operations,
            options.host,
            options.port,
            listener=listener,
            allowed_hosts=options.allowed_hosts,
            proxy=options.proxy,
            access=Access.by_login(store.users, store.audit)
            if locked
            else Access(audit_log=store.audit),
            unattended=options.unattended,
        )
        stack.callback(controller.finish_edits)  # when loop and server have stopped
        stack.callback(server.stop)
        loop = ControlLoop(
            robot,
            controller,
            on_decision=operations.note_decision,
            on_verdict=operations.note_verdict,
        )
        loop.start()
        stack.callback(loop.stop)  # first: the robot stands before anything else ends
        if starting is not None:
            starting.end()
        server.start()
        lower_other_priorities()
        # Last: the password is shown when the start has succeeded, and never again.
        admin = first_admin(store.users) if locked else None
        yield RunningConsole(url=server.url, operations=operations, admin=admin)


def _back_end(options: ConsoleOptions, config: NavigatorConfig, perception: Perception) -> BackEnd:
    if options.recording is not None:
        return recorded(options.recording, config=config, level=options.level)
    stream = options.camera
    if stream is None:
        chosen = choose_stream(perception.image_ms, options.robot.stream)
        log.info("camera: %s", chosen.text())
        stream = chosen.stream
    return simulated(
        options.scenario,
        seed=options.seed,
        profile=dataclasses.replace(options.robot, stream=stream),
        odometry=options.odometry,
        gnss=options.gnss,
    )


def _load_map(
    point_map: PointMap, site: SiteStore, options: ConsoleOptions, beware: BewareList
) -> MapKeeper:
    """Load the map of the site, or of the file that was given, and return what keeps it."""
    if options.kept is not None:
        load_map(point_map, beware, prior=options.prior, kept=options.kept)
        remove_drafts(options.kept)
        return MapKeeper(options.kept, {**names_in(options.kept), **beware.names})
    stored = map_of(site, point_map.state())
    point_map.restore(stored.state)
    load_map(point_map, beware, prior=options.prior, kept=None)
    return MapKeeper(site.map_file, {**stored.class_names, **beware.names})


def _controller_of(
    site: SiteStore,
    beware: BewareList,
    back_end: BackEnd,
    robot: RobotProfile,
    perception: LivePerception,
    config: NavigatorConfig,
    stages: Stages,
    background: Background,
    *,
    stopped_by: str | None,
) -> RobotController:
    """Return a controller with the beware list and the settings of a site, without zones and goals,
    whose places the map tells; it stands. `stopped_by`: who had stopped the robot, and has not
    reset the stop."""
    timer = StageTimer()
    navigator = Navigator(
        spec=back_end.spec,
        profile=robot,
        segmenter=perception,
        config=config,
        stages=timer.wrap(stages),
    )
    intent = OperatorState(
        site=site.name,
        site_id=site.id,
        mission=Mission(),
        beware=beware,
        stopped_by=stopped_by,
        unknown_price=stored_unknown_price(site),
    )
    return RobotController(
        navigator=navigator,
        profile=robot,
        intent=intent,
        timer=timer,
        background=background,
        sensors=back_end.sensors,
    )


def allow_many_connections() -> None:
    """Raise the limit of open files, of which each connection is one, as far as this process may:
    often it is 1024, which one visitor reaches."""
    if sys.platform == "win32":
        return
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = MOST_FILES if hard == resource.RLIM_INFINITY else min(MOST_FILES, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        with suppress(ValueError, OSError):  # a kernel may allow fewer than it says
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


def run_console(
    options: ConsoleOptions,
    *,
    listener: socket.socket | None = None,
    starting: StartingPage | None = None,
) -> None:
    """Serve until the process is told to end, which ends a start at once."""
    allow_many_connections()
    ended, started = threading.Event(), threading.Event()

    def end(number: int, _: FrameType | None) -> None:
        ended.set()
        if not started.is_set():
            raise SystemExit(128 + number)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    with console(options, listener=listener, starting=starting) as running:
        started.set()
        print(f"The console is at {running.url} (stop it with Ctrl-C).", flush=True)
        if running.admin is not None:
            print(
                "Log in as {} with the password {} - it is shown this once.".format(*running.admin),
                flush=True,
            )
        # In turns: a signal that came to another thread does not wake this one, which handles it.
        while not ended.wait(SIGNAL_S):
            pass
