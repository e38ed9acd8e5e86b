"""The operator console of a simulated or recorded robot: composes its parts, and ends them in the
right order."""

from __future__ import annotations

import secrets
import signal
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import torch

from app.console.backend import BackEnd, recorded, simulated
from app.console.operations import LiveOperations
from app.runtime.fault_injection import FaultInjector
from app.runtime.loop import ControlLoop, PeriodicThread, lower_other_priorities
from app.runtime.map_persistence import load_map, save_map
from app.runtime.operator_state import OperatorState
from app.runtime.recorder import Recorder
from app.runtime.robot_controller import RobotController
from app.runtime.segmentation import Perception, compose
from app.runtime.segmenter_choice import SegmenterChoice
from app.runtime.stage_timer import StageTimer
from app.storage import Store
from navcore.config.navigator import NavigatorConfig, load_config
from navcore.grid.grid import GridSpec
from navcore.mission.beware_list import default_beware_list
from navcore.mission.mission import Mission
from navcore.navigator import Navigator, Stages
from navcore.robot.profile import HUSKY
from navcore.warmup import warm_up
from sim.robot.husky import husky_urdf
from web.auth.access import Access
from web.auth.presence import Unattended
from web.auth.roles import Role
from web.auth.users import new_user
from web.port import reserve
from web.server import ConsoleServer

EXPIRY_S = 1.0
"""Time between two checks of the zones' expiry, seconds."""
LOOPBACK = ("127.0.0.1", "localhost", "::1")
"""Addresses that need no login."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunningConsole:
    """A running console."""

    url: str
    """URL of the console page."""
    operations: LiveOperations
    """The console's operations on the robot."""
    password: str | None = None
    """Password of the admin account that was just created; None when it existed. Only its hash is
    stored."""


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
    choice: SegmenterChoice = field(default_factory=SegmenterChoice)
    """Options of the segmenter."""
    prior: Path | None = None
    """Nav2 map whose obstacles count until they are seen free; None without one."""
    kept: Path | None = None
    """Map file that is loaded at the start, if it exists, and written at the end; None without."""
    navigation: Path | None = None
    """Configuration file of the navigation, see `load_config`; None for the defaults."""
    login: bool = False
    """Whether a login is required on loopback too."""
    unattended: Unattended = "go on"
    """Behaviour of a mission when the user in control has gone silent."""


@contextmanager
def console(
    options: ConsoleOptions, *, listener: socket.socket | None = None
) -> Iterator[RunningConsole]:
    """Start robot, control loop and server; at the end, the loop stops first, so that the robot
    stands before anything else ends."""
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    with ExitStack() as stack:
        listener = stack.enter_context(listener or reserve(options.host, options.port))
        config = (
            NavigatorConfig() if options.navigation is None else load_config(options.navigation)
        )
        store = Store(options.data)
        stack.callback(store.close)
        perception = compose(options.choice, config=config.perception)
        warm_up(perception.segmenter)
        back_end = _back_end(options, config)
        robot = back_end.robot
        stack.callback(robot.close)
        began_ns = robot.now_ns()
        faults = FaultInjector(lambda: back_end.faults, lambda: (robot.now_ns() - began_ns) / 1e9)
        faults.take_time(time.sleep)
        stages = faults.wrap(Stages()) if back_end.faults else Stages()
        controller = _controller_of(store, back_end.spec, perception, config, stages)
        load_map(
            controller.navigator.map,
            controller.intent.beware,
            prior=options.prior,
            kept=options.kept,
        )
        stack.callback(
            lambda: save_map(controller.navigator.map, controller.intent.beware, options.kept)
        )  # when the loop has stopped
        recorder = Recorder(
            controller=controller, store=store, referee=back_end.referee, scenario=back_end.name
        )
        stack.callback(recorder.close)
        recorder.watch_zones(controller.intent.zones)
        operations = LiveOperations(
            robot=robot,
            controller=controller,
            store=store,
            recorder=recorder,
            robot_urdf=husky_urdf(),
            perception=perception,
            labelling=options.data / "labelling",
            config=config,
        )
        expiry = PeriodicThread(operations.zones.expire, period_s=EXPIRY_S, name="expiry of zones")
        expiry.start()
        stack.callback(expiry.stop)
        operations.insight.start()
        stack.callback(operations.insight.stop)
        loop = ControlLoop(
            robot,
            controller,
            on_decision=operations.note_decision,
            on_verdict=operations.note_verdict,
        )
        loop.start()
        stack.callback(loop.stop)
        locked = options.login or options.host not in LOOPBACK
        password = _first_admin(store) if locked else None
        access = (
            Access.by_login(store.users, store.audit) if locked else Access(audit_log=store.audit)
        )
        server = ConsoleServer(
            operations,
            options.host,
            options.port,
            listener=listener,
            access=access,
            unattended=options.unattended,
        )
        server.start()
        stack.callback(server.stop)
        lower_other_priorities()
        stack.callback(loop.stop)  # again, to be first: the robot stands before anything else ends
        yield RunningConsole(url=server.url, operations=operations, password=password)


def _first_admin(store: Store) -> str | None:
    """Create an admin account if there is no user; returns its password, of which only the hash is
    stored."""
    if store.users.all():
        return None
    password = secrets.token_urlsafe(12)
    store.users.add(new_user("admin", Role.ADMIN, password))
    return password


def _back_end(options: ConsoleOptions, config: NavigatorConfig) -> BackEnd:
    if options.recording is not None:
        return recorded(options.recording, config=config, level=options.level)
    return simulated(options.scenario, seed=options.seed, profile=HUSKY)


def _controller_of(
    store: Store, spec: GridSpec, perception: Perception, config: NavigatorConfig, stages: Stages
) -> RobotController:
    """Return a controller with the zones and the beware list of the last session; it stands."""
    timer = StageTimer()
    navigator = Navigator(
        spec=spec,
        profile=HUSKY,
        segmenter=perception.segmenter,
        config=config,
        stages=timer.wrap(stages),
    )
    intent = OperatorState(
        mission=Mission(), beware=store.beware() or default_beware_list(), zones=store.zones()
    )
    return RobotController(navigator=navigator, profile=HUSKY, intent=intent, timer=timer)


def run_console(options: ConsoleOptions, *, listener: socket.socket | None = None) -> None:
    """Serve until the process is told to end."""
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    with console(options, listener=listener) as running:
        print(f"The console is at {running.url} (stop it with Ctrl-C).", flush=True)
        if running.password is not None:
            print(
                f"Log in as admin with the password {running.password} - it is shown this once.",
                flush=True,
            )
        ended.wait()
